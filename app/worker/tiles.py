"""Tiles of an unfinished computation, stored so that a worker that dies resumes after the last complete one.

A tiles file is a row of records (see `array_record`), each labelled with the key, the number of tiles and its own
index, and appended in one piece. What a killed process left half-written disagrees with its checksum: opening the file
cuts it off there, and all before it counts. One process at a time writes a file (by a lock beside it, which the system
releases when the process dies); a second one computes without it.
"""

from __future__ import annotations

import contextlib
import errno
import json
import mmap
import os
from collections.abc import Callable
from io import BytesIO, FileIO
from pathlib import Path
from typing import TypeVar

from filelock import FileLock, Timeout

from app.system.atomic import PRIVATE_FILE, private_opener
from app.system.system import read_at
from app.worker.array_record import RecordError, read_record, write_record
from engine.core.stored_arrays import Arrays, UnsoundArrays

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
