"""A GLB 2 file: its container (header, JSON chunk, binary chunk), typed access to its untrusted JSON, the lists that
refer to each other, the values of accessors, and the bytes of images.

Every length, count, offset and stride is checked against the available bytes before it is used. The JSON is decoded
once; `JsonObject` then returns its integers, numbers and lists only if they conform to glTF 2.0 (Khronos), and
otherwise names the place of the error. Errors that can be repaired (a factor of 1.0000001) are repaired, with a note.
Images are in the binary chunk, as data in the JSON, or files beside it.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value
from engine.core.safe_files import read_regular_file, resolve_inside
from engine.scene.mesh import MAX_MESH_BYTES

MAX_ITEMS = 1_000_000
_JSON, _BIN = 0x4E4F534A, 0x004E4942
FLOATS = (5126,)
SHARES = (5126, 5121, 5123)  # from 0 to 1: floats, or integers whose largest value is 1
ANY_SHARES = (5126, 5120, 5121, 5122, 5123)
INTEGERS = (5121, 5123, 5125)
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MOST_ZEROS = 1_000_000  # rows of a sparse accessor without a view, plus one for every byte of the file
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MAX_IMAGE_BYTES = 256 * 2**20


@dataclass(frozen=True)
class JsonObject:
    """A JSON object of a file and its place in it ("meshes 3: primitives 0"). notes: repairs and omissions, each line
    once, in order; all objects of a file share them."""

    values: dict[str, Any]
    place: str
    file: Path
    notes: dict[str, None] = field(default_factory=dict)

    def error(self, key: str, value: object, expected: str) -> LoadError:
        """An error about one key."""
        return LoadError(self.file, f"{self.place}: {key}" if self.place else key, value, expected)

    def note(self, key: str, value: object, words: str) -> None:
        """Note how an invalid value was treated, without rejecting the file."""
        self.notes[f"{self.place}: {key} = {describe_value(value)}, {words}"] = None

    def clamped(self, value: float, key: str, low: float = 0.0, high: float = 1.0) -> float:
        """Clamp a value to its range, with a note: exporters round their numbers."""
        if low <= value <= high:
            return value
        end = min(max(value, low), high)
        self.note(key, value, f"taken as {end:g}")
        return end

    def has(self, key: str) -> bool:
        """Whether the key is present."""
        return key in self.values

    def integer(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """An integer in [low, high]; required if there is no default."""
        value = self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            shown = "nothing" if key not in self.values else value
            raise self.error(key, shown, f"an integer from {low} to {high}")
        return value

    def numbers(self, key: str, count: int, default: tuple[float, ...]) -> tuple[float, ...]:
        """A list of finite numbers."""
        value = self.values.get(key, list(default))
        if not isinstance(value, list) or len(value) != count or not all(_is_number(v) for v in value):
            raise self.error(key, value, f"{count} finite numbers")
        return tuple(float(v) for v in value)

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        value = self.values.get(key, default)
        if not _is_number(value):
            raise self.error(key, value, "a finite number")
        return float(value)

    def text(self, key: str) -> str | None:
        """A string, or None if the key is missing."""
        value = self.values.get(key)
        if value is not None and not isinstance(value, str):
            raise self.error(key, value, "a string")
        return value

    def child(self, key: str) -> JsonObject:
        """The object under a key, empty if it is missing."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, value, "an object")
        return JsonObject(value, f"{self.place}: {key}" if self.place else key, self.file, self.notes)

    def children(self, key: str) -> list[JsonObject]:
        """The list of objects under a key, empty if it is missing."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or len(value) > MAX_ITEMS:
            raise self.error(key, value, f"a list of at most {MAX_ITEMS} objects")
        place = f"{self.place}: {key}" if self.place else key
        for i, item in enumerate(value):
            if not isinstance(item, dict):
                raise LoadError(self.file, f"{place} {i}", item, "an object")
        return [JsonObject(item, f"{place} {i}", self.file, self.notes) for i, item in enumerate(value)]

    def item(self, key: str, index: int) -> JsonObject | None:
        """One object of a list, without checking the others; None past its end."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value[index : index + 1]):
            raise self.error(f"{key} {index}", value, "an object")
        place = f"{self.place}: {key} {index}" if self.place else f"{key} {index}"
        return JsonObject(value[index], place, self.file, self.notes) if index < len(value) else None

    def indices(self, key: str, count: int) -> list[int]:
        """A list of indices below count."""
        value = self.values.get(key, [])
        good = isinstance(value, list) and all(isinstance(v, int) and not isinstance(v, bool) for v in value)
        if not good or not all(0 <= v < count for v in value):
            raise self.error(key, value, f"a list of indices from 0 to {count - 1}")
        return value


def _is_number(value: object) -> bool:
    """A finite JSON number that a float can represent."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def parse_glb(data: bytes, file: Path) -> tuple[JsonObject, bytes]:
    """The root object and the binary chunk (empty if there is none); raises LoadError."""
    if len(data) < 12:
        raise LoadError(file, "size", f"truncated at byte {len(data)}", "a header of 12 bytes")
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF":
        raise LoadError(file, "magic", magic.decode("ascii", "replace"), "glTF")
    if version != 2:
        raise LoadError(file, "container version", version, "GLB 2")
    if length > len(data):
        raise LoadError(file, "size", f"truncated at byte {len(data)}", f"{length} bytes, as the header says")
    trailing, data = len(data) - length, data[:length]
    kind, text, at = _chunk(data, 12, file)
    if kind != _JSON:
        raise LoadError(file, "first chunk", hex(kind), "JSON")
    binary = b""
    if at < len(data):
        kind, content, at = _chunk(data, at, file)
        binary = content if kind == _BIN else b""
    root = _decode(text, file)
    if trailing:
        root.notes[f"{trailing} bytes after the end that the header gives are left out"] = None
    return root, binary


def _chunk(data: bytes, start: int, file: Path) -> tuple[int, bytes, int]:
    """Type and content of the chunk at `start`, and the start of the next one."""
    if start + 8 > len(data):
        raise LoadError(file, f"chunk at byte {start}", f"truncated at byte {len(data)}", "a chunk header of 8 bytes")
    length, kind = struct.unpack_from("<II", data, start)
    end = start + 8 + length
    if end > len(data):
        left = len(data) - start - 8
        raise LoadError(file, f"corrupt chunk at byte {start}: length", length, f"at most {left} bytes")
    return kind, data[start + 8 : end], end


def _decode(text: bytes, file: Path) -> JsonObject:
    """The root object of a glTF 2 JSON text."""
    try:
        # Some exporters begin with a byte order mark and pad with zeros.
        root = json.loads(text.decode("utf-8-sig").rstrip("\0"))
    except RecursionError:
        raise LoadError(file, "JSON", "too deep", "JSON with a few levels") from None
    except ValueError as error:
        raise LoadError(file, "JSON", str(error), "valid JSON") from None
    if not isinstance(root, dict):
        raise LoadError(file, "JSON root", type(root).__name__, "an object")
    fields = JsonObject(root, "", file)
    if not (fields.child("asset").text("version") or "").startswith("2."):
        raise fields.error("asset: version", fields.child("asset").values.get("version", "nothing"), "2.0")
    return fields


@dataclass(frozen=True)
class GltfFile:
    """The lists of a file that refer to each other."""

    path: Path
    binary: bytes
    views: list[JsonObject]
    accessors: list[JsonObject]
    meshes: list[JsonObject]
    nodes: list[JsonObject]
    n_materials: int

    def read(self, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
        """Rows (count, width) of the accessor that `owner` names under `key`."""
        accessor = self.accessors[owner.integer(key, 0, len(self.accessors) - 1)]
        if accessor.text("type") != kind:
            raise accessor.error("type", accessor.text("type") or "nothing", f"{kind} for {key}")
        component = accessor.integer("componentType", 5120, 5126)
        if component not in components:
            raise accessor.error("componentType", component, f"one of {', '.join(map(str, components))} for {key}")
        layout, width = np.dtype(_COMPONENTS[component]), _WIDTHS[kind]
        if not accessor.has("sparse"):
            return self._rows(accessor, layout, width)
        # A sparse accessor replaces some rows of the view, or of zeros [glTF20, 3.6.2.3].
        if accessor.has("bufferView"):
            rows = self._rows(accessor, layout, width).copy()
        else:
            rows = np.zeros((accessor.integer("count", 1, MOST_ZEROS + len(self.binary)), width), layout)
        sparse = accessor.child("sparse")
        n, where = sparse.integer("count", 0, len(rows)), sparse.child("indices")
        if n:
            index = np.dtype(_COMPONENTS[where.integer("componentType", 5121, 5125)])
            places = self._rows(where, index, 1, n)[:, 0].astype(np.int64)
            if places.min() < 0 or places.max() >= len(rows):
                raise where.error("indices", int(places.max()), f"indices from 0 to {len(rows) - 1}")
            rows[places] = self._rows(sparse.child("values"), layout, width, n)
        return rows

    def _rows(self, owner: JsonObject, layout: np.dtype, width: int, count: int | None = None) -> npt.NDArray:
        """Rows of a buffer view from an owner's byteOffset on; as many as the owner says, or count."""
        row = layout.itemsize * width
        view = self.views[owner.integer("bufferView", 0, len(self.views) - 1)]
        view.integer("buffer", 0, 0)
        start = view.integer("byteOffset", 0, len(self.binary), 0)
        length = view.integer("byteLength", 1, len(self.binary) - start)
        stride = view.integer("byteStride", max(4, row), 252) if view.has("byteStride") else row
        offset = owner.integer("byteOffset", 0, length, 0)
        most = max(0, length - offset - row) // stride + (1 if length - offset >= row else 0)
        if count is None:
            count = owner.integer("count", 1, most)
        elif count > most:
            raise owner.error("count", count, f"an integer from 1 to {most}")
        window = np.frombuffer(self.binary, np.uint8, (count - 1) * stride + row, start + offset)
        rows = np.lib.stride_tricks.as_strided(window, (count, row), (stride, 1))
        return np.ascontiguousarray(rows).view(layout)

    def read_shares(self, owner: JsonObject, key: str, kind: str, components: tuple[int, ...]) -> npt.NDArray:
        """Rows as floats, float64; integers are shares of their largest value [glTF20, 3.11]."""
        values = self.read(owner, key, kind, components)
        if values.dtype.kind == "f":
            return values.astype(np.float64)
        return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)


def image_reader(path: Path) -> Callable[[int], bytes]:
    """Return a function from an image's number to its bytes in a GLB file; it, too, raises LoadError naming the place
    and what was expected there."""
    return partial(image_bytes, *parse_glb(read_regular_file(path, MAX_MESH_BYTES), path))


def image_bytes(root: JsonObject, binary: bytes, index: int) -> bytes:
    """The bytes of an image of a file that was read already: its root and its binary chunk."""
    image = root.item("images", index)
    if image is None:
        there = len(root.values.get("images", []))
        raise root.error(f"images {index}", "nothing", f"an image from 0 to {there - 1}" if there else "images")
    uri = image.text("uri")
    if uri is None:
        return _from_chunk(root, image, binary)
    if uri.startswith("data:"):
        return _from_data(image, uri)
    place = resolve_inside(root.file.parent, unquote(uri), root.file, f"{image.place}: uri")
    return read_regular_file(place, MAX_IMAGE_BYTES)


def _from_chunk(root: JsonObject, image: JsonObject, binary: bytes) -> bytes:
    """The bytes of a buffer view."""
    index = image.integer("bufferView", 0, MAX_ITEMS)
    view = root.item("bufferViews", index)
    if view is None:
        raise image.error("bufferView", index, f"an integer from 0 to {len(root.children('bufferViews')) - 1}")
    view.integer("buffer", 0, 0)
    start = view.integer("byteOffset", 0, len(binary), 0)
    return binary[start : start + view.integer("byteLength", 1, len(binary) - start)]


def _from_data(image: JsonObject, uri: str) -> bytes:
    """The bytes of a `data:` URI in base64."""
    kind, comma, text = uri.partition(",")
    try:
        if not comma or not kind.endswith(";base64"):
            raise ValueError
        return base64.b64decode(text, validate=True)
    except (ValueError, binascii.Error):
        raise image.error("uri", uri, "data in base64") from None
