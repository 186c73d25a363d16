"""Highlights that are painted over the picture: reads the picture that a stroke changes, passes strokes on to the
mode's controller, and shows what the material cannot do.

The picture is read as a stroke begins and once more when it is finished, in the box of the selected object. Reading
waits for the GPU, a few milliseconds: a stroke is relative to what the user saw when it began.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.editor.editor import Editor
from app.modes.placement.highlight_stroke import PaintedOutcome
from engine.core.errors import InsituError
from engine.inverse.highlight_brush import Place
from engine.light.environment import LUMINANCE
from engine.render.picture_difference import signed_colours
from engine.scene.picture_frame import PictureFrame
from ui.gl.display import ErrorOverlay, ShownPicture
from ui.gl.gpu_memory import read_texels
from ui.panels.actions import DragHighlight, HighlightAction, PickHighlight, PressHighlight, ReleaseHighlight
from ui.panels.pictures import Picture
from ui.panels.window_state import PanelState
from ui.picture_feed import PictureFeed

# Of 255: the picture is to be seen through what is missing.
MOST_OPAQUE = 110.0
# Pixels about the mouse, on each side, whose mean is "as there".
PICKED = 1


class HighlightFeed:
    """The strokes of one editor."""

    def __init__(self, context: moderngl.Context, editor: Editor) -> None:
        self._editor = editor
        self._overlay = ErrorOverlay(context)
        self._drawn_of: PaintedOutcome | None = None
        self._colours: NDArray[np.uint8] | None = None

    def step(self, actions: tuple[HighlightAction, ...], source: PictureFeed | None, state: PanelState) -> PanelState:
        """Carry out a frame's actions, and compare the picture where that is due; returns the window's state after
        it."""
        state = self.perform(actions, source, state)
        self.follow(source)
        return state

    def panel_fields(
        self, state: PanelState, source: PictureFeed | None, picture_of: Callable[..., Picture | None]
    ) -> dict[str, Any]:
        """What panels show of the last stroke, fields of `PanelContext`; picture_of: makes a texture drawable."""
        outcome = self.outcome
        if not state.paints_highlight or outcome is None or source is None or source.picture is None:
            return {}
        overlay = picture_of(self.overlay(source.picture.size), sharp=True)
        return {"highlight_reached": outcome.reached, "highlight_overlay": overlay}

    def perform(
        self, actions: tuple[HighlightAction, ...], source: PictureFeed | None, state: PanelState
    ) -> PanelState:
        """Carry out the actions of a frame on a picture's source; returns the window's state after it."""
        for action in actions:
            try:
                if isinstance(action, PickHighlight):
                    colour = radiance_at(self._shown(source), action.place)
                    state = replace(state, highlight=replace(state.highlight, colour=colour))
                else:
                    self._perform(action, source)
            except InsituError as error:
                self._editor.cancel_drag()
                self._editor.notify(str(error), True)
        return state

    def _shown(self, source: PictureFeed | None) -> ShownPicture:
        shown = None if source is None else source.shown(self._editor)
        if shown is None:
            raise InsituError("there is no picture yet to paint a highlight in")
        return shown

    def _perform(self, action: HighlightAction, source: PictureFeed | None) -> None:
        strokes = self._editor.controller.highlights
        match action:
            case PressHighlight():
                if strokes is None:
                    raise InsituError("highlights are painted in Placement; choose that mode first")
                self._shown(source)
                strokes.begin(action.brush, action.solved, action.place)
            case DragHighlight() if strokes is not None:
                strokes.extend(action.places)
            case ReleaseHighlight() if strokes is not None:
                strokes.end()

    def is_due(self, source: PictureFeed | None) -> bool:
        """Whether the picture is finished and can be compared with what was wanted, or shows all that a stroke has
        waited for."""
        strokes = self._editor.controller.highlights
        if strokes is None or source is None:
            return False
        shows_all = strokes.can_go_on and source.shows_document(self._editor)
        return shows_all or strokes.wants_picture and source.is_finished

    def follow(self, source: PictureFeed | None) -> None:
        """Compare the picture with what was wanted, or begin the next stroke in it, where that is due."""
        strokes = self._editor.controller.highlights
        if strokes is None or source is None or not self.is_due(source):
            return
        shown = source.shown(self._editor)
        if shown is None or source.frame is None:
            return
        read = partial(radiance_of_object, shown, source.frame)
        if strokes.can_go_on:
            strokes.go_on(read, source.frame)
        else:
            strokes.compare(read)

    @property
    def outcome(self) -> PaintedOutcome | None:
        """What the last stroke has reached."""
        strokes = self._editor.controller.highlights
        return None if strokes is None else strokes.outcome

    def overlay(self, size: tuple[int, int]) -> moderngl.Texture | None:
        """What is missing, in the colours of signed differences; None where there is nothing to show. size: (width,
        height) of the picture."""
        outcome = self.outcome
        if outcome is not self._drawn_of:
            self._drawn_of = outcome
            self._colours = None if outcome is None else missing_colours(outcome, size)
        return self._overlay.texture(self._colours)

    def release(self) -> None:
        """Free the texture."""
        self._overlay.release()


def radiance_at(shown: ShownPicture, place: Place) -> tuple[float, float, float]:
    """The mean radiance about a place of the picture, linear at intensity 1; waits for the GPU. Raises InsituError
    beside it."""
    (width, height), (column, row) = shown.linear.size, place
    if not (0.0 <= column < width and 0.0 <= row < height):
        raise InsituError(
            f"no radiance at ({column:.0f}, {row:.0f}), expected a pixel of the picture, {width} x {height}"
        )
    x, y = max(int(column) - PICKED, 0), max(int(row) - PICKED, 0)
    box = x, y, min(int(column) + PICKED + 1, width) - x, min(int(row) + PICKED + 1, height) - y
    red, green, blue = read_texels(shown.target, box, "f4").reshape(-1, 4)[:, :3].mean(axis=0).clip(0.0, 1e9).tolist()
    return red, green, blue


def missing_colours(outcome: PaintedOutcome, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Colours (H, W, 4) of what is missing at the pixels that decided: of the picture's colour where it is too bright,
    as in a signed difference; clear elsewhere."""
    width, height = size
    colours = np.zeros((height * width, 4), np.uint8)
    shares = -(outcome.missing @ LUMINANCE) / max(outcome.size, 1e-30)
    colours[outcome.pixel, :3] = np.round(255.0 * signed_colours(shares))
    colours[outcome.pixel, 3] = np.round(MOST_OPAQUE * np.clip(np.abs(shares), 0.0, 1.0) ** 0.5)
    return colours.reshape(height, width, 4)


def radiance_of_object(shown: ShownPicture, frame: PictureFrame, i_object: int) -> NDArray[np.float32]:
    """The picture of a frame at the points of an object, (p, 3), linear at intensity 1; waits for the GPU."""
    row, column = frame.places(i_object)
    if not row.size:
        return np.zeros((0, 3), np.float32)
    x, y, width, height = frame.object_box(i_object)
    texels = read_texels(shown.target, (x, y, width, height), "f4")
    return np.asarray(texels[row - y, column - x, :3], np.float32)
