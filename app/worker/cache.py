"""The transport cache: arrays on disk under a key, so that a scene opened before opens at once.

A key is a hash of all that the arrays depend on (`content_key`), so an entry is never out of date, only absent. Entries
are written to a temporary name and renamed; they are checked byte by byte before they are handed out, then validated by
the caller, and deleted when anything is wrong with them. The least recently used ones are deleted when the size limit
is exceeded. The cache only ever saves time: a fault of it becomes a warning, shown once, never an error.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
import platformdirs
from numpy.typing import NDArray

from app.system.atomic import make_private_folder, replacing, sweep_temporaries
from app.worker.array_files import RecordError, Tiles, read_record, record_size, write_record
from engine.core.errors import InsituError
from engine.core.stored_arrays import Arrays, UnsoundArrays, Writable

_log = logging.getLogger("insitu.jobs")

CACHE_VARIABLE = "INSITU_CACHE"
DEFAULT_BOUND = 4 << 30
_KEY = re.compile(r"[A-Za-z0-9_-]{1,120}")
_ENTRY = ".arrays"
_TILES = ".tiles"
_NEED_LESS = "fewer --lights or a smaller --resolution need less"
_MEND = f"free some room, or set {CACHE_VARIABLE} to a folder that can be written"

Made = TypeVar("Made")
KeyPart = str | bytes | int | float | bool | None | NDArray[np.generic] | tuple["KeyPart", ...]


def cache_folder() -> Path:
    """`$INSITU_CACHE`, or the platform's folder for caches."""
    configured = os.environ.get(CACHE_VARIABLE)
    if configured:
        return Path(configured)
    return Path(platformdirs.user_cache_dir("insitu", appauthor=False))


def content_key(*parts: KeyPart) -> str:
    """A hash (BLAKE2b, 160 bits) of values and their types: equal keys mean equal parts."""
    digest = hashlib.blake2b(digest_size=20)
    _feed(digest, parts)
    return digest.hexdigest()


class ArrayCache:
    """Arrays by key in one folder, at most `bound` bytes of them.

    Several processes may use one folder at a time: entries appear and disappear whole.
    """

    def __init__(self, folder: Path | None = None, bound: int = DEFAULT_BOUND) -> None:
        self._folder = folder or cache_folder()
        self._bound = bound
        self._notes: list[str] = []
        self._reported: set[str] = set()
        self._failure = ""
        self._accessed_keys: set[Path] = set()
        sweep_temporaries(self._folder)

    def take_notes(self) -> tuple[str, ...]:
        """Warnings about the cache that have not been shown yet."""
        notes = tuple(note for note in dict.fromkeys(self._notes) if note not in self._reported)
        self._notes = []
        self._reported.update(notes)
        return notes

    def require(self) -> None:
        """Raise InsituError where nothing can be stored."""
        probe = self._path("probe", _ENTRY)
        try:
            make_private_folder(self._folder)
            with replacing(probe, durable=False, private=True) as file:
                _reserve(file, 1 << 16)
        except OSError as error:
            raise InsituError(f"the cache in {self._folder} {_cannot_write(error)}; {_MEND}") from error
        _remove(probe)

    def require_stored(self) -> None:
        """Raise InsituError where an entry is missing, or missing again, that this process has stored or looked up."""
        missing = [path for path in self._accessed_keys if not path.exists()]
        if missing:
            lost = f"({len(missing)} of {len(self._accessed_keys)} parts are not stored)"
            why = f"{self._failure} {lost}; {_MEND}" if self._failure else f"{self._too_small()} {lost}; {_NEED_LESS}"
            raise InsituError(f"the cache in {self._folder} {why}")

    def get(self, key: str, read: Callable[[Arrays], Made]) -> Made | None:
        """Read the arrays under the key, and return the result of `read`; None when there are none, or no sound ones.

        They are read-only copies of what was checked: the file may change. `read` raises UnsoundArrays where they are
        not what it needs.
        """
        path = self._path(key, _ENTRY)
        try:
            made = read(_read_entry(path, key))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (RecordError, UnsoundArrays) as error:
            _log.warning("%s: %s", path, error)
            self._notes.append(f"part of the cache in {self._folder} was damaged and is computed again")
            _remove(path)
            return None
        except OSError as error:  # no permission to read it, or a disk error: the entry may be sound
            self._notes.append(f"the cache in {self._folder} cannot be read ({error.strerror}); all is computed again")
            return None
        self._accessed_keys.add(path)
        _touch(path)
        return made

    def put(self, key: str, arrays: Writable) -> bool:
        """Store the arrays, or note why not; returns whether they were stored. An `ArrayInPieces` goes to the disk
        without being whole in memory."""
        size = record_size(arrays, key)
        path = self._path(key, _ENTRY)
        self._accessed_keys.add(path)
        if size > self._bound:
            self._note(self._too_small())
            return False
        try:
            make_private_folder(self._folder)
            with replacing(path, durable=False, private=True) as file:
                _reserve(file, size)
                write_record(file, key, arrays)
        except OSError as error:
            self._note_error(error)
            return False
        self._shrink(keep=path)
        return True

    def open_tiles(self, key: str, n_tiles: int) -> Tiles:
        """The tiles of an unfinished computation, with those that an earlier run completed."""
        path = self._path(key, _TILES)
        with contextlib.suppress(OSError):
            make_private_folder(self._folder)
        self._shrink(keep=path)
        return Tiles(path, key, n_tiles, self._note_error)

    def size(self) -> int:
        """Bytes in the cache now."""
        return sum(n_bytes for _, n_bytes, _ in self._entries())

    def clear(self) -> None:
        """Delete all entries."""
        for _, _, path in self._entries():
            _remove(path)

    def _shrink(self, keep: Path) -> None:
        """Delete the least recently used entries until the limit is met."""
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

    def _too_small(self) -> str:
        return f"may hold {self._bound / 2**20:.0f} MiB, too few for all of this"

    def _note_error(self, error: OSError) -> None:
        self._failure = _cannot_write(error)
        self._note(self._failure)

    def _note(self, why: str) -> None:
        self._notes.append(f"the cache in {self._folder} {why}; results stay in memory only")


def _read_entry(path: Path, key: str) -> dict[str, NDArray[np.generic]]:
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        if not size:
            raise RecordError("empty")
        content = file.read()  # what is checked is what is used, even if the file changes
    record = read_record(memoryview(content))
    if (record.label, record.n_bytes) != (key, size):
        raise RecordError(f"{size} bytes of {record.label!r}, expected {record.n_bytes} of {key!r}")
    return record.arrays


def _reserve(file: BinaryIO, size: int) -> None:
    """Make a full disk refuse before anything is written."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)


def _cannot_write(error: OSError) -> str:
    return f"cannot be written ({error.strerror or error})"


def _feed(digest: hashlib.blake2b, part: KeyPart | tuple[KeyPart, ...]) -> None:
    """Hash each part with its type and length, so that no two lists of parts have the same bytes."""
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
