"""The files that the project which is open in this process was read from: no output may replace one of them.

Code that opens a project sets them (`set_inputs`), code that reads more into it adds to them (`add_inputs`); all files
written for the user are checked against them (`app.system.atomic`). Files are compared by identity and not by their
names: a link, or another spelling on a disk that ignores case, is the same file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from engine.core.errors import InsituError

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
