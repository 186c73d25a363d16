"""Files that are either old or new, never half.

The bytes go to a temporary name in the same folder, are flushed to the disk, and the name is then replaced in one
step [POSIX, rename]. A process killed at any moment leaves the old file or the new one, and at most a stray temporary
file, which the next write to the same name removes. Writing in place, even with a backup beside it, was rejected: a
kill between truncation and the last write loses both the old text and the new.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_TEMPORARY = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)-\d+\.tmp")
_serial = itertools.count()


def write_atomically(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace the file at `path` by `data`; on any error the old file is untouched and the OSError is raised.

    A symbolic link is followed, so that it stays a link; the permissions of an existing file are kept.
    """
    with replacing(path) as file:
        file.write(data)


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = True) -> Iterator[BinaryIO]:
    """A binary file to write; leaving the block without an error puts it in the place of `path`.

    `durable` waits until the bytes are on the disk, so that not even a power cut can leave half a file. Without it
    only the death of the process is covered: enough for files that carry a checksum and can be computed again.
    """
    target = Path(os.path.realpath(path))
    sweep_temporaries(target.parent, target.name)
    temporary = target.with_name(f".{target.name}.{os.getpid()}-{next(_serial)}.tmp")
    try:
        with open(temporary, "xb") as file:
            yield file
            file.flush()
            _keep_permissions(target, file.fileno())
            if durable:
                os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    if durable:
        _flush_folder(target.parent)


def sweep_temporaries(folder: Path, name: str | None = None) -> None:
    """Remove temporary files (of `name`, or all) whose writer no longer lives."""
    try:
        entries = os.listdir(folder)
    except OSError:
        return
    for entry in entries:
        match = _TEMPORARY.fullmatch(entry)
        if match and name in (None, match["name"]) and not process_lives(int(match["pid"])):
            with contextlib.suppress(OSError):
                (folder / entry).unlink()


def process_lives(pid: int) -> bool:
    """Whether a process of this number exists, ours or another user's.

    One that has ended and waits only to be collected, a zombie, lives no more: in a container whose first process
    collects none they stay for good, and with them would all that is kept for the living.
    """
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    try:
        state = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
    except OSError:  # no such folder on this system, or the process has just ended
        return not Path("/proc/self/stat").exists()
    return state[0] not in "ZX"


def _keep_permissions(target: Path, descriptor: int) -> None:
    with contextlib.suppress(OSError):
        os.fchmod(descriptor, target.stat().st_mode & 0o7777)


def _flush_folder(folder: Path) -> None:
    """Put the new name itself on the disk; some file systems refuse this for folders, and then it is not needed."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
