"""The transport cache: arrays on disk under a key, so that a scene seen before opens at once.

A key is a hash of all that the arrays depend on (`content_key`), so an entry is never out of date, only absent.
Entries are written to a temporary name and renamed, read through a memory map, checked byte by byte before they are
handed out, and deleted when anything is wrong with them. The least recently used go when the bound is exceeded. The
cache only ever saves time: what goes wrong with it becomes a note, never an error.
"""

from __future__ import annotations

import contextlib
import hashlib
import mmap
import os
import re
from pathlib import Path
from typing import BinaryIO

import numpy as np
import platformdirs
from numpy.typing import NDArray

from app.atomic import replacing, sweep_temporaries
from app.jobs.array_record import Arrays, RecordError, read_record, record_size, write_record
from app.jobs.tiles import Tiles

CACHE_VARIABLE = "INSITU_CACHE"
DEFAULT_BOUND = 4 << 30
_KEY = re.compile(r"[A-Za-z0-9_-]{1,120}")
_ENTRY = ".arrays"
_TILES = ".tiles"

KeyPart = str | bytes | int | float | bool | None | NDArray[np.generic] | tuple["KeyPart", ...]


def cache_folder() -> Path:
    """`$INSITU_CACHE`, or the platform's place for caches."""
    configured = os.environ.get(CACHE_VARIABLE)
    if configured:
        return Path(configured)
    return Path(platformdirs.user_cache_dir("insitu", appauthor=False))


def content_key(*parts: KeyPart) -> str:
    """A hash (BLAKE2b, 160 bits) of values and their types: equal keys mean equal parts."""
    digest = hashlib.blake2b(digest_size=20)
    _feed(digest, parts)
    return digest.hexdigest()


class Store:
    """Arrays by key in one folder, at most `bound` bytes of them.

    Several processes may use one folder at a time: entries appear and go as wholes.
    """

    def __init__(self, folder: Path | None = None, bound: int = DEFAULT_BOUND) -> None:
        self._folder = folder or cache_folder()
        self._bound = bound
        self._notes: list[str] = []
        sweep_temporaries(self._folder)

    def take_notes(self) -> tuple[str, ...]:
        """What a person should know about the cache since the last call; each note once."""
        notes, self._notes = self._notes, []
        return tuple(dict.fromkeys(notes))

    def get(self, key: str) -> dict[str, NDArray[np.generic]] | None:
        """The arrays under the key, read-only and mapped from the file; None when there are none, or no sound ones."""
        path = self._path(key, _ENTRY)
        try:
            arrays = _read_entry(path, key)
        except FileNotFoundError:
            return None
        except RecordError as error:
            self._notes.append(f"cache entry {path.name} was not usable ({error}); it is computed again")
            _remove(path)
            return None
        except OSError as error:  # no memory to map it, no right to read it: it may be sound
            self._notes.append(f"cache entry {path.name} cannot be read ({error.strerror}); it is computed again")
            return None
        _touch(path)
        return arrays

    def put(self, key: str, arrays: Arrays) -> bool:
        """Keep the arrays, or note why not."""
        size = record_size(arrays, key)
        if size > self._bound:
            self._notes.append(f"{size >> 20} MiB are more than the cache may hold ({self._bound >> 20} MiB); not kept")
            return False
        path = self._path(key, _ENTRY)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with replacing(path, durable=False) as file:
                _reserve(file, size)
                write_record(file, key, arrays)
        except OSError as error:
            self._note_failure(error)
            return False
        self._shrink(keep=path)
        return True

    def open_tiles(self, key: str, n_tiles: int) -> Tiles:
        """The tiles of an unfinished computation, with those that an earlier run completed."""
        path = self._path(key, _TILES)
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
        self._shrink(keep=path)
        return Tiles(path, key, n_tiles, self._note_failure)

    def size(self) -> int:
        """Bytes in the cache now."""
        return sum(n_bytes for _, n_bytes, _ in self._entries())

    def clear(self) -> None:
        """Delete all entries."""
        for _, _, path in self._entries():
            _remove(path)

    def _shrink(self, keep: Path) -> None:
        """Delete the least recently used entries until the bound is kept."""
        entries = self._entries()
        total = sum(n_bytes for _, n_bytes, _ in entries)
        for _, n_bytes, path in sorted(entries):
            if total <= self._bound:
                return
            if path != keep:
                _remove(path)
                total -= n_bytes

    def _entries(self) -> list[tuple[int, int, Path]]:
        """(time of last use, bytes, path) of each entry."""
        entries = []
        with contextlib.suppress(OSError):
            for item in os.scandir(self._folder):
                if item.name.endswith((_ENTRY, _TILES)):
                    with contextlib.suppress(FileNotFoundError):  # another process deleted it
                        status = item.stat()
                        entries.append((status.st_mtime_ns, status.st_size, Path(item.path)))
        return entries

    def _path(self, key: str, suffix: str) -> Path:
        if not _KEY.fullmatch(key):
            raise ValueError(f"key {key!r}, expected 1 to 120 letters, digits, '_' or '-'")
        return self._folder / (key + suffix)

    def _note_failure(self, error: OSError) -> None:
        why = error.strerror or str(error)
        self._notes.append(f"the cache in {self._folder} cannot be written ({why}); results stay in memory only")


def _read_entry(path: Path, key: str) -> dict[str, NDArray[np.generic]]:
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        if not size:
            raise RecordError("empty")
        record = read_record(memoryview(mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ)))
    if (record.label, record.n_bytes) != (key, size):
        raise RecordError(f"{size} bytes of {record.label!r}, expected {record.n_bytes} of {key!r}")
    return record.arrays


def _reserve(file: BinaryIO, size: int) -> None:
    """Have a full disk refuse before anything is written."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)


def _feed(digest: hashlib.blake2b, part: KeyPart | tuple[KeyPart, ...]) -> None:
    """Each part with its type and length, so that no two lists of parts read the same."""
    if isinstance(part, tuple):
        digest.update(f"tuple {len(part)};".encode())
        for inner in part:
            _feed(digest, inner)
        return
    if isinstance(part, np.ndarray):
        kind, data = f"array {part.dtype.str} {part.shape}", np.ascontiguousarray(part).tobytes()
    elif isinstance(part, bytes):
        kind, data = "bytes", part
    elif part is None or isinstance(part, (str, bool, int, float)):
        kind, data = type(part).__name__, (part if isinstance(part, str) else repr(part)).encode()
    else:
        raise TypeError(f"{type(part).__name__} in a cache key, expected text, bytes, numbers, arrays or tuples")
    digest.update(f"{kind} {len(data)};".encode())
    digest.update(data)


def _touch(path: Path) -> None:
    with contextlib.suppress(OSError):
        os.utime(path)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
