"""The GLB 2 container: header, JSON chunk, binary chunk; and typed access to the JSON of an untrusted file.

Every length is checked against the available bytes before it is used. The JSON is decoded once; `JsonObject` then
returns its integers, numbers and lists only if they conform to glTF 2.0 (Khronos), and otherwise names the place of the
error. Errors that can be repaired (a factor of 1.0000001) are repaired, with a note.
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from engine.core.errors import LoadError, describe_value

MAX_ITEMS = 1_000_000
_JSON, _BIN = 0x4E4F534A, 0x004E4942


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
