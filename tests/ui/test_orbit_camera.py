"""The hand on the camera: which gesture is whose, what it does, and that nothing else that a hand does is lost."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetRotation
from app.document.view_state import Viewpoint
from app.files.preferences import PreferenceFile
from app.operators.registry import keys_of
from engine.core.errors import InsituError
from engine.scene.camera_moves import distance, focal_length, is_level
from engine.scene.description import Camera
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.panels.actions import SetPreference
from ui.panels.camera import CameraGrip, drag_camera, scroll_camera

Key = imgui.Key
SHIFT, CTRL, ALT = Key.mod_shift, Key.mod_ctrl, Key.mod_alt
OWN = Camera(position=(0.0, 1.0, 4.0), target=(0.0, 0.5, 0.0), fov_y=40.0)


def centre(window: HeadlessWindow) -> tuple[float, float]:
    window.frames(1)
    return window.shell.handle_position("viewport.centre")


def drag(window: HeadlessWindow, by: tuple[float, float], button: int, *held: imgui.Key) -> None:
    x, y = centre(window)
    for key in held:
        window.hold(key, True)
    window.drag((x, y), (x + by[0], y + by[1]), button=button, steps=4)
    for key in held:
        window.hold(key, False)


def label(window: HeadlessWindow) -> str | None:
    return window.shell.editor.camera_history.history.undo_label


def choose(window: HeadlessWindow, **changes: str) -> None:
    window.shell.do(SetPreference(changes))


BLENDER = {"orbit": (2,), "pan": (2, SHIFT), "dolly": (2, CTRL)}
MAYA = {"orbit": (0, ALT), "pan": (2, ALT), "dolly": (1, ALT)}


@pytest.mark.gl
@pytest.mark.parametrize(("mouse", "drags"), [("blender", BLENDER), ("maya", MAYA)])
def test_drags_as_in_other_programs(window: HeadlessWindow, mouse: str, drags: dict[str, tuple]) -> None:
    editor = window.shell.editor
    choose(window, mouse=mouse)
    for gesture, (button, *held) in drags.items():
        before = editor.camera_history.camera
        drag(window, (50, 20), button, *held)
        assert label(window) == gesture and window.shell.state.grip is None
        editor.camera_history.undo()
        assert (
            editor.camera_history.camera == before and editor.camera_history.history.undo_label is None
        )  # one drag, one step
    # Nothing of it is an edit or a selection, or a lobe; what the other program does with its keys is not done.
    for button, *held in (BLENDER if mouse == "maya" else MAYA).values():
        if (button, held) != (0, [ALT]):  # in the picture that shows the lobe
            drag(window, (50, 20), button, *held)
    assert editor.camera_history.camera == OWN and not editor.history.undo_steps and editor.view.lobe_pixel is None
    assert editor.view.selected is not None and editor.view.selected.object == "teapot"


@pytest.mark.gl
def test_an_orbit_by_pixels(window: HeadlessWindow) -> None:
    drag(window, (50, 25), 2)
    camera = window.shell.editor.camera_history.camera
    # 0.4 degrees a pixel: 20 to the left of where it stood at +Z, and 10 up, about the target.
    x, y, z = np.subtract(camera.position, camera.target)
    assert math.degrees(math.atan2(x, z)) == pytest.approx(-20.0)
    before = math.asin(0.5 / distance(OWN))
    assert math.asin(y / distance(camera)) == pytest.approx(before + math.radians(10.0))
    assert distance(camera) == pytest.approx(distance(OWN)) and is_level(camera)


@pytest.mark.gl
def test_a_hand_that_returns_and_one_that_presses_esc_leave_no_step(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    x, y = centre(window)
    window.move(x, y)
    window.press(2)
    window.move(x + 60, y)
    window.move(x, y)
    window.release(2)
    assert editor.camera_history.camera == OWN and editor.camera_history.history.undo_label is None
    window.move(x, y)
    window.press(2)
    window.move(x + 60, y)
    window.frames(1)
    assert editor.camera_history.camera != OWN and editor.status.is_away
    window.key(Key.escape)
    assert editor.camera_history.camera == OWN and editor.camera_history.history.undo_label is None
    window.move(x + 90, y + 10)  # the button is still down
    window.release(2)
    assert editor.camera_history.camera == OWN and editor.view.selected is not None


@pytest.mark.gl
def test_the_wheel_goes_nearer_what_is_under_the_mouse(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    x, y = centre(window)
    window.move(x - 100, y + 30)
    for _ in range(3):
        window.wheel(1.0)
    assert editor.camera_history.history.undo_label == "dolly" and distance(
        editor.camera_history.camera
    ) < 0.7 * distance(OWN)
    moved = np.subtract(editor.camera_history.camera.position, OWN.position)
    assert moved[0] < 0.0  # towards the left, where the mouse is
    editor.camera_history.undo()
    assert editor.camera_history.camera == OWN  # three notches, one step


@pytest.mark.gl
def test_two_fingers_orbit_pan_and_go_nearer(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    choose(window, scroll="orbit")
    x, y = centre(window)
    window.move(x, y)
    for held, expected in ((None, "orbit"), (SHIFT, "pan"), (CTRL, "dolly")):
        for key in filter(None, (held,)):
            window.hold(key, True)
        for _ in range(3):
            window.shell.events.wheel(0.1, 0.2)
            window.frames(2)
        for key in filter(None, (held,)):
            window.hold(key, False)
        assert label(window) == expected
        editor.camera_history.undo()
        assert editor.camera_history.camera == OWN
    assert editor.view.fit


def test_the_scene_goes_with_the_hand() -> None:
    grip = CameraGrip("camera", (0.0, 0.0), "pan", 2, OWN, distance(OWN))
    # A tenth of the picture's height to the right is a tenth of what is seen at the target, to the left.
    height = 2.0 * distance(OWN) * math.tan(math.radians(20.0))
    assert drag_camera(grip, 40.0, 0.0, 1.0, 400.0).position[0] == pytest.approx(-0.1 * height)
    assert drag_camera(grip, 0.0, 0.0, 1.0, 400.0) == OWN
    dolly = CameraGrip("camera", (0.0, 0.0), "dolly", 2, OWN, 1.0)
    assert distance(drag_camera(dolly, 0.0, 150.0, 1.0, 400.0)) == pytest.approx(2.0 * distance(OWN))
    assert distance(drag_camera(dolly, 300.0, 0.0, 2.0, 400.0)) == pytest.approx(0.5 * distance(OWN))
    assert scroll_camera(OWN, "orbit", 1.0, 0.0, (0, 0, 0)).position[0] < 0.0


@pytest.mark.gl
def test_what_the_picture_had_before_is_still_there(window: HeadlessWindow) -> None:
    """Turning the light, the lobe, selecting: with either program's mouse."""
    editor = window.shell.editor
    for mouse in ("blender", "maya"):
        choose(window, mouse=mouse)
        drag(window, (40, 0), 0, SHIFT)
        assert editor.document.light.rotation != 0.0
        editor.do(SetRotation(0.0))
        x, y = centre(window)
        window.hold(ALT, True)
        window.click(x, y)
        window.hold(ALT, False)
        assert editor.view.lobe_pixel == (WIDTH // 2, HEIGHT // 2)
        window.hold(SHIFT, True)
        drag(window, (90, 0), 0, ALT)
        window.hold(SHIFT, False)
        assert editor.view.lobe_pixel is not None and editor.view.lobe_pixel[0] > WIDTH // 2
        window.click(x - 300, y)
        assert editor.view.selected is not None and editor.view.selected.object == "teapot"
        window.click(x + 60, y)
        assert editor.view.selected.object == "wall"
    assert editor.camera_history.camera == OWN


@pytest.mark.gl
def test_keys_look_from_the_sides_and_frame(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    r = distance(OWN)
    for key, held, place in (
        (Key.keypad1, (), (0, 0.5, r)), (Key.keypad3, (), (r, 0.5, 0)), (Key.keypad7, (), (0, 0.5 + r, 0)),
        (Key.keypad1, (CTRL,), (0, 0.5, -r)), (Key.keypad3, (CTRL,), (-r, 0.5, 0)),
        (Key.keypad7, (CTRL,), (0, 0.5 - r, 0)),
    ):  # fmt: skip
        window.key(key, *held)
        assert editor.camera_history.camera.position == pytest.approx(place, abs=2e-3)
    window.key(Key.f)
    assert editor.camera_history.camera.target == pytest.approx((0.0, 0.0, 0.0))  # the teapot's box
    assert label(window) == "frame teapot"
    window.key(Key.keypad4)
    window.key(Key.keypad_add)
    window.key(Key.home)
    assert label(window) == "frame all"
    window.key(Key.keypad0)
    assert editor.camera_history.camera == OWN and editor.view.camera is None
    window.key(Key.z, ALT)
    assert label(window) == "nearer" or editor.camera_history.camera != OWN
    window.key(Key.z, SHIFT, ALT)
    assert editor.camera_history.camera == OWN and not editor.history.undo_steps


@pytest.mark.gl
def test_the_panel_of_lens_horizon_size_and_kept_views(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.key(Key.n)
    window.drag_handle("camera.focal", (100, 0))
    # 100 pixels double it; 3 of them make it a drag.
    assert focal_length(editor.camera_history.camera.fov_y) == pytest.approx(2.0 * focal_length(40.0), rel=0.03)
    assert label(window) == "focal length" and editor.camera_history.camera.position == OWN.position
    window.click_handle("button.camera.save_view")
    window.click_handle("button.camera.reset")
    window.click_handle("button.camera.save_view")
    assert [each.name for each in editor.view.bookmarks] == ["View 1", "View 2"]
    assert window.run_until(lambda: all(each.thumbnail for each in editor.view.bookmarks[1:]), 20.0)
    window.click_handle("button.camera.rename.View 2")
    window.frames(2)
    window.type("Front")
    window.key(Key.enter)
    assert [each.name for each in editor.view.bookmarks] == ["View 1", "Front"]
    window.click_handle("camera.view.View 1")
    assert editor.camera_history.camera.fov_y < 25.0 and label(window) == "View 1"
    window.click_handle("button.camera.update.Front")
    assert editor.view.bookmarks[1].viewpoint.camera == editor.camera_history.camera
    window.click_handle("button.camera.delete.View 1")
    assert [each.name for each in editor.view.bookmarks] == ["Front"]
    window.click_handle("camera.size.1")
    width, height = editor.view.resolution or (0, 0)
    assert width > height > 200
    assert not window.shell.state.message or not window.shell.state.message.is_error
    window.key(Key.escape)
    assert not window.shell.state.shows_camera


@pytest.mark.gl
def test_a_tilted_horizon_is_levelled(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.camera_history.set_viewpoint(Viewpoint(OWN.model_copy(update={"up": (0.4, 1.0, 0.0)})), "tilt")
    window.key(Key.n)
    window.click_handle("button.camera.level")
    assert is_level(editor.camera_history.camera) and editor.camera_history.camera.position == pytest.approx(
        OWN.position
    )


@pytest.mark.gl
def test_the_menu_moves_the_camera_and_chooses_the_mouse(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.click_handle("menu.View")
    window.click_handle("menu.Camera")
    window.click_handle("menu.mouse.maya")
    assert window.shell.actor.preferences.current.mouse == "maya"
    window.click_handle("menu.View")
    window.click_handle("menu.Camera")
    window.click_handle("menu.view_right")
    assert editor.camera_history.camera.position[0] == pytest.approx(distance(OWN))
    window.click_handle("menu.Edit")
    window.click_handle("menu.undo_view")
    assert editor.camera_history.camera == OWN


def test_preferences_are_kept_and_damaged_ones_cost_nothing(tmp_path: Path) -> None:
    file = tmp_path / "preferences.toml"
    PreferenceFile(file).choose(mouse="maya", scroll="orbit")
    assert (PreferenceFile(file).current.mouse, PreferenceFile(file).current.scroll) == ("maya", "orbit")
    for text in ('mouse = "houdini"', "mouse = 3", "[[", 'mouse = "maya"\nnext_years = 1'):
        file.write_text(text)
        assert PreferenceFile(file).current.mouse == ("maya" if "next" in text else "blender")
    (tmp_path / "file").write_text("")
    with pytest.raises(InsituError):
        PreferenceFile(tmp_path / "file" / "preferences.toml").choose(mouse="maya")


@pytest.mark.gl
def test_home_frames_all_and_steps_to_no_control(window: HeadlessWindow) -> None:
    window.click_handle("button.undo")  # whose panel then has the keyboard
    window.key(Key.home)
    assert label(window) == "frame all" and not window.shell.io.nav_visible


def test_a_menu_entry_has_its_own_keys_beside_it() -> None:
    assert [keys_of(name) for name in ("frame", "frame_all", "view_top", "view_left", "whole", "pixels", "undo")] == [
        "F", "Home", "Keypad 7", "Ctrl Keypad 3", "0", "1", "Ctrl Z"
    ]  # fmt: skip
