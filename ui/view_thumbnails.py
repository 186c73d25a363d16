"""Thumbnails of bookmarked views: taken when a view is shown and its picture is complete, drawn from their JPEG.

A view that is bookmarked while its picture is still coming gets one as soon as that is there, and so does one that a
session has without a thumbnail.
"""

from __future__ import annotations

import io
from collections.abc import Callable

import moderngl
import numpy as np
from PIL import Image

from app.document.view_state import Bookmark, SetView
from app.editor.editor import Editor
from app.files.bookmarks import THUMBNAIL_SIZE, with_thumbnail
from ui.gl.gpu_memory import TextureMemory
from ui.still_saver import ViewportStill

QUALITY = 85


class ViewThumbnails:
    """The textures of the visible ones, by their files."""

    def __init__(self, context: moderngl.Context) -> None:
        self._memory = TextureMemory(context)
        self._textures: dict[bytes, moderngl.Texture] = {}

    def texture(self, bookmark: Bookmark) -> moderngl.Texture | None:
        """The picture, RGBA8 with row 0 at the top; None while there is none."""
        data = bookmark.thumbnail
        if data and data not in self._textures:
            pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))
            self._textures[data] = self._memory.texture((pixels.shape[1], pixels.shape[0]), 4, "f1", pixels)
        return self._textures.get(data)

    def follow(self, editor: Editor, still: Callable[[], ViewportStill | None]) -> bool:
        """Take the complete picture, where it is of a bookmarked view that has none; returns whether there is a new
        one."""
        self._forget_unused(editor.view.bookmarks)
        is_elsewhere = editor.status.is_away and not editor.status.follows_input
        if is_elsewhere or all(bookmark.thumbnail for bookmark in editor.view.bookmarks):
            return False
        seen = editor.camera_history.camera, editor.camera_history.resolution
        for bookmark in editor.view.bookmarks:
            camera, resolution = bookmark.viewpoint
            there = camera or editor.camera_history.own_camera, resolution or editor.camera_history.own_resolution
            if not bookmark.thumbnail and there == seen and (picture := still()) is not None:
                thumbnail = jpeg_of(picture)
                editor.do(SetView.of(bookmarks=with_thumbnail(editor.view.bookmarks, bookmark.name, thumbnail)))
                return True
        return False

    def release(self) -> None:
        """Free all textures."""
        for texture in self._textures.values():
            self._memory.release(texture)
        self._textures = {}

    def _forget_unused(self, bookmarks: tuple[Bookmark, ...]) -> None:
        used = {bookmark.thumbnail for bookmark in bookmarks}
        for data in [data for data in self._textures if data not in used]:
            self._memory.release(self._textures.pop(data))


def jpeg_of(picture: ViewportStill) -> bytes:
    """A picture as it is shown, small."""
    image = Image.fromarray(np.round(255.0 * np.clip(picture.shown, 0.0, 1.0)).astype(np.uint8))
    image.thumbnail(THUMBNAIL_SIZE)
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return file.getvalue()
