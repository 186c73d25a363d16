"""Bookmarks: views stored by name, a part of the view's state, saved with a session.

Lists of them are values: each function returns another one. A thumbnail is a small JPEG, empty until there is a picture
of the view; it does not count as unsaved.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from app.document.view_state import Bookmark, Viewpoint
from engine.core.errors import InsituError

if TYPE_CHECKING:
    from engine.scene.loaders.model import ImportedCamera

MAX_BOOKMARKS = 256
MAX_NAME = 64
THUMBNAIL_SIZE = (128, 96)
MAX_THUMBNAIL_BYTES = 32 * 1024

Bookmarks = tuple[Bookmark, ...]


def is_name(name: str) -> bool:
    """Whether a view can have this name."""
    return 0 < len(name) <= MAX_NAME and name.isprintable() and name == name.strip()


def find_bookmark(bookmarks: Bookmarks, name: str) -> Bookmark:
    """The view of that name; InsituError lists the existing ones."""
    found = next((each for each in bookmarks if each.name == name), None)
    if found is None:
        there = ", ".join(each.name for each in bookmarks) or "none yet"
        raise InsituError(f"there is no view {name!r}; saved views: {there}")
    return found


def add_bookmark(bookmarks: Bookmarks, look: Viewpoint, name: str | None = None) -> Bookmarks:
    """The list with a view under a name, replacing the one that has it; None: under a name of its own, at the end."""
    new = Bookmark(_free_name(bookmarks) if name is None else name, look)
    if not is_name(new.name):
        raise InsituError(f"view {name!r}: expected a name of 1 to {MAX_NAME} characters")
    if any(each.name == new.name for each in bookmarks):
        return tuple(new if each.name == new.name else each for each in bookmarks)
    if len(bookmarks) >= MAX_BOOKMARKS:
        raise InsituError(f"there are {MAX_BOOKMARKS} saved views; delete one to save another")
    return (*bookmarks, new)


def camera_bookmarks(cameras: Sequence[ImportedCamera], resolution: tuple[int, int]) -> Bookmarks:
    """Views of a file's cameras, under names of their own. resolution: (width, height) of the scene's picture; a camera
    that has an aspect gets about as many pixels."""
    found: Bookmarks = ()
    for each in cameras[:MAX_BOOKMARKS]:
        size = None
        if each.aspect is not None:
            height = math.sqrt(resolution[0] * resolution[1] / each.aspect)
            size = max(round(height * each.aspect), 1), max(round(height), 1)
        own = " ".join(each.name.split())[: MAX_NAME - 4].strip() or "Camera"
        taken = {bookmark.name for bookmark in found}
        name = next(name for n in range(1, len(taken) + 2) if (name := own if n == 1 else f"{own} {n}") not in taken)
        found = add_bookmark(found, Viewpoint(each.camera, size), name)
    return found


def remove_bookmark(bookmarks: Bookmarks, name: str) -> Bookmarks:
    """The list without the view of that name."""
    return tuple(each for each in bookmarks if each.name != name)


def rename_bookmark(bookmarks: Bookmarks, old: str, new: str) -> Bookmarks:
    """The list with a view renamed; InsituError where the name is invalid, or another view's."""
    if not is_name(new):
        raise InsituError(f"view {new!r}: expected a name of 1 to {MAX_NAME} characters")
    if new != old and any(each.name == new for each in bookmarks):
        raise InsituError(f"there is a view {new!r} already")
    return tuple(replace(each, name=new) if each.name == old else each for each in bookmarks)


def with_thumbnail(bookmarks: Bookmarks, name: str, thumbnail: bytes) -> Bookmarks:
    """The list with a thumbnail for a view."""
    return tuple(replace(each, thumbnail=thumbnail) if each.name == name else each for each in bookmarks)


def without_thumbnails(bookmarks: Bookmarks) -> tuple[tuple[str, Viewpoint], ...]:
    """The part of the bookmarks that counts as unsaved."""
    return tuple((each.name, each.viewpoint) for each in bookmarks)


def check_thumbnail(data: bytes) -> None:
    """Raise ValueError where it is not a JPEG file of a thumbnail."""
    from PIL.JpegImagePlugin import JpegImageFile

    width, height = THUMBNAIL_SIZE
    try:
        with JpegImageFile(io.BytesIO(data)) as picture:  # not decoded beyond the expected size
            is_small = picture.width <= width and picture.height <= height
            if is_small:
                picture.load()
    except (OSError, SyntaxError, ValueError):
        is_small = False
    if not is_small:
        raise ValueError(f"a JPEG file in base 64 of at most {width} x {height} pixels")


def _free_name(bookmarks: Bookmarks) -> str:
    taken = {each.name for each in bookmarks}
    return next(name for n in range(1, len(taken) + 2) if (name := f"View {n}") not in taken)
