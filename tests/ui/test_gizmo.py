"""The gizmo in the window: handles follow the hand, a drag is one step, Esc takes it back, and clicks stay clicks."""

from __future__ import annotations

import random

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands import AddDeformer, SetTransform
from app.document.view_state import OpenPanel, SetView
from app.editor.editor import Editor
from engine.scene.transform import Transform
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl

BOX = np.array([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]])


@pytest.fixture(params=["placement", "orbit", "deform"])
def arranging(window: HeadlessWindow, request: pytest.FixtureRequest) -> Editor:
    """The editor in each mode, its teapot selected and a metre high."""
    return prepared(window, request.param)


def prepared(window: HeadlessWindow, mode: str) -> Editor:
    editor = window.shell.editor
    boxes = np.tile(BOX, (len(editor.document.objects), 1, 1))
    editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)
    editor.do(SetView.of(mode=mode))
    editor.select("teapot")
    window.frames(2)
    return editor


def transform(editor: Editor) -> Transform:
    return editor.document.object("teapot").transform


def dragged(window: HeadlessWindow, handle: str, by: tuple[float, float]) -> np.ndarray:
    """Drag a handle; how far it went on screen."""
    start = window.shell.handle_position(handle)
    window.drag_handle(handle, by)
    window.frames(2)
    return np.subtract(window.shell.handle_position(handle), start)


def test_an_arm_moves_the_object_along_its_axis_in_one_step(window: HeadlessWindow, arranging: Editor) -> None:
    window.key(imgui.Key.v)
    window.frames(2)
    assert dragged(window, "gizmo.y", (0.0, -40.0)) == pytest.approx([0.0, -40.0], abs=4.0)
    found = transform(arranging)
    assert found.translation[1] > 0.0 and found == Transform((0.0, found.translation[1], 0.0))
    assert [step.label for step in arranging.history.undo_steps] == ["move teapot"]
    arranging.undo()
    assert transform(arranging).is_identity and arranging.document.poses == ()


def test_the_pivot_goes_over_the_ground_under_the_mouse(window: HeadlessWindow) -> None:
    editor = prepared(window, "placement")
    window.key(imgui.Key.v)
    window.frames(2)
    assert dragged(window, "gizmo.ground", (50.0, 12.0)) == pytest.approx([50.0, 12.0], abs=3.0)
    x, y, z = transform(editor).translation
    assert y == 0.0 and np.hypot(x, z) > 0.01


def test_a_knob_turns_along_its_ring(window: HeadlessWindow, arranging: Editor) -> None:
    window.key(imgui.Key.r, imgui.Key.mod_shift)
    window.frames(2)
    dragged(window, "gizmo.y", (25.0, 0.0))
    x, y, z = transform(arranging).rotation
    assert abs(y) > 3.0 and (x, z) == pytest.approx((0.0, 0.0), abs=1e-9) and len(arranging.history.undo_steps) == 1


def test_handles_beside_the_box_scale_one_axis_and_all(window: HeadlessWindow) -> None:
    editor = prepared(window, "placement")
    window.key(imgui.Key.z)
    window.frames(2)
    dragged(window, "gizmo.y", (0.0, -30.0))
    once = transform(editor).scale
    assert once[1] > 1.05 and (once[0], once[2]) == (1.0, 1.0)
    dragged(window, "gizmo.all", (30.0, -30.0))
    assert np.divide(transform(editor).scale, once) == pytest.approx(np.full(3, transform(editor).scale[0]))
    assert transform(editor).scale[0] > 1.05 and len(editor.history.undo_steps) == 2


@pytest.mark.parametrize(
    ("key", "part", "step"), [("g", "translation", 0.1), ("r", "rotation", 15.0), ("s", "scale", 0.1)]
)
def test_ctrl_snaps(window: HeadlessWindow, key: str, part: str, step: float) -> None:
    editor = prepared(window, "placement")
    window.key(getattr(imgui.Key, key), imgui.Key.mod_shift)
    window.frames(2)
    x, y = window.shell.handle_position("gizmo.y")
    window.move(x, y)
    window.press()
    window.hold(imgui.Key.mod_ctrl, True)
    window.move(x + 30.0, y - 33.0)
    window.frames(2)
    window.release()
    window.hold(imgui.Key.mod_ctrl, False)
    value = getattr(transform(editor), part)[1]
    assert value / step == pytest.approx(round(value / step), abs=1e-6) and transform(editor) != Transform()


def test_escape_takes_a_drag_back_and_then_leaves_the_gizmo(window: HeadlessWindow) -> None:
    editor = prepared(window, "placement")
    window.key(imgui.Key.v)
    window.frames(2)
    x, y = window.shell.handle_position("gizmo.y")
    window.move(x, y)
    window.press()
    window.move(x, y - 40.0)
    window.frames(2)
    assert not transform(editor).is_identity
    window.key(imgui.Key.escape)
    window.release()
    assert transform(editor).is_identity and not editor.history.undo_steps and window.shell.state.gizmo == "move"
    window.key(imgui.Key.escape)
    assert window.shell.state.gizmo == "" and editor.view.selected is not None
    window.frames(2)
    with pytest.raises(KeyError):
        window.shell.handle_position("gizmo.y")


def test_clicks_beside_the_handles_select(window: HeadlessWindow) -> None:
    editor = prepared(window, "placement")
    editor.select("tray")
    window.key(imgui.Key.v)
    window.frames(2)
    x, y = window.shell.handle_position("viewport.corner")
    window.click(x + 5.0, y + 5.0)
    window.frames(2)
    assert editor.document.poses == () and not editor.history.undo_steps
    assert editor.view.selected is not None and editor.view.selected.object == "teapot"


def test_grips_of_deformers_go_with_the_object(window: HeadlessWindow) -> None:
    editor = prepared(window, "deform")
    editor.do(AddDeformer("teapot", "bend"))
    window.frames(2)
    before = np.array(window.shell.handle_position("pose.handle.0"))
    editor.do(SetTransform("teapot", (0.0, 0.2, 0.0)))
    window.frames(2)
    assert window.shell.handle_position("pose.handle.0")[1] < before[1] - 3.0
    assert dragged(window, "pose.handle.0", (25.0, 0.0))[0] == pytest.approx(25.0, abs=8.0)


def test_rows_of_the_panel_set_and_put_back(window: HeadlessWindow) -> None:
    editor = prepared(window, "placement")
    for panel in ("light", "library", "brdf"):  # room for all rows
        editor.do(OpenPanel(panel, False))
    window.frames(4)
    window.click_handle("material.transform.0")  # its rows are hidden at first
    window.frames(2)
    for handle, part in (("transform.position.x", 0), ("transform.position.z", 2)):
        window.drag_handle(handle, (40.0, 0.0))
        assert transform(editor).translation[part] > 0.0
    assert len(editor.history.undo_steps) == 2
    window.frames(2)
    window.click_handle("button.transform.reset")
    assert transform(editor).is_identity and len(editor.history.undo_steps) == 3


def test_the_switch_of_the_rows_takes_handles_away_with_them(window: HeadlessWindow) -> None:
    prepared(window, "placement")
    shown = []
    for what in ("material.transform.0", "v", "material.transform.0", "material.transform.0", "material.transform.0"):
        if what == "v":
            window.key(imgui.Key.v)
        else:
            window.click_handle(what)
        window.frames(3)
        shown.append(("transform.position.x" in window.shell.handles.names(), window.shell.state.gizmo))
    assert shown == [(True, ""), (True, "move"), (False, ""), (True, ""), (False, "")]


def test_any_sequence_of_drags_undo_and_redo_ends_where_its_steps_say(window: HeadlessWindow) -> None:
    """Each step of the history applied to the scene as opened gives the document, and undoing all gives the scene."""
    editor, rng = prepared(window, "placement"), random.Random(3)
    first, states = editor.document, [editor.document]
    for _ in range(25):
        what = rng.choice(("g", "r", "s", "drag", "drag", "drag", "undo", "redo"))
        if what in "grs":
            window.key(getattr(imgui.Key, what), imgui.Key.mod_shift)
        elif what == "drag" and window.shell.state.gizmo:
            n_steps = len(editor.history.undo_steps)
            window.drag_handle(f"gizmo.{rng.choice('xyz')}", (rng.uniform(-15, 15), rng.uniform(-15, 15)))
            states = [*states[: n_steps + 1], editor.document] if editor.document is not states[n_steps] else states
        elif what == "undo":
            editor.undo()
        else:
            editor.redo()
        window.frames(2)
        assert editor.document == states[len(editor.history.undo_steps)]
    while editor.undo() is not None:
        pass
    assert editor.document == first
