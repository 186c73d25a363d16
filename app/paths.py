"""Where Insitu keeps what outlives a run: the autosave journals, a person's own materials and the interface's layout.

The folder comes from the environment variable ``INSITU_STATE`` where it is set (tests, kiosks), else from the
platform's own convention (``platformdirs``). The transport cache has its own folder, see ``app.jobs.cache``:
deleting a cache must never cost a person unsaved work.
"""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

APPLICATION = "insitu"
STATE_VARIABLE = "INSITU_STATE"


def state_directory() -> Path:
    """The folder for journals and layout; created (private to the user) when it is not there."""
    configured = os.environ.get(STATE_VARIABLE)
    folder = Path(configured) if configured else Path(platformdirs.user_state_dir(APPLICATION, appauthor=False))
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return folder


def journal_directory() -> Path:
    """The folder of the autosave journals, one file for each running editor."""
    folder = state_directory() / "journals"
    folder.mkdir(exist_ok=True, mode=0o700)
    return folder


def material_directory() -> Path:
    """The folder of a person's own materials."""
    folder = state_directory() / "materials"
    folder.mkdir(exist_ok=True, mode=0o700)
    return folder


def layout_file() -> Path:
    """The file in which the window remembers its panels."""
    return state_directory() / "layout.ini"


def is_file_name(source: str) -> bool:
    """Whether a scene or an environment is a file: names of built-in ones have no ending."""
    return Path(source).suffix != ""


def full_path(source: str, folder: Path | None = None) -> str:
    """A file's absolute path, from ``folder`` or where we are; the name of a built-in one as it is."""
    return str(((folder or Path()) / source).resolve()) if is_file_name(source) else source


def written_path(source: str, folder: Path | None) -> str:
    """A file's name as it is written to a file in ``folder``: relative to it where it is inside, else absolute."""
    if not is_file_name(source):
        return source
    path = Path(source).resolve()
    inside = folder is not None and path.is_relative_to(folder)
    return str(path.relative_to(folder)) if inside and folder is not None else str(path)
