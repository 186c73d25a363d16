"""A window on which a view is changed step by step, and its slow twin: what the view's description makes of the linear
picture, of stored ones and of readings (`tests.naive.shown_view`)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from engine.core.colour import ConfigView
from engine.render.crop import cropped
from engine.render.picture_difference import difference_colours, errors
from engine.render.scopes import LUMA
from tests.colour_configs import write_config
from tests.naive.shown_view import dimmed, shown_colours
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.gl.gpu_memory import read_texture
from ui.gl.view_transform import is_view_ready
from ui.headless import HeadlessWindow
from ui.panels.actions import SetPanel
from ui.panels.picture_marks import pixel_of
from ui.picture_feed import PictureFeed

LAMP = 3 * WIDTH // 4  # from this column on all is white


class ViewWalk:
    """A window on the stand-in worker; random: of what its commands draw; what was stored, by name, as numbers."""

    def __init__(self, window: HeadlessWindow, random: np.random.Generator, folder: Path) -> None:
        self.window, self.shell, self.editor = window, window.shell, window.shell.editor
        self.random, self.folder, self.config = random, folder, write_config(folder)
        source = self.shell.source
        assert isinstance(source, PictureFeed)
        self.feed = source
        self.stored: dict[str, np.ndarray] = {}
        self.before: np.ndarray | None = None  # A of the comparison
        self.done: list[str] = []
        self.n_looked_at = 0

    # ------------------------------------------------------------------------------------------------------- it goes on

    def frames(self, n: int = 1) -> None:
        for _ in range(n):
            self.window.frame()
            self.hold_legends()

    @property
    def is_placement(self) -> bool:
        return self.editor.mode.name == "placement"

    def rest(self) -> None:
        """Until the picture is finished and compared."""
        editor, shell = self.editor, self.shell
        self.window.leave()
        self.frames(2)
        ready = lambda: is_view_ready(editor.view.tone_mapping, editor.colours)  # noqa: E731
        finished = lambda: not self.is_placement or (editor.status.is_finished and self.feed.is_finished)  # noqa: E731
        rests = lambda: ready() and finished() and not shell.awaits_difference  # noqa: E731
        for _ in range(20):
            assert self.window.run_until(rests, 60), editor.status
            stamp = self.feed.stamp
            self.frames(3)  # the worker may have more
            if rests() and self.feed.stamp == stamp:
                return
        raise AssertionError("the picture does not come to rest")

    def one(self, of: Any) -> Any:
        there = list(of)
        return there[int(self.random.integers(len(there)))]

    def number(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    # ---------------------------------------------------------------------------------------------------- what there is

    def light(self) -> np.ndarray:
        """The linear picture (H, W, 4) with the light's intensity."""
        linear = self.feed.source.renderer.linear_image_with_alpha().astype(np.float64)
        linear[..., :3] *= self.editor.document.light.intensity
        return linear

    def colours(self, light: np.ndarray, inspected: bool = True, stripes: bool = True) -> np.ndarray:
        """Of light through the view, by the twin, 0 to 255."""
        view = replace(self.editor.view, zebra=self.editor.view.zebra and stripes)
        return 255.0 * shown_colours(light, view, self.editor.document.background, view.tone_mapping, inspected)

    # ------------------------------------------------------------------------------------------------------- comparison

    def hold_legends(self) -> None:
        """No legend stands over colours of another kind."""
        difference, view = self.shell._pictures.difference, self.editor.view
        board = difference.board(True)
        if board.colours is not None and view.stored:
            assert difference._kind in ("signed", "absolute")
        if view.stored and self._overlay() in ("signed", "absolute"):
            assert difference._kind == view.difference

    def _overlay(self) -> str:
        """What of the stored picture lies over the present one, "" for nothing."""
        view, board = self.editor.view, self.shell._pictures.difference.board(True)
        if not view.stored or board.refusal and view.difference != "stored":
            return ""
        there = {"stored": board.stored, "split": board.stored, "signed": board.colours, "absolute": board.colours}
        return view.difference if there.get(view.difference) is not None else ""

    def hold_to_twin(self) -> None:
        editor, view = self.editor, self.editor.view
        assert not self.editor.history.dragging
        if not self.is_placement:
            assert self.feed.values_at(editor, 3, 3) is None and self.feed.scopes(editor, view.crop) is None
            return
        light = self.light()
        self.hold_picture(light)
        self.hold_readings(light)
        self.hold_comparison(light)
        self.hold_screen()

    def hold_picture(self, light: np.ndarray) -> None:
        """The picture's texture is the light through the view, left of the divider that of A."""
        view, shown = self.editor.view, self.feed.source.renderer.display_image().astype(float)
        expected, free = self.colours(light), outlined(self.editor)
        free &= ~edges_of_stripes(self.colours(light, stripes=False), view)
        if view.compare is not None:
            column = round(view.compare_divider * WIDTH)
            free[:, min(column, WIDTH - 1)] = False
            assert (shown[:, min(column, WIDTH - 1)] == round(0.95 * 255)).all()
            if self.before is None or not self.editor.status.compared_exact:
                free[:, :column] = False
            else:
                compared = self.before.copy()
                expected[:, :column] = self.a_colours(compared)[:, :column]
        assert_alike(shown, expected, free, tolerance_of(view), view)

    def a_colours(self, light: np.ndarray) -> np.ndarray:
        compared = self.editor.view.compare
        assert compared is not None
        view = self.editor.view
        return 255.0 * shown_colours(light, view, compared.background, view.tone_mapping)

    def hold_readings(self, light: np.ndarray) -> None:
        """Values of pixels and scopes are those of the picture, also those that panels have drawn."""
        editor, view = self.editor, self.editor.view
        plain, free = self.colours(light, inspected=False), np.ones((1, 1), bool)
        places = [(int(self.random.integers(WIDTH)), int(self.random.integers(HEIGHT))) for _ in range(4)]
        picture = self.feed.picture
        assert picture is not None
        for column, row in (*places, *(pixel_of(each, picture) for each in view.probes)):  # type: ignore[arg-type]
            values = self.feed.values_at(editor, column, row)
            assert values is not None and values.alpha == pytest.approx(light[row, column, 3])
            np.testing.assert_allclose(values.radiance, light[row, column, :3], rtol=1e-5, atol=1e-7)
            if not is_stepped(view):
                assert_alike(
                    np.array(values.shown, float)[None, None], plain[row, column][None, None], free,
                    (16.0, 16.0) if tolerance_of(view)[0] > 1.0 else (1.0, 1.0), view,
                )  # fmt: skip
        found = self.feed.scopes(editor, view.crop)
        assert found is not None
        part = np.rint(cropped(plain, view.crop)).astype(int)
        assert found.n_pixels == found.n_all == part.shape[0] * part.shape[1]
        if is_stepped(view) or tolerance_of(view)[0] > 1.0:
            return
        planes = [*np.moveaxis(part, 2, 0), np.rint(part @ LUMA).astype(int)]
        for counts, plane in zip(found.counts, planes, strict=True):
            ours = np.cumsum(counts)
            truth = np.cumsum(np.bincount(plane.ravel(), minlength=256))
            # A level is one that the other rounds up, or down.
            assert (ours[:-1] <= truth[1:]).all() and (ours[1:] >= truth[:-1]).all()

    def hold_comparison(self, light: np.ndarray) -> None:
        """relRMSE and false colours are those of the picture against what was stored."""
        editor, view = self.editor, self.editor.view
        assert set(editor.stored.names) == set(self.stored)
        if not view.stored:
            assert "stored.show.0" not in self.shell.handles.names()
            return
        difference, stored = self.shell._pictures.difference, self.stored[view.stored]
        board = difference.board(True)
        if stored.shape[:2] != light.shape[:2]:
            assert board.refusal and board.error is None and board.colours is None
            return
        assert not board.refusal and not board.is_behind
        ours, reference = light[..., :3], stored[..., :3]
        expected = errors(cropped(ours, view.crop), cropped(reference, view.crop)).rmse
        assert board.error == pytest.approx(expected, rel=1e-4, abs=1e-6)
        texture = difference._texture
        assert texture is not None
        drawn = read_texture(texture, np.uint8)[..., :3].astype(float)
        free = ~edges_of_stripes(self.colours(stored, stripes=False), view)
        assert_alike(drawn, self.colours(stored), free, tolerance_of(view), view)
        if view.difference in ("signed", "absolute"):
            assert difference._colours is not None
            colours = read_texture(difference._colours, np.uint8)[..., :3].astype(float)
            truth = difference_colours(ours, reference, view.difference).astype(float)
            assert (np.abs(colours - truth).max(axis=2) <= 2).mean() > 0.97, view.difference

    def hold_screen(self) -> None:
        """What the window shows in the picture's place: most of it is under no plate and no panel."""
        view, names, overlay = self.editor.view, self.shell.handles.names(), self._overlay()
        is_of_difference = overlay in ("signed", "absolute")
        assert ("viewport.errors" in names) == is_of_difference
        is_of_stops = view.tone_mapping == "false_colour" and view.picture_channel != "alpha" and not is_of_difference
        assert ("viewport.stops" in names) == is_of_stops
        assert ("viewport.divider" in names) == (view.compare is not None or overlay == "split")
        scope = self.shell.state.scope
        self.shell.do(SetPanel({"scope": ""}))
        if view.fit or view.zoom < 6.0:  # large squares, of which labels hide few
            self.editor.do(SetView.of(fit=False, zoom=10.0))
        self.frames(2)
        self.hold_pixels(overlay)
        self.shell.do(SetPanel({"scope": scope}), SetView.of(fit=view.fit, zoom=view.zoom, centre=view.centre))

    def hold_pixels(self, overlay: str) -> None:
        """The picture's pixels."""
        view = self.editor.view
        x, y = self.shell.handle_position("viewport.corner")
        middle = self.shell.handle_position("viewport.centre")
        expected = self.feed.source.renderer.display_image().astype(float)
        difference = self.shell._pictures.difference
        divider = WIDTH
        if overlay:
            texture = difference._texture if overlay in ("stored", "split") else difference._colours
            assert texture is not None
            divider = round(view.compare_divider * WIDTH) if overlay == "split" else WIDTH
            over = read_texture(texture, np.uint8)[..., :3].astype(float)
            if over.shape != expected.shape:
                return  # of another size, over all of it
            expected[:, :divider] = over[:, :divider]
        expected = dimmed(expected, view.crop)
        pixels = self.window.pixels().astype(float)
        columns, rows = np.meshgrid(np.arange(LAMP), np.arange(HEIGHT))
        at_x = np.rint(x + (columns + 0.5) * view.zoom - 0.5).astype(int)
        at_y = np.rint(y + (rows + 0.5) * view.zoom - 0.5).astype(int)
        # Within the panel, as far as its middle is from the window's edges.
        reach_x = min(middle[0], pixels.shape[1] - middle[0]) * 0.5
        reach_y = min(middle[1], pixels.shape[0] - middle[1]) * 0.5
        seen = (np.abs(at_x - middle[0]) < reach_x) & (np.abs(at_y - middle[1]) < reach_y)
        for part in (columns < divider, columns > divider):
            taken = seen & part
            if expected is None or taken.sum() < 60:
                continue
            found, truth = pixels[at_y[taken], at_x[taken]], expected[rows[taken], columns[taken]]
            share = (np.abs(found - truth).max(axis=1) <= 3.0).mean()
            assert share > 0.35, (share, overlay, view)
            self.n_looked_at += 1


def outlined(editor: Editor) -> np.ndarray:
    """Where no outline is drawn: in the middle of the stripes (H, W)."""
    column = np.arange(WIDTH) % (WIDTH // 4)
    inside = (column > 0) & (column < WIDTH // 4 - 1)
    return np.broadcast_to(inside, (HEIGHT, WIDTH)).copy()


def is_stepped(view: ViewState) -> bool:
    """Whether the view has steps, where a number that is rounded otherwise is of another colour."""
    return view.tone_mapping == "false_colour"


def edges_of_stripes(colours: np.ndarray, view: ViewState) -> np.ndarray:
    """Where a colour (H, W, 3) is as bright as what stripes begin at, to the view's rounding (H, W)."""
    return np.asarray(view.zebra & (np.abs(colours.max(axis=2) - 254.5) <= tolerance_of(view)[0] + 0.5))


def tolerance_of(view: ViewState) -> tuple[float, float]:
    """How far 99 of 100 pixels may be off, and all, of 255: views with a table, as the guide says."""
    if is_stepped(view):
        return 1.0, 255.0
    low = 3.0 if isinstance(view.tone_mapping, ConfigView) or view.tone_mapping in ("agx", "aces_1", "aces_2") else 1.0
    # A power steepens what is near black.
    return (low, 40.0) if low == 3.0 else (1.0, 1.5)


def assert_alike(
    found: np.ndarray, truth: np.ndarray, free: np.ndarray, tolerance: tuple[float, float], of: Any
) -> None:
    off = np.abs(found - truth).max(axis=2)[free]
    if not off.size:
        return
    most, all_of_it = tolerance
    assert (off <= most + 0.51).mean() >= (0.95 if most > 1.0 else 0.98), (off.max(), (off <= most + 0.51).mean(), of)
    assert off.max() <= all_of_it + 0.51, (off.max(), of)
