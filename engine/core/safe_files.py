"""Reads files of untrusted origin: regular files only, limited in size, never outside the scene's folder.

A FIFO or a device would block or flood a loader; a path such as `../../etc/passwd` or a symbolic link would read files
that do not belong to the scene. Opening without blocking and checking the open file instead of its name leaves no gap
between check and use.

Every file of a scene is opened at its `local_path`. The files of a scene can therefore be recorded while it is read,
and a machine without these files can read them by the same names from its cache of received files.
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
from threading import Lock

from engine.core.errors import LoadError

_SCHEME = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]*:")
_PROGRAM = Path(__file__).resolve().parents[2]
_OWN = "insitu:"


@dataclass
class _FileAccess:
    """recorded: the sets that record opened files; places: the actual location of each file by its name; temporary:
    files of our own, which belong to no scene."""

    recorded: tuple[set[Path], ...] = ()
    places: Mapping[str, Path] | None = None
    temporary: frozenset[Path] = frozenset()


_access = _FileAccess()
_changing_temporary = Lock()  # several threads read files, each of them archives of its own


def local_path(path: str | os.PathLike[str]) -> Path:
    """The location of a file's bytes. Raises FileNotFoundError for a file that was not sent, where files come from
    another machine: a local file of the same name would be a different one."""
    if Path(path) in _access.temporary:
        return Path(path)
    for noted in _access.recorded:
        noted.add(Path(path))
    if _access.places is None:
        return Path(path)
    place = _access.places.get(portable_name(path))
    if place is None:
        raise FileNotFoundError(errno.ENOENT, "not among the files that were sent", os.fspath(path))
    return place


@contextlib.contextmanager
def temporary_file(path: Path) -> Iterator[None]:
    """Opens a file of our own within the block by its path alone, whatever is recorded or redirected."""
    with _changing_temporary:
        _access.temporary |= {path}
    try:
        yield
    finally:
        with _changing_temporary:
            _access.temporary -= {path}


def exists(path: str | os.PathLike[str]) -> bool:
    """Whether a file or a folder of that name exists."""
    if _access.places is None or Path(path) in _access.temporary:
        return os.path.exists(path)
    return portable_name(path) in _access.places


def add_unpacked(folder: Path) -> None:
    """Where files come from another machine: read those of a folder that was unpacked from one of them here."""
    if _access.places is not None:
        unpacked = {path for path in folder.rglob("*") if path.is_file()}
        with _changing_temporary:
            _access.temporary |= unpacked


def portable_name(path: str | os.PathLike[str]) -> str:
    """The name of a file on every machine: its absolute path, or for a file of the program its place in the program."""
    real = Path(os.path.realpath(path))
    return _OWN + real.relative_to(_PROGRAM).as_posix() if real.is_relative_to(_PROGRAM) else os.path.abspath(path)


@contextlib.contextmanager
def record_files() -> Iterator[set[Path]]:
    """Records every file opened within the block, in the whole process; blocks can be nested."""
    before, noted = _access.recorded, set[Path]()
    _access.recorded = (*before, noted)
    try:
        yield noted
    finally:
        _access.recorded = before


@contextlib.contextmanager
def redirect_files(places: Mapping[str, Path]) -> Iterator[None]:
    """Reads files from these places within the block, by `portable_name`; no other files exist. Applies to the whole
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
            data = file.read(status.st_size + 1)  # reads no more than the stated size before it is known to be needed
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
    """The absolute path, with symbolic links resolved, of a file that need not exist. Raises LoadError for an invalid
    name and for circular links."""
    try:
        return path.resolve()
    except RuntimeError:
        raise LoadError(path, "file", "symbolic links in a circle", "a readable file") from None
    except (OSError, ValueError) as error:
        raise LoadError(path, "name", str(error), "the name of a file") from None


def named_in(folder: Path, name: str) -> Path:
    """The path of what a file in `folder` calls `name`. Windows has a backslash between folders; elsewhere it
    may be part of a name, and is where a file has that name."""
    path = folder / name
    return folder / name.replace("\\", "/") if "\\" in name and not exists(path) else path


def resolve_inside(folder: Path, name: str, file: Path, what: str) -> Path:
    """The path of `name` in `folder`, with symbolic links resolved; raises LoadError naming `file` and `what` if it is
    outside."""
    expected = "a relative path to a file inside the scene's folder"
    try:
        root = folder.resolve()
        path = named_in(root, name)
        if not name or Path(name).is_absolute() or _SCHEME.match(name) and not exists(path):
            raise LoadError(file, what, name, expected)
        path = path.resolve()
    except (OSError, ValueError, RuntimeError):
        raise LoadError(file, what, name, expected) from None
    if not path.is_relative_to(root):
        raise LoadError(file, what, f"{name} (outside the scene folder)", expected)
    return path


def find_inside(root: Path, folder: Path, name: str) -> Path | None:
    """The file that another file in `folder` names, where it is inside `root`, else None.

    The name may have another system's separators or capitals; of a path that leads elsewhere, as those of the machine
    where a file was made, the last part is tried in `folder`.
    """
    for each in (name, name.replace("\\", "/").rpartition("/")[2]):
        with contextlib.suppress(LoadError, ValueError, OSError):
            inside = (resolved(folder).relative_to(resolved(root)) / each).as_posix()
            path = resolve_inside(root, inside, root, "name")
            if exists(path):
                return path
            other = resolve_inside(root, _existing_spelling(resolved(root), path), root, "name")
            if exists(other):
                return other
    return None


def _existing_spelling(root: Path, path: Path) -> str:
    """A path inside `root` in the spelling of what exists, relative to it; unchanged where nothing differs in capitals
    alone."""
    if _access.places is not None:
        wanted = portable_name(path).casefold()
        path = next((Path(name) for name in _access.places if name.casefold() == wanted), path)
        return path.relative_to(root).as_posix()
    found = root
    for part in path.relative_to(root).parts:
        names = [part] if os.path.exists(found / part) else os.listdir(found)
        found = found / next((name for name in names if name.casefold() == part.casefold()), part)
    return found.relative_to(root).as_posix()


def file_kind(mode: int) -> str:
    """The kind of a file with this mode that is not a regular file."""
    names = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a named pipe", stat.S_IFSOCK: "a socket",
             stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}  # fmt: skip
    return names.get(stat.S_IFMT(mode), "not a file")
