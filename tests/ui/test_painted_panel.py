"""Painted lights in the window: added, moved and sized on the environment's picture, edited by rows, placed by H and
J."""

from __future__ import annotations

import numpy as np
import pytest

from app.document.commands.light import SetMapChange, SetRotation
from app.document.commands.painted import AddPainted
from app.document.view_state import OpenPanel
from app.editor.editor import Editor
from engine.light.painted_lights import PaintedLight, world_directions
from engine.scene.light_placement import mirror_direction, shadow_direction
from tests.ui.test_gizmo import prepared
from tests.ui.test_light_by_hand import H, J, place, slope, spot
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


@pytest.fixture
def editor(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> Editor:
    """An editor with room for the Light panel, before a slope."""
    monkeypatch.setattr(PictureFeed, "spot_at", slope)
    found = prepared(window, "placement")
    for other in ("library", "brdf", "accuracy", "plan", "material"):
        found.do(OpenPanel(other, False))
    window.frames(6)
    return found


def click(window: HeadlessWindow, handle: str) -> None:
    window.click(*window.shell.handle_position(handle))
    window.frames(2)


def lights(editor: Editor) -> tuple[PaintedLight, ...]:
    return editor.document.light.painted


def selected(window: HeadlessWindow) -> str | None:
    """The name of the painted light that is selected."""
    state, view = window.shell.state.painted, window.shell.editor.view
    return None if state is None or state.beside != (view.selected, view.sun) else state.light


def towards(editor: Editor, light: PaintedLight) -> np.ndarray:
    """The direction of a light's middle in the world."""
    return world_directions(light.frame[2], editor.document.light.rotation, editor.document.light.tilt)


def painted(window: HeadlessWindow, editor: Editor) -> PaintedLight:
    """A box that is painted by the panel's list, in an environment that is turned and tilted."""
    editor.do(SetRotation(30.0))
    editor.do(SetMapChange("tilt", 15.0))
    window.frames(2)
    click(window, "painted.add")
    click(window, "painted.add.box")
    (light,) = lights(editor)
    return light


def test_what_is_added_is_selected_and_lights_what_the_camera_sees(window: HeadlessWindow, editor: Editor) -> None:
    light = painted(window, editor)
    assert light.name == "Soft box" and selected(window) == light.name
    camera = editor.camera_history.camera
    view = np.array(camera.target) - np.array(camera.position)
    assert towards(editor, light) @ view < 0.0 < towards(editor, light)[1]  # behind the camera, above
    editor.undo()
    assert not lights(editor)


def test_a_drag_on_the_picture_moves_it_in_one_step_and_its_corner_sizes_it(
    window: HeadlessWindow, editor: Editor
) -> None:
    before, n_steps = painted(window, editor), len(editor.history.undo_steps)
    start = window.shell.handle_position("painted.Soft box")
    window.drag_handle("painted.Soft box", (-20, 8))
    window.frames(2)
    (moved,) = lights(editor)
    assert len(editor.history.undo_steps) == n_steps + 1 and (moved.width, moved.height) == (
        before.width,
        before.height,
    )
    # It follows the pointer, though the environment is turned and tilted.
    assert window.shell.handle_position("painted.Soft box") == pytest.approx((start[0] - 20, start[1] + 8), abs=0.6)
    corner = window.shell.handle_position("painted.Soft box.size")
    window.drag_handle("painted.Soft box.size", (6, -4))
    window.frames(2)
    (sized,) = lights(editor)
    assert sized.width > moved.width and (sized.azimuth, sized.elevation) == (moved.azimuth, moved.elevation)
    assert window.shell.handle_position("painted.Soft box.size") == pytest.approx(
        (corner[0] + 6, corner[1] - 4), abs=1.0
    )
    editor.undo()
    editor.undo()
    assert lights(editor) == (before,)


def test_rows_edit_what_is_opened_and_buttons_order_and_delete(window: HeadlessWindow, editor: Editor) -> None:
    editor.do(AddPainted("disc", "Rim"))
    editor.do(AddPainted("box", "Key"))
    window.frames(3)
    click(window, "mix.light.painted.Rim")
    assert selected(window) == "Rim"
    window.drag_handle("light.painted.Rim.width", (15, 0))
    assert lights(editor)[0].width > 20.0
    click(window, "button.light.painted.Rim.up")
    assert [each.name for each in lights(editor)] == ["Key", "Rim"]
    click(window, "button.light.painted.Rim.delete")
    assert [each.name for each in lights(editor)] == ["Key"]
    click(window, "button.mix.light.painted.Key.on")
    assert not editor.document.light.row("light.painted.Key").on


def test_map_rows_change_the_map(window: HeadlessWindow, editor: Editor) -> None:
    click(window, "light.map")
    for name in ("hue", "contrast", "clamp"):
        window.drag_handle(f"light.{name}", (20, 0))
    window.drag_handle("light.tilt", (10, 0))
    light = editor.document.light
    assert light.hue > 0.0 and light.contrast != 1.0 and light.clamp > 0.0 and light.tilt > 0.0


def test_h_puts_its_middle_where_it_is_mirrored_and_j_where_its_shadow_falls(
    window: HeadlessWindow, editor: Editor
) -> None:
    painted(window, editor)
    n_steps = len(editor.history.undo_steps)
    at, to = place(window, 0.22, 0.53), place(window, 0.31, 0.72)
    window.hold(H, True)
    window.drag(at, to)
    window.hold(H, False)
    expected = mirror_direction(*spot(window, to), editor.camera_history.camera.position)
    assert towards(editor, lights(editor)[0]) == pytest.approx(expected)
    assert [step.label for step in editor.history.undo_steps][n_steps:] == ["place Soft box by its highlight"]
    window.hold(J, True)
    window.drag(to, at)
    window.hold(J, False)
    expected = shadow_direction(spot(window, to)[0], spot(window, at)[0])
    assert towards(editor, lights(editor)[0]) == pytest.approx(expected)
    assert len(editor.history.undo_steps) == n_steps + 2


def test_another_selection_in_the_scene_ends_its_selection(window: HeadlessWindow, editor: Editor) -> None:
    painted(window, editor)
    editor.select("lamp")
    window.frames(2)
    assert selected(window) is None
