"""Reading files somebody else made: regular files only, bounded in size, never outside the scene's folder.

A FIFO or a device would block or flood a loader, a path such as `../../etc/passwd` or a symbolic link would read what
the scene has no business with. Opening without blocking and asking the open file (not its name) what it is leaves no
gap between the check and the use.

Every file that a scene is made of is opened where `local_path` says. So the files of a scene can be noted while it is
read, and a machine that does not have them can read the same names from where it keeps what it was sent.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from engine.core.errors import LoadError

_SCHEME = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]*:")
_PROGRAM = Path(__file__).resolve().parents[2]
_OWN = "insitu:"


@dataclass
class _FileAccess:
    """noted: what has been opened, for each who notes it; places: where files are instead, by their name."""

    recorded: tuple[set[Path], ...] = ()
    places: Mapping[str, Path] | None = None


_access = _FileAccess()


def local_path(path: str | os.PathLike[str]) -> Path:
    """Where the bytes of a file are. Raises FileNotFoundError for one that was not sent, where files come from
    elsewhere: what happens to be there under its name is another one."""
    for noted in _access.recorded:
        noted.add(Path(path))
    if _access.places is None:
        return Path(path)
    place = _access.places.get(portable_name(path))
    if place is None:
        raise FileNotFoundError(errno.ENOENT, "not among the files that were sent", os.fspath(path))
    return place


def exists(path: str | os.PathLike[str]) -> bool:
    """Whether there is a file, or a folder, of that name."""
    return os.path.exists(path) if _access.places is None else portable_name(path) in _access.places


def portable_name(path: str | os.PathLike[str]) -> str:
    """What a file is called on every machine: the full path, and of the program's own its place in the program."""
    real = Path(os.path.realpath(path))
    return _OWN + real.relative_to(_PROGRAM).as_posix() if real.is_relative_to(_PROGRAM) else os.path.abspath(path)


@contextlib.contextmanager
def record_files() -> Iterator[set[Path]]:
    """Within the block every file that is opened is noted, in the whole process; blocks may stand in one another."""
    before, noted = _access.recorded, set[Path]()
    _access.recorded = (*before, noted)
    try:
        yield noted
    finally:
        _access.recorded = before


@contextlib.contextmanager
def redirect_files(places: Mapping[str, Path]) -> Iterator[None]:
    """Within the block files are read from these places, by `portable_name`, and there are no others; in the whole
    process."""
    _access.places = places
    try:
        yield
    finally:
        _access.places = None


def read_regular_file(path: Path, max_bytes: int) -> bytes:
    """All bytes of a regular file of at most `max_bytes`; raises LoadError for anything else."""
    try:
        descriptor = os.open(local_path(path), os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise LoadError(path, "file", reason, "a readable file") from None
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise LoadError(path, "file", file_kind(status.st_mode), "a regular file")
        if status.st_size > max_bytes:
            raise LoadError(path, "size", f"{status.st_size} bytes", f"at most {max_bytes} bytes")
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            data = file.read(status.st_size + 1)  # more is set aside before it is known to be needed
            if len(data) > status.st_size:
                data += file.read(max_bytes + 1 - len(data))
    except OSError as error:
        raise LoadError(path, "file", error.strerror or str(error), "a readable file") from None
    finally:
        os.close(descriptor)
    if len(data) > max_bytes:
        raise LoadError(path, "size", f"more than {max_bytes} bytes", f"at most {max_bytes} bytes")
    return data


def resolved(path: Path) -> Path:
    """The full path, symbolic links followed, of a file that need not be there. Raises LoadError for what no file can
    be called, and for links that lead in a circle."""
    try:
        return path.resolve()
    except RuntimeError:
        raise LoadError(path, "file", "symbolic links in a circle", "a readable file") from None
    except (OSError, ValueError) as error:
        raise LoadError(path, "name", str(error), "the name of a file") from None


def resolve_inside(folder: Path, name: str, file: Path, what: str) -> Path:
    """The path of `name` in `folder`, symbolic links followed; LoadError naming `file` and `what` if outside."""
    expected = "a relative path to a file inside the scene's folder"
    if not name or _SCHEME.match(name) or Path(name).is_absolute() or "\\" in name:
        raise LoadError(file, what, name, expected)
    try:
        root = folder.resolve()
        path = (root / name).resolve()
    except (OSError, ValueError, RuntimeError):
        raise LoadError(file, what, name, expected) from None
    if not path.is_relative_to(root):
        raise LoadError(file, what, f"{name} (outside the scene folder)", expected)
    return path


def file_kind(mode: int) -> str:
    """What a file of this mode is that is not a regular one."""
    names = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a named pipe", stat.S_IFSOCK: "a socket",
             stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}  # fmt: skip
    return names.get(stat.S_IFMT(mode), "not a file")
