"""Blocks of memory that cross from one process to the other: the one module that owns shared memory.

    sender:    allocate ─► write data ─► write header ─► seal ─► descriptor over the socket
    receiver:  check the size ─► map read-only ─► checksum, a slice at a time ─► numpy arrays

A block holds the large buffers of one message. It has no name that could be left behind: `memfd_create` on Linux,
elsewhere a file whose name (tagged with the process id) is removed as soon as it is open; the descriptor is sent
through the socket and the kernel frees the memory with the last mapping, whichever process dies first. Where
descriptors cannot be sent (Windows) the file keeps its name until the receiver has opened it; files that nobody opened
are removed at the next start. The arrays own the mapping, so no view outlives its memory. Data is written after the
space was reserved: a full disk or memory is an OSError here, never a SIGBUS there.

The checksum is the sum of all 64-bit words. It finds what can happen here, a block half written or an older one, at the
speed of memory; CRC-32 on both sides took a tenth of the time of switching curves.

`multiprocessing.shared_memory` was rejected: its names survive a killed process group, its tracker process unlinks
blocks still in use, and a view that outlives the object is a segmentation fault.
"""

from __future__ import annotations

import errno
import itertools
import mmap
import os
import re
import struct
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from app.system import system
from app.system.memory import available_memory
from app.system.system import process_lives
from engine.core.errors import InsituError

Method = Literal["memfd", "named", "kept"]
Buffer = bytes | memoryview

_MAGIC = b"INSITUB2"
_HEADER = struct.Struct("<8sQQQQ")  # magic, generation, bytes of the data, number of buffers, checksum
_EXTENT = struct.Struct("<QQ")  # offset from the start of the block, bytes
_ALIGNMENT = 64
_SLICE = 1 << 20  # bytes checked between two readings of the clock: about 0.1 ms
_WORD = (1 << 64) - 1
_NAME = re.compile(r"insitu-(\d+)-(\d+)\.block")
_CHECK_MEMORY_FROM = 16 << 20
_serial = itertools.count()


class BlockError(Exception):
    """A block is incomplete, damaged or not the one announced; nothing of it may be shown."""


class OutOfMemory(InsituError):
    """The system has no room for a block."""


def default_method() -> Method:
    if system.HAS_ANONYMOUS_FILES:
        return "memfd"
    return "named" if system.PASSES_DESCRIPTORS else "kept"


def create_block(buffers: Sequence[Buffer], generation: int, method: Method | None = None) -> tuple[int | Path, int]:
    """A sealed block with these buffers, and its size in bytes: its descriptor, which the caller closes, or of a `kept`
    one its file, which `open_kept_block` opens and removes.

    Raises OutOfMemory, before anything is written, when there is no room.
    """
    extents, total = _lay_out(buffers)
    _check_available_memory(total)
    descriptor, file = _open_block(method or default_method())
    try:
        system.reserve(descriptor, total)
        _write(descriptor, buffers, extents, generation, total)
        system.seal(descriptor)
    except BaseException as error:
        os.close(descriptor)
        if file is not None:
            file.unlink()
        if isinstance(error, OSError):
            raise _no_room(total, os.strerror(error.errno or errno.EIO)) from error
        raise
    if file is None:
        return descriptor, total
    os.close(descriptor)
    return file, total


def kept_block_name(file: Path) -> tuple[int, int]:
    """The two numbers that identify the file of a `kept` block: its process, and its serial number there."""
    match = _NAME.fullmatch(file.name)
    assert match is not None
    return int(match[1]), int(match[2])


def open_kept_block(process: int, serial: int) -> int:
    """The descriptor of a `kept` block, whose file is removed. Raises BlockError when there is none."""
    try:
        return system.open_last(_file_of(process, serial))
    except OSError as error:
        raise BlockError(f"a block that cannot be opened: {error.strerror}") from error


class Block:
    """A received block, mapped read-only; it hands out its buffers only once the checksum agrees."""

    def __init__(self, descriptor: int, generation: int, size: int) -> None:
        """Map the block; the descriptor is closed in any case. Raises BlockError when it is not the one announced."""
        try:
            if size < _HEADER.size or os.fstat(descriptor).st_size < size:
                raise BlockError(f"a block of {os.fstat(descriptor).st_size} bytes was announced with {size}")
            self._map = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ)
        finally:
            os.close(descriptor)
        magic, found, n_bytes, self._n_buffers, self._checksum = _HEADER.unpack_from(self._map)
        if magic != _MAGIC or n_bytes != size - _HEADER.size:
            raise BlockError("a block without a complete header")
        if found != generation:
            raise BlockError(f"a block of generation {found} where {generation} was announced")
        self._size = size
        self._position = _HEADER.size
        self._sum = _sum_of_numbers(generation, self._n_buffers)

    def verify(self, deadline: float) -> bool:
        """Check until the monotonic time `deadline` (one slice at least); returns True when all agrees.

        Raises BlockError when the checksum does not agree.
        """
        with memoryview(self._map) as view:
            while self._position < self._size:
                end = min(self._position + _SLICE, self._size)
                self._sum = (self._sum + _sum(view[self._position : end])) & _WORD
                self._position = end
                if time.monotonic() >= deadline:
                    break
        if self._position < self._size:
            return False
        if self._sum != self._checksum:
            raise BlockError("a block whose checksum does not agree")
        return True

    def buffers(self) -> list[memoryview]:
        """The buffers, read-only; each keeps the whole block mapped."""
        if self._position < self._size:
            raise BlockError("a block that is not verified yet")
        view = memoryview(self._map)
        extents = [_EXTENT.unpack_from(view, _HEADER.size + i * _EXTENT.size) for i in range(self._n_buffers)]
        return [view[offset : offset + n_bytes] for offset, n_bytes in extents]


def sweep_dead_blocks(folder: Path | None = None) -> None:
    """Remove the names left by processes that were killed between opening a block and removing its name."""
    folder = folder or system.memory_folder()
    for name in os.listdir(folder):
        match = _NAME.fullmatch(name)
        if match and not process_lives(int(match[1])):
            (folder / name).unlink(missing_ok=True)


def _lay_out(buffers: Sequence[Buffer]) -> tuple[list[tuple[int, int]], int]:
    """The offset and size of each buffer, and the size of the block."""
    position = _HEADER.size + _EXTENT.size * len(buffers)
    extents = []
    for buffer in buffers:
        position = -(-position // _ALIGNMENT) * _ALIGNMENT
        extents.append((position, len(buffer)))
        position += len(buffer)
    return extents, -(-position // 8) * 8


def _open_block(method: Method) -> tuple[int, Path | None]:
    if method == "memfd":
        return system.anonymous_file(), None
    file = _file_of(os.getpid(), next(_serial))
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o600)
    if method == "kept":
        return descriptor, file
    os.unlink(file)
    return descriptor, None


def _file_of(process: int, serial: int) -> Path:
    return system.memory_folder() / f"insitu-{process}-{serial}.block"


def _write(
    descriptor: int, buffers: Sequence[Buffer], extents: Sequence[tuple[int, int]], generation: int, total: int
) -> None:
    """Write the table, the buffers and last the header, so that an unfinished block has none."""
    checksum = _sum_of_numbers(generation, len(buffers))
    table = b"".join(_EXTENT.pack(*extent) for extent in extents)
    for start, buffer in [(_HEADER.size, table), *((at, b) for (at, _), b in zip(extents, buffers, strict=True))]:
        checksum += _sum(buffer)  # what is between them is 0
        _write_all(descriptor, buffer, start)
    header = _HEADER.pack(_MAGIC, generation, total - _HEADER.size, len(buffers), checksum & _WORD)
    _write_all(descriptor, header, 0)


def _write_all(descriptor: int, data: Buffer, offset: int) -> None:
    view = memoryview(data)
    while len(view):
        written = system.write_at(descriptor, view, offset)
        view, offset = view[written:], offset + written


def _sum_of_numbers(generation: int, n_buffers: int) -> int:
    return (generation + (n_buffers << 32)) & _WORD


def _sum(data: Buffer) -> int:
    """The sum of the 64-bit words of data that begins on one; bytes missing at the end are 0."""
    n_words, n_left = divmod(len(data), 8)
    words = np.frombuffer(data, "<u8", n_words)
    left = int.from_bytes(data[len(data) - n_left :], "little")
    return int(words.sum(dtype=np.uint64)) + left


def _check_available_memory(total: int) -> None:
    """Refuse what would drive the system out of memory: reserving a memfd would succeed, and the process be killed."""
    if total < _CHECK_MEMORY_FROM:
        return
    available = available_memory()
    if total > 0.9 * available:
        raise _no_room(total, f"{available >> 20} MiB are free")


def _no_room(total: int, why: str) -> OutOfMemory:
    return OutOfMemory(f"no memory for {total / 2**20:.0f} MiB of results: {why}; lower the resolution or the bands")
