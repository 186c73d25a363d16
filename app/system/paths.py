"""The folders of what outlives a run: the autosave journals, the user's own materials and the window's layout.

The folder comes from the environment variable ``INSITU_STATE`` where it is set (tests, kiosks), else from the
platform's own convention (``platformdirs``). The transport cache has its own folder, see ``app.worker.cache``: deleting
a cache must never cost the user unsaved work.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote_from_bytes, unquote_to_bytes

import platformdirs

from app.system.atomic import make_private_folder, private_opener
from app.system.unpacked import joined, name_in_archive, split_member, unpacked_member
from engine.core.safe_files import resolved

APPLICATION = "insitu"
STATE_VARIABLE = "INSITU_STATE"
_QUOTED = "file:"
_LARGEST_LOG = 1 << 20


def state_directory() -> Path:
    """The folder for journals and layout, made (private to the user) when it does not exist.

    Where it cannot be made its name is returned all the same: readers find nothing there, writers report why not.
    """
    configured = os.environ.get(STATE_VARIABLE)
    return _make_folder(
        Path(configured) if configured else Path(platformdirs.user_state_dir(APPLICATION, appauthor=False))
    )


def state_problem() -> str:
    """One line for the user where nothing can be stored, else ""."""
    folder = state_directory()
    if folder.is_dir() and os.access(folder, os.W_OK):
        return ""
    return f"{folder}: cannot be written, nothing is stored there; set {STATE_VARIABLE} to a folder that can be"


def journal_directory() -> Path:
    """The folder of the autosave journals, one file for each running editor."""
    return _make_folder(state_directory() / "journals")


def material_directory() -> Path:
    """The folder of the user's own materials."""
    return _make_folder(state_directory() / "materials")


def log_directory() -> Path:
    """The folder of the logs."""
    return _make_folder(state_directory() / "log")


def open_log(name: str) -> BinaryIO:
    """A log to append to, unbuffered and the user's alone; begun anew once it has 1 MiB. Raises OSError."""
    path = log_directory() / name
    is_long = path.exists() and path.stat().st_size > _LARGEST_LOG
    return open(path, "wb" if is_long else "ab", buffering=0, opener=private_opener)


def _make_folder(folder: Path) -> Path:
    with contextlib.suppress(OSError):
        make_private_folder(folder)
    return folder


def layout_file() -> Path:
    """The file in which the window stores its layout."""
    return state_directory() / "layout.ini"


def recent_file() -> Path:
    """The file that lists what was opened last."""
    return state_directory() / "recent.txt"


def preference_file() -> Path:
    """The file with the user's preferences."""
    return state_directory() / "preferences.toml"


def display_name(source: str) -> str:
    """The name of a scene or a session for the user: its file's name without the suffix, or both of a scene that was
    saved as one file; of a scene.toml its folder's."""
    path = Path(source)
    return path.parent.name if path.name == "scene.toml" else path.stem.removesuffix(".insitu")


def is_file_name(source: str) -> bool:
    """Whether a scene or an environment is a file: names of built-in ones have no suffix."""
    return Path(source).suffix != ""


def full_path(source: str, folder: Path | None = None) -> str:
    """A file's absolute path, from ``folder`` or the current one; the name of a built-in one as it is. Names may be
    written as by `written_path`."""
    if source.startswith(_QUOTED):
        source = os.fsdecode(unquote_to_bytes(source.removeprefix(_QUOTED)))
    if (member := split_member(source)) is not None:
        archive, inside = member
        return str(unpacked_member(Path(full_path(archive, folder)), inside))
    return str(resolved((folder or Path()) / source)) if is_file_name(source) else source


def written_path(source: str, folder: Path | None) -> str:
    """A file's name as it is written to a file in ``folder``: relative to it where it is inside, else absolute.

    A file that was unpacked from an archive is named by that (`app.system.unpacked`). A file's name may be bytes that
    are no text. Such a name is written as a URI [RFC 8089]: "file:caf%E9.toml".
    """
    if not is_file_name(source):
        return source
    path = resolved(Path(source))
    inside = folder is not None and path.is_relative_to(folder)
    name = path.relative_to(folder).as_posix() if inside and folder is not None else str(path)
    if not inside and (member := name_in_archive(path)) is not None:
        archive, name = member
        return joined(written_path(str(archive), folder), name)
    is_text = not any("\ud800" <= character <= "\udfff" for character in name)
    return name if is_text and not name.startswith(_QUOTED) else _QUOTED + quote_from_bytes(os.fsencode(name))
