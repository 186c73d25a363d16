"""Painting a highlight in the window, with the real worker: by the mouse, by a script, and what the picture becomes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

import insitu
from app.document.view_state import SetView
from app.files.session import load_session
from app.modes.placement.highlight_controller import HighlightController
from app.operators.script import load_script
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.curve.tables import TabulatedCurve
from engine.inverse.highlight_brush import HighlightBrush
from engine.light.environment import LUMINANCE
from tests.ui.small_scene import linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.panels.actions import DragHighlight, PressHighlight, ReleaseHighlight, SetPanel
from ui.panels.window_state import HighlightGrip
from ui.script_runner import ScriptError, run_steps

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


def test_darker_tint_and_as_there_do_what_they_say(window: HeadlessWindow) -> None:
    before = luminance(window, MIDDLE)
    stroke(window, HighlightBrush("darker", 1.0, radius=8.0), MIDDLE)
    assert luminance(window, MIDDLE) < 0.85 * before
    window.shell.editor.undo()
    wait_until_exact(window)
    x, y = int(MIDDLE[0]), int(MIDDLE[1])
    red_before = linear_picture(window)[y, x, 0] / linear_picture(window)[y, x, 2]
    stroke(window, HighlightBrush("tint", radius=8.0, colour=(1.0, 0.2, 0.1)), MIDDLE)
    pixel = linear_picture(window)[y, x]
    assert pixel[0] / pixel[2] > 1.3 * red_before
    assert luminance(window, MIDDLE) == pytest.approx(before, rel=0.25)
    window.shell.editor.undo()
    wait_until_exact(window)
    stroke(window, HighlightBrush("as_there", radius=8.0, colour=(0.1, 0.2, 0.1)), MIDDLE, solved="curves")
    there = linear_picture(window)[y, x, :3]
    was = np.abs(np.array([0.1, 0.2, 0.1]) - pixel[:3]).sum()
    assert np.abs(there - (0.1, 0.2, 0.1)).sum() < was


@pytest.mark.parametrize("solved", ["curve", "curves", "scale"])
def test_python_paints_the_same(window: HeadlessWindow, tmp_path: Path, solved) -> None:
    scene = insitu.open(tmp_path / "small.toml")
    reached = scene.paint_highlight(f"{KEY}.{CURVE}", [MIDDLE], radius=8.0, solve=solved)
    stroke(window, HighlightBrush("brighter", 1.0, radius=8.0), MIDDLE, solved=solved)
    outcome = strokes(window).outcome
    assert outcome is not None and reached == pytest.approx(outcome.reached, abs=0.03)
    here, there = window.shell.editor.document.layer(KEY), scene.document.layer(KEY)
    assert here.values["scale"] == pytest.approx(there.values["scale"], rel=0.02)
    for name in here.model.curve_names:
        one, other = here.coefficients(name, 64), there.coefficients(name, 64)
        assert np.linalg.norm(one - other) <= 0.03 * np.linalg.norm(other)


def test_the_scale_alone_changes_a_parameter(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before = editor.document.layer(KEY).values["scale"]
    stroke(window, HighlightBrush("darker", 2.0, radius=8.0), MIDDLE, solved="scale")
    after = editor.document.layer(KEY).values["scale"]
    assert np.all(np.array(after) < 0.9 * np.array(before)) and not operators(window)
    editor.undo()
    assert editor.document.layer(KEY).values["scale"] == before


def test_a_place_is_picked_with_ctrl(window: HeadlessWindow) -> None:
    window.key(imgui.Key.p, imgui.Key.mod_shift)
    window.shell.do(SetPanel({"highlight": HighlightBrush("as_there")}))
    window.frames(2)
    window.hold(imgui.Key.mod_ctrl, True)
    window.click(*on_screen(window, MIDDLE))
    window.hold(imgui.Key.mod_ctrl, False)
    window.frames(2)
    expected = linear_picture(window)[int(MIDDLE[1]) - 1 : int(MIDDLE[1]) + 2, int(MIDDLE[0]) - 1 : int(MIDDLE[0]) + 2]
    assert window.shell.state.highlight.colour == pytest.approx(expected[..., :3].mean(axis=(0, 1)).tolist(), rel=0.3)
    assert not operators(window)


def test_beside_the_picture_no_place_is_picked(window: HeadlessWindow) -> None:
    """It read outside of the picture, which ended the program."""
    brush = HighlightBrush("as_there", colour=(0.5, 0.25, 0.125))
    window.key(imgui.Key.p, imgui.Key.mod_shift)
    window.shell.do(SetPanel({"highlight": brush}))
    window.shell.editor.do(SetView.of(zoom=2.0, fit=False))
    window.frames(3)
    x, y = window.shell.handle_position("viewport.corner")
    window.hold(imgui.Key.mod_ctrl, True)
    window.click(x - 10.0, y + 30.0)
    window.hold(imgui.Key.mod_ctrl, False)
    window.frames(2)
    assert window.shell.state.highlight == brush
    assert "expected a pixel of the picture, 96 x 64" in window.shell.editor.status.message


def test_the_wheel_changes_the_hue_of_what_was_picked_and_not_how_bright_it_is(window: HeadlessWindow) -> None:
    window.key(imgui.Key.p, imgui.Key.mod_shift)
    window.shell.do(SetPanel({"highlight": HighlightBrush("as_there", colour=(5.0, 3.0, 2.0))}))
    window.frames(2)
    window.click_handle("highlight.colour.swatch")
    window.frames(2)
    x, y = window.shell.handle_position("highlight.colour.swatch")
    window.drag((x + 168.0, y + 116.0), (x + 100.0, y + 12.0))  # along the ring, from red to blue
    window.frames(2)
    red, green, blue = window.shell.state.highlight.colour
    assert blue == pytest.approx(5.0) and blue > red and blue > green
    window.drag((x + 90.0, y + 100.0), (x + 95.0, y + 30.0))  # to the dark corner
    window.frames(2)
    assert max(window.shell.state.highlight.colour) == pytest.approx(5.0)


def test_quick_dabs_are_all_solved_for(window: HeadlessWindow) -> None:
    window.shell.do(SetPanel({"highlight": HighlightBrush(stops=0.5, radius=5.0)}))
    window.key(imgui.Key.p, imgui.Key.mod_shift)
    for place in (MIDDLE, (2.0, 2.0), (MIDDLE[0] + 3, MIDDLE[1])):
        window.click(*on_screen(window, place))
    settle(window)
    assert len(operators(window)) == 1
    editor, n, quick = window.shell.editor, 0, luminance(window, MIDDLE)
    while editor.undo() is not None:
        n += 1
    assert n == 2  # one was beside the object
    wait_until_exact(window)
    for place in (MIDDLE, (MIDDLE[0] + 3, MIDDLE[1])):
        window.click(*on_screen(window, place))
        settle(window)
    assert quick == pytest.approx(luminance(window, MIDDLE), rel=0.03)


def test_escape_during_a_stroke_takes_it_back(window: HeadlessWindow) -> None:
    picture = linear_picture(window)
    window.key(imgui.Key.p, imgui.Key.mod_shift)
    window.move(*on_screen(window, MIDDLE))
    window.press()
    assert window.run_until(lambda: bool(operators(window)), 30.0)
    window.key(imgui.Key.escape)
    window.release()
    settle(window)
    assert not operators(window) and window.shell.editor.undo() is None
    assert linear_picture(window) == pytest.approx(picture, rel=2e-3, abs=1e-5)


def test_a_script_paints_and_says_what_it_cannot(window: HeadlessWindow, tmp_path: Path) -> None:
    step = '[[step]]\npaint_highlight = {{ layer = "{}", points = [{}], radius = 8, stops = 2{} }}\n'

    def run(layer: str, points: str, more: str = "") -> None:
        (tmp_path / "a.toml").write_text(step.format(layer, points, more))
        run_steps(window, window.shell.editor, load_script(tmp_path / "a.toml"))

    before = luminance(window, MIDDLE)
    run("ball.coat.theta_h", "[44, 31], [48, 31]")
    assert len(operators(window)) == 1 and luminance(window, MIDDLE) > 1.2 * before
    with pytest.raises(ScriptError, match="no pixel of the stroke"):
        run("ball.coat.theta_h", "[2, 2]")
    with pytest.raises(ScriptError, match="expected a pixel of the picture"):
        run("ball.coat.theta_h", "[46, 31]", ', effect = "as_there", there = [200, 31]')
    with pytest.raises(ScriptError, match="no object"):
        run("cube.0", "[46, 31]")
    window.shell.editor.do(SetView.of(mode="orbit"))
    window.frames(5)
    with pytest.raises(ScriptError, match="Placement"):
        run("ball.coat.theta_h", "[46, 31]")


def test_a_painted_session_opens_again(window: HeadlessWindow, tmp_path: Path) -> None:
    stroke(window, HighlightBrush(radius=8.0), MIDDLE)
    file = tmp_path / "painted.insitu"
    assert window.shell.editor.save(file) is None
    opened = load_session(file).document
    assert opened.layer(KEY).operators(CURVE) == operators(window)
