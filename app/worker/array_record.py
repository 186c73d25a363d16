"""Named arrays as bytes on disk: a checked header, then each array, aligned, with a checksum of its own.

    fixed part | JSON header | padding | array | padding | array ...

Offsets count from the start of the record. Never pickled: a damaged or foreign file can be wrong, but cannot run.
"""

from __future__ import annotations

import json
import math
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayInPieces, Writable

VERSION = 1
ALIGNMENT = 64
_MAGIC = b"INSITUA1"
_FIXED = struct.Struct("<8sIIQI")  # magic, version, bytes of the JSON, bytes of the record, crc32 of JSON and numbers
_LARGEST_JSON = 1 << 20
_KINDS = "biufc"  # booleans and numbers: nothing that would need pickling
_DTYPE = re.compile(rf"[<>|][{_KINDS}](1|2|4|8|16)")
_CHECKSUM = re.compile("[0-9a-f]{8}")
_MOST_AXES = 8


class RecordError(Exception):
    """The bytes are not a record of this format, or incomplete or damaged."""


@dataclass(frozen=True)
class ArrayEntry:
    """The position of an array in a record."""

    name: str
    dtype: np.dtype[np.generic]
    shape: tuple[int, ...]
    offset: int
    crc: int

    @property
    def n_bytes(self) -> int:
        return self.dtype.itemsize * math.prod(self.shape)


@dataclass(frozen=True)
class Record:
    """A record that was read: arrays are read-only views of the buffer."""

    label: str
    arrays: dict[str, NDArray[np.generic]]
    n_bytes: int


def record_size(arrays: Writable, label: str) -> int:
    """Bytes that `write_record` will write."""
    header = _json_header(label, _lay_out(arrays))
    return _aligned(_FIXED.size + len(header)) + sum(_aligned(array.nbytes) for array in arrays.values())


def write_record(file: BinaryIO, label: str, arrays: Writable) -> int:
    """Write a record at the position of the file, which must be seekable; returns its size. Each piece is requested
    once.

    Raises TypeError for arrays that hold neither numbers nor booleans, ValueError for pieces that are not as announced.
    """
    entries = _lay_out(arrays)
    begin, start = file.tell(), _aligned(_FIXED.size + len(_json_header(label, entries)))
    file.write(bytes(start))
    entries = [replace(entry, crc=_write_array(file, arrays[entry.name], entry)) for entry in entries]
    end = file.tell()
    header = _json_header(label, entries)
    numbers = _FIXED.pack(_MAGIC, VERSION, len(header), end - begin, 0)
    file.seek(begin)
    file.write(_FIXED.pack(_MAGIC, VERSION, len(header), end - begin, zlib.crc32(header, zlib.crc32(numbers))))
    file.write(header)
    file.seek(end)
    return end - begin


def _write_array(file: BinaryIO, array: NDArray[np.generic] | ArrayInPieces, entry: ArrayEntry) -> int:
    """Write it and the padding before the next; returns its checksum."""
    crc = n_bytes = 0
    for piece in _pieces(array):
        if piece.dtype != entry.dtype or piece.shape[1:] != entry.shape[1:]:
            raise ValueError(f"{entry.name!r}: a piece is {piece.dtype} {piece.shape}, announced as {entry}")
        content = _bytes_of(piece)
        crc, n_bytes = zlib.crc32(content, crc), n_bytes + len(content)
        file.write(content)
    if n_bytes != entry.n_bytes:
        raise ValueError(f"{entry.name!r}: pieces of {n_bytes} bytes, announced as {entry}")
    file.write(bytes(_aligned(n_bytes) - n_bytes))
    return crc


def read_record(buffer: memoryview) -> Record:
    """The record at the start of `buffer`. Every byte is checked, and the header's content as well: a checksum finds
    accidents, not a header that somebody has forged. Raises RecordError when anything disagrees."""
    label, entries, size = _read_header(buffer)
    arrays = {}
    for entry in entries:
        data = buffer[entry.offset : entry.offset + entry.n_bytes]
        if zlib.crc32(data) != entry.crc:
            raise RecordError(f"array {entry.name!r} is damaged")
        arrays[entry.name] = np.frombuffer(data, entry.dtype).reshape(entry.shape)
    return Record(label, arrays, size)


def _lay_out(arrays: Writable) -> list[ArrayEntry]:
    """Entries with offsets from the end of the header and without checksums; its size depends on neither."""
    entries, offset = [], 0
    for name, array in arrays.items():
        if array.dtype.kind not in _KINDS:
            raise TypeError(f"array {name!r} has dtype {array.dtype}, expected numbers or booleans")
        entries.append(ArrayEntry(name, array.dtype, array.shape, offset, crc=0))
        offset += _aligned(array.nbytes)
    return entries


def _json_header(label: str, entries: list[ArrayEntry]) -> bytes:
    rows = [[e.name, e.dtype.str, list(e.shape), e.offset, f"{e.crc:08x}"] for e in entries]
    return json.dumps({"label": label, "arrays": rows}).encode()


def _read_header(buffer: memoryview) -> tuple[str, list[ArrayEntry], int]:
    """The label, the entries with offsets from the start of the record, and its size."""
    if len(buffer) < _FIXED.size:
        raise RecordError("truncated in its header")
    magic, version, json_size, size, crc = _FIXED.unpack_from(buffer)
    if magic != _MAGIC or version != VERSION:
        raise RecordError("not a record of this version")
    if json_size > _LARGEST_JSON or size > len(buffer):
        raise RecordError(f"truncated: {len(buffer)} of {size} bytes")
    header = bytes(buffer[_FIXED.size : _FIXED.size + json_size])
    if zlib.crc32(header, zlib.crc32(_FIXED.pack(magic, version, json_size, size, 0))) != crc:
        raise RecordError("its header is damaged")
    return *_content(header, _aligned(_FIXED.size + json_size), size), size


def _content(header: bytes, start: int, end: int) -> tuple[str, list[ArrayEntry]]:
    """The content of the JSON, if it is as this module writes it: arrays that follow each other from `start` to
    `end`."""
    try:
        content = json.loads(header)
    except (ValueError, RecursionError):
        raise RecordError("its header is not JSON") from None
    label, rows = (content.get(key) if isinstance(content, dict) else None for key in ("label", "arrays"))
    if not isinstance(label, str) or not isinstance(rows, list):
        raise RecordError("its header has no label or no arrays")
    entries: list[ArrayEntry] = []
    offset = start
    for row in rows:
        entry = _entry(row, start)
        if entry.offset != offset or any(entry.name == other.name for other in entries):
            raise RecordError(f"array {entry.name!r} is not where it should be")
        entries.append(entry)
        offset += _aligned(entry.n_bytes)
    if offset != end:
        raise RecordError(f"its arrays end at byte {offset} of {end}")
    return label, entries


def _entry(row: Any, start: int) -> ArrayEntry:
    """One array's row of the header."""
    match row:
        case [str(name), str(dtype), [*shape], int(offset), str(crc)] if (
            _DTYPE.fullmatch(dtype)
            and len(shape) <= _MOST_AXES
            and all(type(side) is int and side >= 0 for side in shape)
            and math.prod(max(side, 1) for side in shape) < 1 << 56  # NumPy refuses more, empty or not
            and _CHECKSUM.fullmatch(crc)
        ):
            try:
                return ArrayEntry(name, np.dtype(dtype), tuple(shape), start + offset, int(crc, 16))
            except TypeError:  # such as a complex number of one byte
                pass
    raise RecordError("its header does not say what its arrays are")


def _pieces(array: NDArray[np.generic] | ArrayInPieces) -> Iterator[NDArray[np.generic]]:
    if isinstance(array, ArrayInPieces):
        yield from array.pieces()
    else:
        yield array


def _bytes_of(array: NDArray[np.generic]) -> memoryview:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def _aligned(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT
