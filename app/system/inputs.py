"""The files that the project which is open in this process was read from: no output takes the place of one of them.

Whoever opens a project says what it has read (`set_inputs`), whoever brings more into it says that as well
(`add_inputs`); all that is written for a person asks here before (`app.system.atomic`). Files are told apart by what
they are and not by their names: a link, or another spelling on a disk that does not mind capitals, is the same file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from engine.core.errors import InsituError

_inputs: set[Path] = set()


def set_inputs(paths: Iterable[Path]) -> None:
    """Another project is open, which was read from these files."""
    _inputs.clear()
    add_inputs(paths)


def add_inputs(paths: Iterable[Path]) -> None:
    """The project has read these files as well; also what an undone edit has read may be wanted again."""
    _inputs.update(Path(os.path.abspath(path)) for path in paths)


def require_no_input(path: str | os.PathLike[str], session: Path | None = None) -> None:
    """Raises InsituError where an output at `path` would take the place of what the project was read from.

    session: that of the project, which may be saved where it was read from.
    """
    spared = None if session is None else Path(os.path.abspath(session))
    place = _identity(path)
    for known in _inputs - {spared} if place is not None else ():
        if _identity(known) == place:
            same = "" if os.path.abspath(path) == str(known) else f" ({known})"
            raise InsituError(f"{os.fspath(path)}: the project reads this file{same}; expected another name")


def _identity(path: str | os.PathLike[str]) -> tuple[int, int] | None:
    """The file behind a name, its links followed; None where there is none, which cannot be lost."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino
