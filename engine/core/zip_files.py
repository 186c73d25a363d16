"""Zip archives of untrusted origin: few files, of bounded size, with names inside the archive.

Everything is checked before anything is unpacked: the size of the directory, the number of files, the bytes that they
claim (more are never read), their names, and that none is a link or encrypted.
"""

from __future__ import annotations

import stat
import zipfile
import zlib
from io import BytesIO
from pathlib import Path

from engine.core.errors import LoadError, describe_value

MOST_FILES = 4096
_MOST_DIRECTORY_BYTES = 8 * 2**20
# Bytes of all files together; more for every byte of the archive, because a small one must not cost much. Meshes in
# text shrink to a fifth or an eighth.
_LEAST_UNPACKED, _UNPACKED_A_BYTE, MOST_UNPACKED = 16 * 2**20, 20, 4 * 2**30
_LONGEST_NAME = 255
_END, _END_SIZE, _END_64 = b"PK\5\6", 22, b"PK\6\7"


class ZipArchive:
    """The regular files of an archive, by name with `/` as the separator."""

    def __init__(self, data: bytes, file: Path) -> None:
        """data: the archive `file`. Raises LoadError."""
        self._file = file
        _check_directory(data, file)
        try:
            self._zip = zipfile.ZipFile(BytesIO(data))
            entries = self._zip.infolist()
        except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError) as error:
            raise LoadError(file, "zip archive", str(error), "a whole zip archive, not cut off or damaged") from None
        if len(entries) > MOST_FILES:
            raise LoadError(file, "files in the archive", len(entries), f"at most {MOST_FILES}")
        total, most = sum(entry.file_size for entry in entries), _most_unpacked(len(data))
        if total > most:
            raise LoadError(file, "size once unpacked", f"{total} bytes", f"at most {most} for an archive of this size")
        self._entries = {_checked_name(entry, file): entry for entry in entries if entry.filename[-1:] != "/"}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its files."""
        return tuple(self._entries)

    def read(self, name: str) -> bytes:
        """The content of a file. Raises LoadError."""
        try:
            return self._zip.read(self._entries[name])
        except (
            zipfile.BadZipFile,
            zlib.error,
            NotImplementedError,
            RuntimeError,
            EOFError,
            OSError,
            ValueError,
        ) as error:
            raise LoadError(self._file, describe_value(name), str(error), "a whole file, not damaged") from None


def _most_unpacked(n_bytes: int) -> int:
    return min(MOST_UNPACKED, _LEAST_UNPACKED + _UNPACKED_A_BYTE * n_bytes)


def _check_directory(data: bytes, file: Path) -> None:
    """Refuse a directory that would take long to read: its size stands at the end of the archive."""
    end = len(data) - _END_SIZE
    if data[max(end, 0) :][:4] != _END:
        end = data.rfind(_END, max(0, len(data) - _END_SIZE - 0xFFFF))
    if end < 0 or len(data) < end + _END_SIZE:
        raise LoadError(file, "zip archive", "no directory at its end", "a whole zip archive, not cut off or damaged")
    size = int.from_bytes(data[end + 12 : end + 16], "little")
    if data[max(end - 20, 0) : end][:4] == _END_64 or size > _MOST_DIRECTORY_BYTES:
        raise LoadError(file, "zip archive", "of the form for huge archives", f"at most {MOST_FILES} files")


def _checked_name(entry: zipfile.ZipInfo, file: Path) -> str:
    """The name of a file in the archive; raises LoadError for one that leads elsewhere, a link and an encrypted one."""
    name = entry.filename.replace("\\", "/")
    parts = name.split("/")
    is_inside = name != "" and not name.startswith("/") and ".." not in parts and ":" not in name and name.isprintable()
    if not is_inside or max(map(len, parts)) > _LONGEST_NAME:
        raise LoadError(file, "name in the archive", entry.filename, "a name inside the archive")
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise LoadError(file, describe_value(name), "a symbolic link", "a regular file")
    if entry.flag_bits & 1:
        raise LoadError(file, describe_value(name), "encrypted", "a file without a password")
    return "/".join(part for part in parts if part not in ("", "."))
