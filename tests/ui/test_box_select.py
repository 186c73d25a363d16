"""Selecting by a rectangle: what is seen in it, lamps by their middles, groups whole, with Shift and Ctrl."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands import SetGroup, SetVisible
from app.document.view_state import SetView
from app.operators.script import load_script
from engine.scene.picture_frame import Lamps, PictureFrame
from ui.headless import HeadlessWindow
from ui.panels.box_select import lamp_places
from ui.panels.window_state import BoxGrip
from ui.script_runner import run_steps

pytestmark = pytest.mark.gl
CTRL, SHIFT = imgui.Key.mod_ctrl, imgui.Key.mod_shift
STRIPES = ("teapot", "tray", "wall", "lamp")
Place = tuple[float, float]


def at(window: HeadlessWindow, column: float, row: float = 0.5) -> Place:
    """A place in the picture, of four stripes; row: from 0 at its top to 1."""
    (x, y), middle = (window.shell.handle_position(f"viewport.{name}") for name in ("corner", "centre"))
    return x + column / 2.0 * (middle[0] - x), y + row * 2.0 * (middle[1] - y)


def names(window: HeadlessWindow) -> tuple[str, ...]:
    return window.shell.editor.view.selected_objects


def box(window: HeadlessWindow, start: Place, end: Place, *held: imgui.Key) -> None:
    """After the key a drag from corner to corner, with keys held where it ends."""
    window.key(imgui.Key.b)
    window.frames(2)
    window.move(*start)
    window.press()
    window.move(*end)
    for key in held:
        window.hold(key, True)
    window.frames(2)
    window.release()
    for key in held:
        window.hold(key, False)
    window.frames(2)
    assert window.shell.state.grip is None


@pytest.fixture
def there(window: HeadlessWindow) -> HeadlessWindow:
    """A window whose lamp is, but for its pixels, where the camera does not look."""
    editor = window.shell.editor
    boxes = np.tile([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], (len(editor.document.objects), 1, 1))
    boxes[STRIPES.index("lamp")] += (0.0, 50.0, 0.0)
    editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)
    window.frames(3)
    return window


@pytest.mark.parametrize("mode", ["placement", "orbit", "deform"])
def test_what_a_rectangle_meets_is_selected_in_each_mode(there: HeadlessWindow, mode: str) -> None:
    there.shell.editor.do(SetView.of(mode=mode))
    there.frames(3)
    # From right to left as well, and stripes of which a part is in it.
    box(there, at(there, 2.1, 0.9), at(there, 0.9, 0.6))
    assert set(names(there)) == {"teapot", "tray", "wall"} and names(there)[-1] == "teapot"
    box(there, at(there, 2.2), at(there, 2.8, 0.6))
    assert names(there) == ("wall",) and not there.shell.editor.history.undo_steps


def test_shift_adds_and_ctrl_removes(there: HeadlessWindow) -> None:
    box(there, at(there, 1.2), at(there, 1.8, 0.6))
    box(there, at(there, 2.2), at(there, 3.8, 0.6), SHIFT)
    assert set(names(there)) == {"tray", "wall", "lamp"} and names(there)[-1] == "tray"
    box(there, at(there, 0.2), at(there, 1.8, 0.6), CTRL)
    assert names(there) == ("wall", "lamp")
    box(there, at(there, 2.2), at(there, 3.8, 0.6), CTRL)
    assert names(there) == ()


def test_escape_a_right_click_and_a_click_leave_all_as_it_was(there: HeadlessWindow) -> None:
    there.shell.editor.select("tray")
    start, end = at(there, 0.2), at(there, 3.8, 0.7)
    for drawn in (False, True):
        there.key(imgui.Key.b)
        assert isinstance(there.shell.state.grip, BoxGrip)
        if drawn:
            there.move(*start)
            there.press()
            there.move(*end)
            there.frames(2)
        there.key(imgui.Key.escape)
        there.release()
        there.frames(2)
        assert there.shell.state.grip is None and names(there) == ("tray",)
    there.key(imgui.Key.b)
    there.click(*start)
    there.frames(2)
    assert there.shell.state.grip is None and names(there) == ("tray",)


def test_a_group_comes_whole_and_what_is_hidden_does_not(there: HeadlessWindow) -> None:
    editor = there.shell.editor
    editor.do(SetGroup(("teapot", "lamp"), "Pair"))
    there.frames(2)
    box(there, at(there, 0.2), at(there, 0.8, 0.6))
    assert set(names(there)) == {"teapot", "lamp"}
    editor.do(SetVisible("lamp", False))
    there.frames(2)
    box(there, at(there, 0.2), at(there, 0.8, 0.6))
    assert "lamp" not in names(there)


def test_a_lamp_is_met_by_its_middle(there: HeadlessWindow) -> None:
    editor, camera = there.shell.editor, there.shell.editor.camera_history.camera
    ahead = np.array(camera.target) - np.array(camera.position)
    middle = np.array(camera.position) + 0.5 * ahead
    inside, behind = (np.stack([each - 0.01, each + 0.01]) for each in (middle, camera.position - ahead))
    # The camera looks at the middle of its picture; what is behind it is nowhere.
    assert lamp_places(editor.document, lambda name: inside, camera, (48, 32))["lamp"] == pytest.approx((24.0, 16.0))
    assert lamp_places(editor.document, lambda name: behind, camera, (48, 32)) == {}


def test_a_script_selects_by_a_rectangle(there: HeadlessWindow, tmp_path: Path) -> None:
    script = tmp_path / "a.toml"
    script.write_text(
        "[[step]]\nbox_select = { from = [20, 4], to = [2, 9] }\n"
        '[[step]]\nbox_select = { from = [30, 4], to = [31, 9], mode = "add" }\n'
        '[[step]]\nbox_select = { from = [0, 0], to = [3, 3], mode = "remove" }\n'
    )
    run_steps(there, there.shell.editor, load_script(script))
    assert names(there) == ("tray", "wall")


def test_any_rectangle_has_the_objects_of_its_pixels_and_its_small_lamps() -> None:
    rng = np.random.default_rng(2)
    image = rng.integers(-1, 5, (9, 13)).astype(np.int32)
    one = np.ones((2, 3), np.float32)
    lamps = Lamps(np.array([3 * 13 + 4, 8 * 13 + 12]), np.array([7, 8]), one[:, 0], one, one)
    frame = PictureFrame(
        np.zeros(0, np.int32), np.zeros((9, 2), np.int32), image, np.zeros((9, 13, 3), np.float32),
        np.zeros((9, 13, 3), np.float32), np.zeros(0, np.float32), lamps=lamps,
    )  # fmt: skip
    walk = random.Random(4)
    for _ in range(200):
        (left, right), (top, bottom) = (sorted(walk.uniform(-5.0, most + 5.0) for _ in "ab") for most in (13, 9))
        rows = [row for row in range(9) if row <= bottom and row + 1 > top]
        pixels = [(row, c) for row in rows for c in range(13) if c <= right and c + 1 > left]
        expected = {int(image[place]) for place in pixels} - {-1}
        expected |= {7} if (3, 4) in pixels else set()
        expected |= {8} if (8, 12) in pixels else set()
        assert set(frame.objects_in(left, top, right, bottom).tolist()) == expected
