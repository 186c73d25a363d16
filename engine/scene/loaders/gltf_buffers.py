"""A glTF file's container and its bytes: GLB or JSON, buffers and images inside it, as data in the JSON, or in files
beside it.

Every length and offset is checked against the available bytes before it is used. Files that a glTF file names are read
only from its own folder and below (`resolve_inside`), never from another machine. Buffers are read when something first
needs them: one that nothing shown needs may be missing. Views that EXT_meshopt_compression or KHR_meshopt_compression
compress are decoded here, so that accessors see plain bytes.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file, resolve_inside
from engine.scene.loaders.gltf_json import JsonObject, decode_json
from engine.scene.mesh import MAX_MESH_BYTES

Bytes = npt.NDArray[np.uint8]

MAX_COUNT = 2**31 - 1
MAX_IMAGE_BYTES = 256 * 2**20
MESHOPT = ("KHR_meshopt_compression", "EXT_meshopt_compression")
# Limit of the bytes that compressed views have once they are decoded, plus more for every byte of the file: a stream of
# zeros shrinks a thousandfold.
MOST_DECODED = 1 << 24
DECODED_A_BYTE = 64
_JSON, _BIN = 0x4E4F534A, 0x004E4942


def open_gltf(path: Path) -> tuple[JsonObject, GltfBuffers]:
    """The root object of a .glb or .gltf file, by its content, and its bytes; raises LoadError."""
    data = read_regular_file(path, MAX_MESH_BYTES)
    is_json = path.suffix.lower() == ".gltf" or data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{")
    if is_json and not data.startswith(b"glTF"):
        root, binary = decode_json(data, path), b""
    else:
        root, binary = parse_glb(data, path)
    return root, GltfBuffers(root, binary)


def parse_glb(data: bytes, file: Path) -> tuple[JsonObject, bytes]:
    """The root object and the binary chunk (empty if there is none) of a GLB file; raises LoadError."""
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
    root = decode_json(text, file)
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


class GltfBuffers:
    """The bytes of a file's buffers, buffer views and images. n_bytes: of all buffers that were read so far, by which
    the cost of what they describe is limited; n_read: numbers that accessors took of them so far."""

    def __init__(self, root: JsonObject, chunk: bytes) -> None:
        self._root, self._chunk, self.n_bytes, self.n_read = root, chunk, len(chunk), 0
        self._buffers, self.views = root.children("buffers"), root.children("bufferViews")
        self._read: dict[int, bytes] = {}
        self._files: dict[Path, bytes] = {}
        self._decoded: dict[int, Bytes] = {}
        self._n_decoded = 0

    def view(self, owner: JsonObject, key: str = "bufferView") -> tuple[JsonObject, Bytes]:
        """The buffer view that `owner` names, and its bytes, decoded if they are compressed."""
        index = owner.integer(key, 0, len(self.views) - 1)
        view = self.views[index]
        extensions = view.child("extensions")
        compressed = next((extensions.child(name) for name in MESHOPT if extensions.has(name)), None)
        if compressed is None:
            return view, self._slice(view)
        if index not in self._decoded:
            self._decoded[index] = self._decode(view, compressed)
        return view, self._decoded[index]

    def image(self, index: int) -> bytes:
        """The bytes of an image's file; raises LoadError naming the place and what was expected there."""
        image = self._root.item("images", index)
        if image is None:
            there = len(self._root.values.get("images", []))
            expected = f"an image from 0 to {there - 1}" if there else "images"
            raise self._root.error(f"images {index}", "nothing", expected)
        uri = image.text("uri")
        if uri is None:
            return self.view(image)[1].tobytes()
        return (
            _from_data(image, uri) if uri.startswith("data:") else read_regular_file(_path(image, uri), MAX_IMAGE_BYTES)
        )

    def _slice(self, owner: JsonObject) -> Bytes:
        """The bytes that a view, or the extension that compresses it, takes from its buffer."""
        buffer = self._buffer(owner.integer("buffer", 0, len(self._buffers) - 1))
        start = owner.integer("byteOffset", 0, len(buffer), 0)
        length = owner.integer("byteLength", 1, len(buffer) - start)
        return np.frombuffer(buffer, np.uint8, length, start)

    def _buffer(self, index: int) -> bytes:
        if index not in self._read:
            self._read[index] = self._load(self._buffers[index], is_first=index == 0)
        return self._read[index]

    def _load(self, buffer: JsonObject, is_first: bool) -> bytes:
        """All bytes of a buffer: the binary chunk for the first one without a URI."""
        uri, length = buffer.text("uri"), buffer.integer("byteLength", 1, MAX_COUNT)
        if uri is not None:
            content = _from_data(buffer, uri) if uri.startswith("data:") else self._file(buffer, uri)
            if self.n_bytes > MAX_MESH_BYTES:
                raise buffer.error("bytes of all buffers", self.n_bytes, f"at most {MAX_MESH_BYTES}")
        elif is_first and self._chunk:
            content = self._chunk
        else:
            raise buffer.error("uri", "nothing", "the name of a file, or data")
        if length > len(content):
            where = "a binary chunk" if uri is None else "data"
            raise buffer.error(
                "byteLength", f"{length} in {where} truncated at byte {len(content)}", f"at most {len(content)} bytes"
            )
        return content

    def _file(self, buffer: JsonObject, uri: str) -> bytes:
        """The bytes of a buffer's file, which is read and counted once, however many buffers name it."""
        path = _path(buffer, uri)
        if path not in self._files:
            self._files[path] = read_regular_file(path, MAX_MESH_BYTES)
            self.n_bytes += len(self._files[path])
        return self._files[path]

    def _decode(self, view: JsonObject, compressed: JsonObject) -> Bytes:
        """The decoded bytes of a compressed view. Its own buffer is for programs without the extension."""
        from engine.scene.loaders.meshopt import CodecError, decode_meshopt  # late: few files need the compiler

        view.mark_read("buffer", "byteOffset", "byteLength")
        stride, mode = compressed.integer("byteStride", 1, 256), compressed.text("mode") or "nothing"
        count, filtering = compressed.integer("count", 1, MAX_COUNT), compressed.text("filter") or "NONE"
        source = self._slice(compressed)
        self._n_decoded += count * stride
        most = MOST_DECODED + DECODED_A_BYTE * self.n_bytes
        if self._n_decoded > most:
            raise compressed.error("decoded bytes", self._n_decoded, f"at most {most} in a file of this size")
        try:
            return decode_meshopt(source, count, stride, mode, filtering)
        except CodecError as error:
            raise compressed.error(error.what, error.value, error.expected) from None


def gltf_image_reader(path: Path) -> Callable[[int], bytes]:
    """Return a function from an image's number to its bytes in a glTF file; it, too, raises LoadError naming the place
    and what was expected there."""
    return partial(GltfBuffers.image, open_gltf(path)[1])


def _path(owner: JsonObject, uri: str) -> Path:
    """The path of a file in the folder of the glTF file."""
    return resolve_inside(owner.file.parent, unquote(uri), owner.file, f"{owner.place}: uri")


def _from_data(owner: JsonObject, uri: str) -> bytes:
    """The bytes of a `data:` URI in base64."""
    kind, comma, text = uri.partition(",")
    try:
        if not comma or not kind.endswith(";base64"):
            raise ValueError
        return base64.b64decode(text + "=" * (-len(text) % 4), validate=True)
    except (ValueError, binascii.Error):
        raise owner.error("uri", uri, "data in base64") from None
