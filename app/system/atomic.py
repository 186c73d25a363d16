"""Files and folders that are either old or new, never half.

The bytes go to a temporary name in the same folder, are flushed to the disk, and the name is then replaced in one step
[POSIX, rename]. A process killed at any moment leaves the old file or the new one, and at most a stray temporary file,
which the next write to the same name removes. Writing in place, even with a backup beside it, was rejected: a kill
between truncation and the last write loses both the old text and the new.

Files that the user asked for are written by `save_file` and `replacing_folder`, whose error names the path; neither
replaces anything but a regular file, nor one that the open project was read from. `require_place` checks that before
the work rather than after it. Files that the program stores for itself (`private`) can be read by the user alone.

Code that opens a project sets the files that it was read from (`set_inputs`), code that reads more into it adds to them
(`add_inputs`). Files are compared by identity and not by their names: a link, or another spelling on a disk that
ignores case, is the same file.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import itertools
import os
import re
import shutil
import stat
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from app.system.system import process_lives
from engine.core.errors import InsituError
from engine.core.safe_files import file_kind

_inputs: set[Path] = set()


def set_inputs(paths: Iterable[Path]) -> None:
    """Set the files that the newly opened project was read from."""
    _inputs.clear()
    add_inputs(paths)


def add_inputs(paths: Iterable[Path]) -> None:
    """Add files that the project has read; those of an undone edit may be needed again."""
    _inputs.update(Path(os.path.abspath(path)) for path in paths)


def require_no_input(path: str | os.PathLike[str], session: Path | None = None) -> None:
    """Raise InsituError where an output at `path` would replace a file that the project was read from.

    session: that of the project, which may be saved where it was read from.
    """
    spared = None if session is None else Path(os.path.abspath(session))
    place = _identity(path)
    for known in _inputs - {spared} if place is not None else ():
        if _identity(known) == place:
            same = "" if os.path.abspath(path) == str(known) else f" ({known})"
            raise InsituError(f"{os.fspath(path)}: the project reads this file{same}; expected another name")


def _identity(path: str | os.PathLike[str]) -> tuple[int, int] | None:
    """The identity of the file behind a name, its links followed; None where there is none, which cannot be lost."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


PRIVATE_FILE, PRIVATE_FOLDER = 0o600, 0o700
_LONGEST_STEM = 100  # bytes of a name that its temporary one repeats: no system takes more than 255 in all
_TRIED_BYTES = 1 << 16
_TEMPORARY = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)-\d+\.tmp")
_serial = itertools.count()


def save_file(path: str | os.PathLike[str], data: bytes, *, private: bool = False, session: Path | None = None) -> None:
    """Replace the file at `path` by `data`; InsituError says why it cannot be, and the old file is then untouched.

    session: see `require_no_input`.
    """
    with saving_file(path, private=private, session=session) as file:
        file.write(data)


@contextlib.contextmanager
def saving_file(
    path: str | os.PathLike[str], *, private: bool = False, session: Path | None = None
) -> Iterator[BinaryIO]:
    """The same with a binary file to write in the block."""
    with _explaining(path):
        require_no_input(path, session)
        with replacing(path, private=private) as file:
            yield file


def require_place(*paths: Path) -> None:
    """Raise InsituError where files could not be written to these paths, or would replace what has to stay.

    A name in each of their folders is tried, so that a disk that is read-only, is full, or refuses such a name, is
    found before the work.
    """
    tried = {path.parent: path for path in sorted(paths, key=lambda path: len(os.fspath(path)))}
    for path in paths:
        with _explaining(path):
            _require_file(path)
            require_no_input(path)
    for path in tried.values():
        with _explaining(path):
            _try_writing(Path(os.path.realpath(path)))


def require_folder(folder: Path, names: Iterable[str] = ()) -> None:
    """The same for files of these names in a folder, whether it exists or not: it is not made."""
    with _explaining(folder):
        _require_folder(folder)
        made = Path(os.path.realpath(folder)) / "a"  # the first name that will be new
        while not made.parent.exists():
            made = made.parent
        _try_writing(made)
    for path in (folder / name for name in names):
        require_no_input(path)


def make_folder_of(path: Path) -> None:
    """Make the folder of a file; InsituError says why that is impossible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise InsituError(f"{path.parent}: the folder cannot be made, {_reason(error)}") from error


@contextlib.contextmanager
def replacing_folder(folder: Path) -> Iterator[Path]:
    """An empty folder to fill; leaving the block without an error moves its content to `folder`.

    In a folder that exists, files of the same names are replaced when all are written, and all others stay. Raises
    InsituError that says why it cannot be written; what was there is then untouched.
    """
    with _explaining(folder):
        target = Path(os.path.realpath(folder))
        _require_folder(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        # Beside an existing folder could be another disk, or no permission to write.
        temporary = _temporary(target / target.name if target.is_dir() else target)
        temporary.mkdir()
        try:
            yield temporary
            _put_in_place(temporary, target)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def write_atomically(path: str | os.PathLike[str], data: bytes, *, private: bool = False) -> None:
    """Replace the file at `path` by `data`; on any error the old file is untouched and the OSError is raised.

    A symbolic link is followed, so that it stays a link; the permissions of an existing file are preserved, unless it
    is `private`.
    """
    with replacing(path, private=private) as file:
        file.write(data)


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str], *, durable: bool = True, private: bool = False) -> Iterator[BinaryIO]:
    """A binary file to write; leaving the block without an error moves it to `path`.

    `durable` waits until the bytes are on the disk, so that not even a power cut can leave half a file. Without it only
    the death of the process is covered: enough for files that have a checksum and can be computed again.
    """
    _require_file(path)
    target = Path(os.path.realpath(path))
    temporary = _temporary(target)
    try:
        with open(temporary, "xb", opener=private_opener if private else None) as file:
            yield file
            file.flush()
            if not private:
                _keep_permissions(target, temporary)
            if durable:
                os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    if durable:
        _flush_folder(target.parent)


def private_opener(path: str, flags: int) -> int:
    """An opener for `open`: a new file is the user's alone."""
    return os.open(path, flags, PRIVATE_FILE)


def make_private_folder(folder: Path) -> Path:
    """The folder, made where it does not exist, then the user's alone."""
    folder.mkdir(parents=True, exist_ok=True, mode=PRIVATE_FOLDER)
    return folder


def sweep_temporaries(folder: Path, name: str | None = None) -> None:
    """Remove temporary files and folders (of the file `name`, or all) whose writer no longer runs."""
    name = None if name is None else _stem(name)
    try:
        entries = os.listdir(folder)
    except OSError:
        return
    for entry in entries:
        match = _TEMPORARY.fullmatch(entry)
        if match and name in (None, match["name"]) and not process_lives(int(match["pid"])):
            try:
                (folder / entry).unlink()
            except OSError:
                shutil.rmtree(folder / entry, ignore_errors=True)


@contextlib.contextmanager
def _explaining(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raises the system's refusal of a file or folder that the user named as InsituError with one line."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise InsituError(f"{os.fspath(path)}: not written, {_reason(error)}; what was there is untouched") from error


def _reason(error: OSError | ValueError) -> str:
    """The system's reason for refusing a path, in words."""
    if isinstance(error, UnicodeError):
        return f"its name has characters that this system's ({sys.getfilesystemencoding()}) lack"
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def _require_file(path: str | os.PathLike[str]) -> None:
    """Raise OSError where something is at `path`, or where its links lead, that is no regular file.

    Replacing a device, or a link that leads to itself, is never intended.
    """
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, f"it is {file_kind(mode)}, expected a file or a new name")


def _try_writing(target: Path) -> None:
    """Raise OSError where the system takes no file of a few bytes beside the target, under a name as long."""
    temporary = _temporary(target)
    try:
        with open(temporary, "xb") as file:
            file.write(bytes(_TRIED_BYTES))
    finally:
        temporary.unlink(missing_ok=True)


def _require_folder(folder: Path) -> None:
    """Raise OSError where something is at a path that is no folder."""
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISDIR(os.stat(folder).st_mode):
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))


def _temporary(target: Path) -> Path:
    """An unused name beside the target; those of writers that were killed are removed."""
    sweep_temporaries(target.parent, target.name)
    return target.with_name(f".{_stem(target.name)}.{os.getpid()}-{next(_serial)}.tmp")


def _stem(name: str) -> str:
    """The part of a file's name that temporary names repeat: of a long one a digest, because theirs may be no
    longer."""
    encoded = os.fsencode(name)
    return name if len(encoded) <= _LONGEST_STEM else hashlib.blake2b(encoded, digest_size=12).hexdigest()


def _put_in_place(temporary: Path, target: Path) -> None:
    """Rename what was written: the whole folder where there is none yet, else file by file."""
    if not target.is_dir():
        os.rename(temporary, target)
        _flush_folder(target.parent)
        return
    files = [file.relative_to(temporary) for file in temporary.rglob("*") if file.is_file()]
    for place in (target / file for file in files):  # before anything is replaced
        if place.is_dir() or (place.parent.exists() and not place.parent.is_dir()):
            raise FileExistsError(errno.EEXIST, f"something else is at {place}")
        if place.exists():
            _require_file(place)
        require_no_input(place)
    for file in files:
        (target / file).parent.mkdir(parents=True, exist_ok=True)
    for file in files:
        os.replace(temporary / file, target / file)
    _flush_folder(target)


def _keep_permissions(target: Path, temporary: Path) -> None:
    with contextlib.suppress(OSError):
        os.chmod(temporary, target.stat().st_mode & 0o7777)


def _flush_folder(folder: Path) -> None:
    """Flush the new name itself to the disk; some file systems refuse this for folders, and then it is not needed."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
