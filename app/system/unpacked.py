"""Where zip archives are unpacked, and how a file of one is named elsewhere: `cup.insitu.zip!/scene/sky.exr`.

An archive has a folder of its own in the cache, named after its path, size and time. What refers to a file in there,
such as a session that is saved later, names the archive, because the cache may be emptied at any time.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path

from engine.core.safe_files import local_path

ARCHIVE_ENDING = ".zip"
_MARK = "!/"
_ARCHIVE_NOTE = ".archive"  # in an archive's folder: its path


def unpacked_folder() -> Path:
    """The folder that has one for each archive."""
    from app.worker.cache import cache_folder

    return cache_folder() / "unpacked"


def folder_of_archive(archive: Path) -> Path:
    """The folder of an archive, unpacked or not. Raises OSError where there is no archive."""
    status = local_path(archive).stat()
    named = repr((os.path.abspath(archive), status.st_size, status.st_mtime_ns))
    return unpacked_folder() / hashlib.blake2b(os.fsencode(named), digest_size=16).hexdigest()


def note_archive(folder: Path, archive: Path) -> None:
    """Note in the folder that is being filled which archive it is of."""
    (folder / _ARCHIVE_NOTE).write_bytes(os.fsencode(os.path.abspath(archive)))


def name_in_archive(path: Path) -> tuple[Path, str] | None:
    """The archive that a file was unpacked from, and its name in there; None for another file."""
    parent = Path(os.path.realpath(unpacked_folder()))
    if not path.is_relative_to(parent) or len(parts := path.relative_to(parent).parts) < 2:
        return None
    with contextlib.suppress(OSError):
        return Path(os.fsdecode((parent / parts[0] / _ARCHIVE_NOTE).read_bytes())), "/".join(parts[1:])
    return None


def joined(archive: str, inside: str) -> str:
    """The name of a file in an archive."""
    return f"{archive}{_MARK}{inside}"


def split_member(name: str) -> tuple[str, str] | None:
    """The archive and the file in it that a name is of; None for that of any other file."""
    archive, mark, inside = name.partition(_MARK)
    return (archive, inside) if mark and archive.lower().endswith(ARCHIVE_ENDING) else None


def unpacked_member(archive: Path, inside: str) -> Path:
    """The path of a file of an archive where that is unpacked; a path that does not exist where there is none."""
    try:
        return folder_of_archive(archive) / inside
    except OSError:
        return archive / inside
