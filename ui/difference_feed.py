"""Compares the present picture with a stored one: shows that through the view, and has their difference measured.

The stored picture is written to the graphics card in bands of rows, one a frame, so that a frame has time for it; then
the present one is read likewise, and a thread measures. Where that changes meanwhile, it is read again: at rest the
number is that of the picture.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.view_state import Difference
from app.editor.editor import Editor
from app.editor.stored_pictures import StoredPicture
from engine.core.errors import InsituError
from engine.render.crop import Crop, cropped
from engine.render.picture_difference import check_same_size, difference_colours, errors
from ui.gl.context import GraphicsError
from ui.gl.display import DisplayView, ShownPicture, draw_on_screen
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes
from ui.gl.row_bands import RowReading, RowUpload
from ui.gl.view_transform import ToneMapper, ToneView
from ui.modes.placement.placement_feed import exposed_background, inspection
from ui.panels.difference_board import DifferenceBoard
from ui.panels.pictures import Picture
from ui.picture_feed import PictureFeed

Light = NDArray[np.float32]


class _Wanted(NamedTuple):
    """What a measurement is of: the picture's stamp, the stored picture by its identity, the false colours, and the
    part of the picture whose error is measured."""

    stamp: int
    stored: int
    colours: Difference | None
    crop: Crop | None


class _Measured(NamedTuple):
    """relRMSE, and false colours (H, W, 4) where they were wanted."""

    error: float
    colours: NDArray[np.uint8] | None


class DifferenceFeed:
    """Follows the editor. make_picture: makes a texture drawable by panels, its pixels as squares or not."""

    def __init__(
        self, context: moderngl.Context, make_picture: Callable[[moderngl.Texture | None, bool], Picture | None]
    ) -> None:
        self._make_picture = make_picture
        self._memory, self._passes = TextureMemory(context), Passes(context)
        self._mapper, self._tone = ToneMapper(self._passes, self._memory), ToneView()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="difference")
        self._of: StoredPicture | None = None
        self._linear: moderngl.Texture | None = None
        self._texture: moderngl.Texture | None = None
        self._view: DisplayView | None = None
        self._colours: moderngl.Texture | None = None
        self._kind: Difference | None = None  # of the false colours
        self._upload: RowUpload | None = None  # of the stored picture
        self._coming: tuple[moderngl.Texture, RowUpload, Difference | None] | None = None  # newer false colours
        self._reading: tuple[_Wanted, RowReading] | None = None
        self._measuring: tuple[_Wanted, Future[_Measured]] | None = None
        self._measured: _Wanted | None = None
        self._error: float | None = None
        self._refusal = ""

    def board(self, sharp: bool) -> DifferenceBoard:
        """What there is for panels. sharp: pixels are shown as squares."""
        if self._of is None:
            return DifferenceBoard()
        texture = None if self._view is None else self._texture
        stored, colours = (self._make_picture(each, sharp) for each in (texture, self._colours))
        return DifferenceBoard(stored, colours, self._error, self._is_under_way, self._refusal)

    @property
    def _is_under_way(self) -> bool:
        return any(each is not None for each in (self._upload, self._coming, self._reading, self._measuring))

    def is_behind(self, editor: Editor, source: PictureFeed | None) -> bool:
        """Whether another frame will show more, or the picture has changed since it was measured."""
        if editor.stored.compared is None or source is None:
            return False
        wanted = _wanted(editor, source, editor.stored.compared)
        return self._of is None or self._tone.waits or self._is_under_way or self._measured != wanted

    def follow(self, editor: Editor, source: PictureFeed | None) -> bool:
        """Take a step of what is missing, before the panels of a frame; returns whether there is something new."""
        stored = editor.stored.compared
        if stored is None or source is None:
            self._forget()
            return False
        try:
            if self._of is not stored:
                self._take_stored(stored)
            if self._texture is None:  # it was refused
                self._measured = _wanted(editor, source, stored)
                return False
            if self._upload is not None:
                self._upload = None if self._upload.step() else self._upload
                return False
            is_new = self._draw_stored(editor)
            is_new |= self._take_colours()
            return self._measure(editor, source, stored) or is_new
        except GraphicsError as error:
            self._refusal = str(error)
            self._measured, self._reading = _wanted(editor, source, stored), None
            return True

    def _take_stored(self, stored: StoredPicture) -> None:
        """Begin to upload another stored picture: once, when it is chosen. Raises GraphicsError."""
        self._forget()
        self._of = stored
        self._linear = self._memory.texture(stored.size, 4, "f4")
        self._texture = self._memory.texture(stored.size, 4, "f1")
        self._upload = RowUpload(self._linear, stored.light)

    def _draw_stored(self, editor: Editor) -> bool:
        """Draw the stored picture as the display settings say; returns whether it changed."""
        assert self._linear is not None and self._texture is not None
        view = DisplayView(
            editor.view.exposure, self._tone.follow(editor.view.tone_mapping, editor.colours),
            behind=exposed_background(editor.document.background, editor.view.exposure), **inspection(editor.view),
        )  # fmt: skip
        if view == self._view:
            return False
        target = self._memory.framebuffer([self._texture])
        draw_on_screen(self._passes, self._mapper, target, self._linear, view, (0, 0, *self._linear.size))
        self._memory.release_framebuffer(target)
        self._view = view
        return True

    def _measure(self, editor: Editor, source: PictureFeed, stored: StoredPicture) -> bool:
        """Go on with the measurement; returns whether one has ended."""
        wanted, is_new = _wanted(editor, source, stored), self._take_measured(stored)
        if wanted.colours != self._kind:  # those of another kind would stand under the wrong legend
            self._drop_shown_colours()
        if self._coming is not None and wanted.colours != self._coming[2]:
            self._drop_coming()
        if self._measuring is not None or (self._reading is None and self._measured == wanted):
            return is_new
        shown = source.shown(editor)
        if shown is None:  # another picture stays on screen until the mode has its own
            self._reading, self._measured = None, wanted
            return is_new
        width, height = shown.linear.size
        if (width, height) != stored.size:
            self._refuse(shown, stored)
            self._reading, self._measured = None, wanted
            return True
        if self._reading is None or self._reading[1].pixels.shape[:2] != (height, width):
            self._reading = wanted, RowReading((width, height))
        self._refusal = ""
        of, reading = self._reading
        if reading.step(shown.target):
            self._reading = None
            done = self._thread.submit(_measured, reading.pixels, np.float32(shown.intensity), stored.light, of)
            self._measuring = of, done
        return is_new

    def _take_measured(self, stored: StoredPicture) -> bool:
        if self._measuring is None or not self._measuring[1].done():
            return False
        (of, done), self._measuring = self._measuring, None
        if of.stored != id(stored):
            return False
        measured, self._measured = done.result(), of
        self._error = measured.error
        if measured.colours is None:
            return True
        size = measured.colours.shape[1], measured.colours.shape[0]
        self._drop_coming()
        texture = self._memory.texture(size, 4, "f1")
        self._coming = texture, RowUpload(texture, measured.colours), of.colours
        return True

    def _take_colours(self) -> bool:
        """Go on with the upload of newer false colours; those before stay until it has ended. Returns whether it
        has."""
        if self._coming is None or not self._coming[1].step():
            return False
        self._memory.release(self._colours)
        (self._colours, _, self._kind), self._coming = self._coming, None
        return True

    def _refuse(self, shown: ShownPicture, stored: StoredPicture) -> None:
        width, height = shown.linear.size
        try:
            check_same_size(np.empty((height, width)), stored.light, stored.name)
        except InsituError as error:
            self._refusal = str(error)
        self._error = None
        self._drop_colours()

    def _drop_coming(self) -> None:
        if self._coming is not None:
            self._memory.release(self._coming[0])
        self._coming = None

    def _drop_colours(self) -> None:
        self._drop_coming()
        self._drop_shown_colours()

    def _drop_shown_colours(self) -> None:
        self._memory.release(self._colours)
        self._colours = self._kind = None

    def _forget(self) -> None:
        self._drop_coming()
        for texture in (self._linear, self._texture, self._colours):
            self._memory.release(texture)
        self._of = self._linear = self._texture = self._colours = self._kind = self._view = None
        self._upload = self._reading = self._measuring = self._measured = self._error = None
        self._refusal = ""

    def release(self) -> None:
        """End the thread, and free all textures."""
        self._thread.shutdown(wait=True)
        self._forget()
        self._mapper.release()
        self._passes.release()


def _wanted(editor: Editor, source: PictureFeed, stored: StoredPicture) -> _Wanted:
    kind = editor.view.difference
    return _Wanted(source.stamp, id(stored), kind if kind in ("signed", "absolute") else None, editor.view.crop)


def _measured(light: Light, intensity: np.float32, stored: Light, of: _Wanted) -> _Measured:
    """Of a present picture (H, W, 4) without the light's intensity."""
    ours, reference = np.nan_to_num(light[..., :3] * intensity, posinf=0.0, neginf=0.0), stored[..., :3]
    error = errors(cropped(ours, of.crop), cropped(reference, of.crop)).rmse
    if of.colours not in ("signed", "absolute"):
        return _Measured(error, None)
    colours = difference_colours(ours, reference, of.colours)
    return _Measured(error, np.concatenate([colours, np.full((*colours.shape[:2], 1), 255, np.uint8)], axis=2))
