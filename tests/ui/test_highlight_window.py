"""Painting a highlight in the window, with the real worker: by the mouse, by a script, and what the picture becomes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import pytest
from imgui_bundle import imgui

from app.modes.placement.highlight_controller import HighlightController
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.curve.tables import TabulatedCurve
from engine.inverse.highlight_brush import HighlightBrush
from engine.light.environment import LUMINANCE
from tests.ui.small_scene import linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.panels.actions import DragHighlight, PressHighlight, ReleaseHighlight
from ui.panels.window_state import HighlightGrip

pytestmark = pytest.mark.gl
KEY, CURVE = "ball.1", "theta_h"
# Where the ball reflects the sky's glow, and where it does not, pixels of the picture.
MIDDLE = (46.0, 31.0)


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path) -> Iterator[HeadlessWindow]:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, write_small_scene(tmp_path), client) as window:
        window.shell.editor.select(f"{KEY}.{CURVE}")
        wait_until_exact(window)
        yield window


def strokes(window: HeadlessWindow) -> HighlightController:
    found = window.shell.editor.controller.highlights
    assert found is not None
    return found


def on_screen(window: HeadlessWindow, place: tuple[float, float]) -> tuple[float, float]:
    x, y = window.shell.handle_position("viewport.corner")
    centre, middle = window.shell.handle_position("viewport.centre")
    scale = max(2 * (centre - x) / 96, 2 * (middle - y) / 64)
    return x + place[0] * scale, y + place[1] * scale


def settle(window: HeadlessWindow) -> None:
    assert window.run_until(lambda: not strokes(window).is_busy and not strokes(window).wants_picture, 60.0)
    wait_until_exact(window)


def luminance(window: HeadlessWindow, place: tuple[float, float], side: int = 1) -> float:
    x, y = int(place[0]), int(place[1])
    return float((linear_picture(window)[y - side : y + side + 1, x - side : x + side + 1, :3] @ LUMINANCE).mean())


def operators(window: HeadlessWindow) -> tuple:
    return window.shell.editor.document.layer(KEY).operators(CURVE)


def stroke(window: HeadlessWindow, brush: HighlightBrush, *places: tuple[float, float], solved="curve") -> None:
    window.shell.request(PressHighlight(brush, solved, places[0]))
    window.frames(1)
    window.shell.request(DragHighlight(places[1:]) if places[1:] else ReleaseHighlight())
    window.frames(1)
    window.shell.request(ReleaseHighlight())
    window.frames(1)
    settle(window)


def test_a_drag_of_the_mouse_is_one_operator_and_one_step(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.key(imgui.Key.p, imgui.Key.mod_shift)
    assert window.shell.state.paints_highlight
    before, picture = luminance(window, MIDDLE), linear_picture(window)
    start, stop = on_screen(window, (MIDDLE[0] - 4, MIDDLE[1])), on_screen(window, (MIDDLE[0] + 4, MIDDLE[1]))
    window.move(*start)
    window.press()
    window.frames(2)
    assert isinstance(window.shell.state.grip, HighlightGrip)
    for share in (0.25, 0.5, 0.75, 1.0):
        window.move(start[0] + share * (stop[0] - start[0]), start[1])
        window.frames(2)
    window.release()
    window.frames(2)
    settle(window)
    [operator] = operators(window)
    assert isinstance(operator, TabulatedCurve) and operator.kind == "change"
    assert luminance(window, MIDDLE) > 1.3 * before
    outcome = strokes(window).outcome
    assert outcome is not None and 0.3 < outcome.reached <= 1.0
    # All that the brush passed was touched, from its start to its end.
    columns = outcome.pixel % 96
    assert columns.min() < MIDDLE[0] - 6 and columns.max() > MIDDLE[0] + 6
    assert editor.undo() == "paint highlight of ball" and not operators(window)
    wait_until_exact(window)
    assert linear_picture(window) == pytest.approx(picture, rel=2e-3, abs=1e-5)
    window.key(imgui.Key.escape)
    assert not window.shell.state.paints_highlight
