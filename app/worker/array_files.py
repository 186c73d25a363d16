"""Named arrays as bytes on disk, and files of them that a dying worker leaves sound.

    fixed part | JSON header | padding | array | padding | array ...

A record has a checked header, then each array, aligned, with a checksum of its own; offsets count from the start of the
record. Never pickled: a damaged or foreign file can be wrong, but cannot run.

Tiles of an unfinished computation are a row of records, each labelled with the key, the number of tiles and its own
index, and appended in one piece. What a killed process left half-written disagrees with its checksum: opening the file
cuts it off there, and all before it counts, so that a worker that dies resumes after the last complete tile. One
process at a time writes a file (by a lock beside it, which the system releases when the process dies); a second one
computes without it.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import mmap
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from io import BytesIO, FileIO
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from app.system.atomic import PRIVATE_FILE, private_opener
from app.system.system import read_at
from engine.core.stored_arrays import ArrayInPieces, Arrays, UnsoundArrays, Writable

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


Made = TypeVar("Made")


class Tiles:
    """The complete tiles of one key. Close it, or use `with`; `finish` when the whole is stored elsewhere.

    note_failure is called once for a file that cannot be written; from then on no further tiles are stored.
    """

    def __init__(self, path: Path, key: str, n_tiles: int, note_failure: Callable[[OSError], None]) -> None:
        self._path = path
        self._key = key
        self._n_tiles = n_tiles
        self._labels = {self._label(index): index for index in range(n_tiles)}
        self._note_failure = note_failure
        self._extents: dict[int, tuple[int, int]] = {}
        self._end = 0
        self._writable = True
        self._lock = FileLock(path.with_name(path.name + ".lock"), mode=PRIVATE_FILE, thread_local=False)
        self._file: FileIO | None = self._open()

    @property
    def complete_tiles(self) -> frozenset[int]:
        """Indices of the tiles that need not be computed again."""
        return frozenset(self._extents)

    def append_tile(self, index: int, arrays: Arrays) -> bool:
        """Store a tile; returns whether that worked. Raises IndexError, TypeError (see `write_record`)."""
        if not 0 <= index < self._n_tiles:
            raise IndexError(f"tile {index}, expected 0 to {self._n_tiles - 1}")
        if self._file is None or not self._writable:
            return False
        record = BytesIO()
        size = write_record(record, self._label(index), arrays)
        try:
            self._append(self._file, record.getbuffer())
        except OSError as error:
            self._note_failure(error)
            self._writable = False
            return False
        self._extents[index] = (self._end, size)
        self._end += size
        return True

    def tile(self, index: int, read: Callable[[Arrays], Made]) -> Made | None:
        """Read the arrays of a tile, read-only and checked again, and return the result of `read`; None where there are
        none, or no sound ones. `read` raises UnsoundArrays where they are not what it needs."""
        if self._file is None or index not in self._extents:
            return None
        offset, size = self._extents[index]
        try:
            return read(read_record(memoryview(read_at(self._file.fileno(), size, offset))).arrays)
        except (OSError, RecordError, UnsoundArrays):  # sound when the file was opened, or never: computed anew
            return None

    def finish(self) -> None:
        """Close and delete the tiles."""
        with contextlib.suppress(OSError):
            self._path.unlink()
        self.close()

    def close(self) -> None:
        """Close; the tiles stay for the next run."""
        if self._file is not None:
            self._file.close()
            self._file = None
        self._unlock()

    def __enter__(self) -> Tiles:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> FileIO | None:
        """The file, locked, its damaged end cut off; None when that is not possible."""
        file = None
        try:
            self._lock.acquire(timeout=0)
            file = FileIO(self._path, "a+", opener=private_opener)
            self._scan(file)
            file.truncate(self._end)
            return file
        except Timeout:
            self._note_failure(OSError(errno.EAGAIN, "another Insitu is at work on the same scene"))
        except OSError as error:
            self._note_failure(error)
        if file is not None:
            file.close()
        self._unlock()
        return None

    def _unlock(self) -> None:
        if self._lock.is_locked:
            with contextlib.suppress(OSError):
                Path(self._lock.lock_file).unlink()  # who waits for it tries again
            self._lock.release()

    def _scan(self, file: FileIO) -> None:
        """Find the sound records, from the start up to the first that is not."""
        size = os.fstat(file.fileno()).st_size
        view = memoryview(mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ)) if size else memoryview(b"")
        while self._end < size:
            try:
                record = read_record(view[self._end :])
                index = self._index_in(record.label)
            except RecordError:
                return
            self._extents[index] = (self._end, record.n_bytes)
            self._end += record.n_bytes

    def _append(self, file: FileIO, record: memoryview) -> None:
        """Append all of the record, or raise an OSError and leave the file as it was."""
        try:
            while len(record):
                record = record[file.write(record) :]
        except OSError:
            with contextlib.suppress(OSError):
                file.truncate(self._end)
            raise

    def _label(self, index: int) -> str:
        return json.dumps([self._key, self._n_tiles, index])

    def _index_in(self, label: str) -> int:
        if label not in self._labels:
            raise RecordError("tiles of something else")
        return self._labels[label]
