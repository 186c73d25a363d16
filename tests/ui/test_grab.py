"""Objects that follow the mouse after a key, without a handle: axes, numbers, snaps, several at once, and the end."""

from __future__ import annotations

import random

import numpy as np
import pytest
from imgui_bundle import imgui

from app.editor.editor import Editor
from app.operators.keymap import KEYMAPS
from app.operators.registry import OPERATORS
from engine.scene.surface_spot import SurfaceSpot
from engine.scene.transform import Transform, rotation_matrix
from ui.headless import HeadlessWindow
from ui.panels.actions import SetPanel, SetPreference
from ui.panels.grab import typed_value, with_character
from ui.panels.window_operators import chord_of
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl
Key = imgui.Key
BOXES = np.array([[[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], [[0.7, 0.0, -0.3], [1.3, 1.0, 0.3]],
                  [[-2.0, 0.0, -2.0], [2.0, 3.0, -1.9]], [[-0.2, 2.0, -0.2], [0.2, 2.0, 0.2]]])  # fmt: skip


@pytest.fixture
def grabbing(window: HeadlessWindow) -> Editor:
    """The teapot selected, its centre half a metre high at the point looked at; the mouse over the picture."""
    editor = window.shell.editor
    editor.camera_history.scene_opened(editor.scenes.opened.description, BOXES)
    editor.select("teapot")
    window.frames(2)
    window.move(*middle(window))
    return editor


def middle(window: HeadlessWindow) -> tuple[float, float]:
    return window.shell.handle_position("viewport.centre")


def transform(editor: Editor, name: str = "teapot") -> Transform:
    return editor.document.object(name).transform


def moved_by(window: HeadlessWindow, x: float, y: float) -> None:
    """Move the mouse so far from the middle, with no button held."""
    at = middle(window)
    window.move(at[0] + x, at[1] + y)
    window.frames(2)


def labels(editor: Editor) -> list[str]:
    return [step.label for step in editor.history.undo_steps]


def test_an_object_follows_the_mouse_and_a_click_ends_it(window: HeadlessWindow, grabbing: Editor) -> None:
    corner = window.shell.handle_position("viewport.corner")
    window.key(Key.g)
    moved_by(window, 60.0, -30.0)
    x, y, z = transform(grabbing).translation
    assert window.shell.state.grip is not None and not grabbing.history.undo_steps
    # The camera looks along -Z from 4 m away, and 40 degrees are the height of the picture.
    height = 2.0 * (middle(window)[1] - corner[1])
    metres = 2.0 * np.tan(np.radians(20.0)) * np.hypot(4.0, 0.5) / height
    assert (x, np.hypot(y, z)) == pytest.approx((60.0 * metres, 30.0 * metres), rel=0.02) and y > 0.0
    at = middle(window)
    window.click(at[0] + 60.0, at[1] - 30.0)  # over another object, which it does not select
    assert window.shell.state.grip is None and labels(grabbing) == ["move teapot"]
    assert grabbing.view.selected_objects == ("teapot",)
    moved_by(window, 0.0, 0.0)
    assert transform(grabbing).translation == pytest.approx((x, y, z), abs=1e-3)
    grabbing.undo()
    assert grabbing.document.poses == ()


@pytest.mark.parametrize("end", ["escape", "right"])
def test_it_is_taken_back(window: HeadlessWindow, grabbing: Editor, end: str) -> None:
    first = grabbing.document
    window.key(Key.r)
    moved_by(window, 60.0, 40.0)
    assert grabbing.document != first
    if end == "escape":
        window.key(Key.escape)
    else:
        window.press(1)
        window.release(1)
    assert grabbing.document is first and window.shell.state.grip is None and not grabbing.history.undo_steps
    assert grabbing.view.selected_objects == ("teapot",)


def test_axes_constrain_it_one_press_after_the_other(window: HeadlessWindow, grabbing: Editor) -> None:
    window.key(Key.g)
    window.key(Key.x)
    moved_by(window, 50.0, -50.0)
    x, y, z = transform(grabbing).translation
    assert x > 0.05 and (y, z) == (0.0, 0.0)
    window.key(Key.y)
    moved_by(window, 50.0, -51.0)
    x, y, z = transform(grabbing).translation
    assert y > 0.05 and (x, z) == (0.0, 0.0)
    window.key(Key.y, Key.mod_shift)
    moved_by(window, 50.0, 20.0)
    x, y, z = transform(grabbing).translation
    assert y == 0.0 and x > 0.05 and z > 0.05
    window.key(Key.enter)
    assert labels(grabbing) == ["move teapot"] and transform(grabbing).translation == (x, y, z)


@pytest.mark.parametrize(
    ("keys", "after"),
    [
        ((Key.g, Key.x, Key._1, Key.period, Key._2, Key.minus), Transform((-1.2, 0.0, 0.0))),
        ((Key.g, Key.z, Key._2, Key._5, Key.backspace), Transform((0.0, 0.0, 2.0))),
        ((Key.r, Key.y, Key._9, Key._0), Transform(rotation=(0.0, 90.0, 0.0))),
        ((Key.s, Key._2), Transform(scale=(2.0, 2.0, 2.0))),
        ((Key.s, Key.x, Key.keypad3), Transform(scale=(3.0, 1.0, 1.0))),
    ],
)
def test_numbers_say_how_far(
    window: HeadlessWindow, grabbing: Editor, keys: tuple[imgui.Key, ...], after: Transform
) -> None:
    for key in keys:
        window.key(key)
    moved_by(window, 40.0, 10.0)  # the number counts
    window.key(Key.enter)
    found = transform(grabbing)
    for part in ("translation", "rotation", "scale"):
        assert getattr(found, part) == pytest.approx(getattr(after, part), abs=1e-9)
    assert len(grabbing.history.undo_steps) == 1


def test_the_second_press_is_about_the_objects_own_axis(window: HeadlessWindow, grabbing: Editor) -> None:
    for key in (Key.r, Key.z, Key._9, Key._0, Key.enter, Key.g, Key.x, Key.x, Key._1, Key.enter):
        window.key(key)
    assert transform(grabbing).translation == pytest.approx((0.0, 1.0, 0.0))  # its X is up
    for key in (Key.g, Key.x, Key.x, Key.x, Key._1, Key.enter):  # a third press: none, and a number is along X
        window.key(key)
    assert transform(grabbing).translation == pytest.approx((1.0, 1.0, 0.0))


def test_a_turn_goes_about_the_view_as_the_mouse_goes_about_the_middle(
    window: HeadlessWindow, grabbing: Editor
) -> None:
    at = middle(window)
    window.move(at[0] + 100.0, at[1])
    window.key(Key.r)
    for degrees in range(0, 451, 30):  # counter-clockwise, more than once about
        angle = np.radians(degrees)
        window.move(at[0] + 100.0 * np.cos(angle), at[1] - 100.0 * np.sin(angle))
    window.key(Key.enter)
    x, y, z = transform(grabbing).rotation
    assert z == pytest.approx(90.0, abs=4.0)  # the middle of the object is a little beside that of the picture
    assert abs(x) < 10.0 and abs(y) < 10.0


def test_several_turn_about_their_middle_or_each_about_its_own(window: HeadlessWindow, grabbing: Editor) -> None:
    grabbing.select(("tray", "teapot"))
    for key in (Key.r, Key.y, Key._1, Key._8, Key._0, Key.enter):
        window.key(key)
    assert transform(grabbing).translation == pytest.approx((1.0, 0.0, 0.0))
    assert transform(grabbing, "tray").translation == pytest.approx((-1.0, 0.0, 0.0))
    assert labels(grabbing) == ["rotate 2 objects"]
    grabbing.undo()
    window.shell.do(SetPanel({"pivot": "own"}))
    for key in (Key.s, Key._2, Key.enter):
        window.key(key)
    assert transform(grabbing) == transform(grabbing, "tray") == Transform(scale=(2.0, 2.0, 2.0))


def test_ctrl_snaps_and_a_pointer_that_returns_is_no_step(window: HeadlessWindow, grabbing: Editor) -> None:
    window.key(Key.g)
    window.key(Key.x)
    window.hold(Key.mod_ctrl, True)
    moved_by(window, 47.0, 0.0)
    window.frames(2)
    x = transform(grabbing).translation[0]
    assert x > 0.0 and x / 0.1 == pytest.approx(round(x / 0.1), abs=1e-6)
    window.hold(Key.mod_ctrl, False)
    moved_by(window, 0.0, 0.0)
    window.key(Key.enter)
    assert grabbing.document.poses == () and not grabbing.history.undo_steps


def test_shift_makes_it_fine(window: HeadlessWindow, grabbing: Editor) -> None:
    window.key(Key.g)
    moved_by(window, 50.0, 0.0)
    coarse = transform(grabbing).translation[0]
    window.key(Key.escape)
    window.key(Key.g)
    window.hold(Key.mod_shift, True)
    moved_by(window, 50.0, 0.0)
    moved_by(window, 0.0, 0.0)
    window.key(Key.enter)
    window.hold(Key.mod_shift, False)
    assert abs(transform(grabbing).translation[0]) == pytest.approx(0.1 * coarse, rel=0.15)


def test_with_snap_a_move_goes_over_the_surface_under_the_mouse(window: HeadlessWindow, grabbing: Editor) -> None:
    """All surfaces of the stand-in are 4 m away from the camera, and face along Z."""
    window.key(Key.m, Key.mod_shift)
    assert window.shell.state.snaps
    corner, at, source = window.shell.handle_position("viewport.corner"), middle(window), window.shell.source
    assert source is not None and (spot := source.spot_at(int(48 * 2.5 / 4.0), 16)) is not None
    window.key(Key.g)
    moved_by(window, 2.0 * (at[0] - corner[0]) * (2.5 / 4.0 - 0.5), 5.0)  # the third stripe
    x, y, z = transform(grabbing).translation
    assert z == pytest.approx(spot.place[2] + 0.3)  # its side touches the wall
    assert (x, 0.5 + y) == pytest.approx(spot.place[:2], abs=2.0 * spot.metres)
    window.key(Key.enter)
    assert labels(grabbing) == ["move teapot"]


def test_a_lamp_is_aimed_at_what_is_under_the_mouse(
    window: HeadlessWindow, grabbing: Editor, monkeypatch: pytest.MonkeyPatch
) -> None:
    grabbing.select("lamp")
    window.frames(2)
    source, corner, at = window.shell.source, window.shell.handle_position("viewport.corner"), middle(window)
    assert source is not None and (spot := source.spot_at(int(48 * 0.5 / 4.0), 16)) is not None
    window.key(Key.t, Key.mod_shift)
    moved_by(window, 2.0 * (at[0] - corner[0]) * (0.5 / 4.0 - 0.5), 5.0)
    window.key(Key.enter)
    found = transform(grabbing, "lamp")
    towards = spot.place - (0.0, 2.0, 0.0)
    facing = rotation_matrix(found.rotation) @ (0.0, 0.0, 1.0)
    assert facing == pytest.approx(towards / np.linalg.norm(towards), abs=0.02) and labels(grabbing) == ["aim lamp"]
    window.shell.do(SetPanel({"gizmo": "aim"}))
    window.frames(2)
    elsewhere = SurfaceSpot(np.array([1.0, 0.5, 0.5]), np.array([0.0, 0.0, 1.0]), 0.1)
    monkeypatch.setattr(PictureFeed, "spot_at", lambda feed, *at: elsewhere)
    window.drag_handle("gizmo.aim", (20.0, -10.0))
    towards = elsewhere.place - (0.0, 2.0, 0.0)
    facing = rotation_matrix(transform(grabbing, "lamp").rotation) @ (0.0, 0.0, 1.0)
    assert facing == pytest.approx(towards / np.linalg.norm(towards)) and len(grabbing.history.undo_steps) == 2
    grabbing.select("teapot")
    window.key(Key.t, Key.mod_shift)
    assert window.shell.state.message is not None and window.shell.state.grip is None


def test_no_control_and_no_other_key_gets_what_is_pressed(window: HeadlessWindow, grabbing: Editor) -> None:
    x, y = window.shell.handle_position("objects.tray")
    window.key(Key.g)
    for key in (Key.c, Key.o, Key._0, Key.delete, Key.tab):
        window.key(key)
    assert grabbing.view.compare is None and grabbing.view.mode == "placement"
    window.click(x, y)
    assert window.shell.state.grip is None and grabbing.view.selected_objects == ("teapot",)


def test_each_keymap_gives_each_key_to_one_operator() -> None:
    for keys, changed in KEYMAPS.items():
        own = {name: changed[name][0] if name in changed else each.keys for name, each in OPERATORS.items()}
        chords = [chord_of(key) for each in own.values() for key in each]
        assert len(set(chords)) == len(chords), keys


def test_the_keys_of_maya_choose_handles(window: HeadlessWindow, grabbing: Editor) -> None:
    window.shell.do(SetPreference({"keys": "maya"}))
    for key, tool in ((Key.w, "move"), (Key.e, "rotate"), (Key.r, "scale")):
        window.key(key)
        assert window.shell.state.gizmo == tool
    assert not grabbing.view.shows_error and grabbing.view.active_tool != "stroke"
    window.key(Key.e, Key.mod_shift)
    assert grabbing.view.shows_error
    window.key(Key.g)
    assert grabbing.view.mode == "deform"


def test_a_number_is_typed_in_any_order() -> None:
    typed = ""
    for character in "1.5.-":
        typed = with_character(typed, character)
    assert typed == "-1.5"
    assert typed_value("-") is None and typed_value("") is None and typed_value(".5") == 0.5


@pytest.mark.parametrize("seed", range(3))
def test_any_sequence_of_gestures_ends_where_its_steps_say(window: HeadlessWindow, grabbing: Editor, seed: int) -> None:
    """Each gesture is one step or none, and undo goes back to the bit."""
    rng, first, states = random.Random(seed), grabbing.document, [grabbing.document]
    for _ in range(14):
        grabbing.select(tuple(rng.sample(("teapot", "tray", "lamp"), rng.randint(1, 3))))
        before = len(grabbing.history.undo_steps)
        window.key(rng.choice((Key.g, Key.r, Key.s)))
        for _ in range(rng.randint(1, 4)):
            if rng.random() < 0.4:
                window.key(rng.choice((Key.x, Key.y, Key.z, Key._2, Key.minus, Key.period, Key.backspace)))
            else:
                moved_by(window, rng.uniform(-80, 80), rng.uniform(-60, 60))
        end = rng.choice(("enter", "click", "escape", "undo"))
        if end == "click":
            at = middle(window)
            window.click(at[0] + rng.uniform(-80, 80), at[1])
        else:
            window.key(Key.escape if end in ("escape", "undo") else Key.enter)
        assert window.shell.state.grip is None and not grabbing.history.dragging
        if end == "undo":
            grabbing.undo()
        elif len(grabbing.history.undo_steps) > before:
            states = [*states[: before + 1], grabbing.document]
        assert grabbing.document == states[len(grabbing.history.undo_steps)]
    while grabbing.undo() is not None:
        pass
    assert grabbing.document == first
