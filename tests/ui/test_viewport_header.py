"""The viewport's header by the mouse: what moves snap to, and what several objects are rotated and scaled about."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.poses import SetTransform
from app.editor.editor import Editor
from engine.core.camera import camera_frame
from engine.scene.transform import Transform
from tests.ui.test_grab import BOXES, grabbing, labels, middle, moved_by, transform  # noqa: F401
from tests.ui.test_script_runner import run
from ui.headless import HeadlessWindow
from ui.panels.actions import SetPanel

pytestmark = pytest.mark.gl
Key = imgui.Key


def seen_at(window: HeadlessWindow, point: tuple[float, float, float]) -> tuple[float, float]:
    """Where a point of the world is on screen."""
    camera, at, corner = (
        window.shell.editor.camera_history.camera, middle(window), window.shell.handle_position("viewport.corner")
    )  # fmt: skip
    right, up, forward = camera_frame(camera)
    way = np.array(point) - camera.position
    scale = (at[1] - corner[1]) / np.tan(np.radians(camera.fov_y) / 2.0) / float(way @ forward)
    return at[0] + scale * float(way @ right), at[1] - scale * float(way @ up)


def choose(window: HeadlessWindow, name: str) -> None:
    """Pick a line of one of the header's lists."""
    window.click_handle(name.rpartition(".")[0])
    window.frames(3)
    window.click_handle(name)
    window.frames(3)


def test_the_magnet_and_the_lists_are_the_keys_and_the_menus(window: HeadlessWindow, grabbing: Editor) -> None:  # noqa: F811
    state = window.shell.state
    assert (state.snaps, state.snap_to, state.pivot) == (False, "surfaces", "middle")
    window.click_handle("button.snaps")
    assert window.shell.state.snaps
    window.key(Key.m, Key.mod_shift)
    assert not window.shell.state.snaps
    choose(window, "header.snap.ground")
    assert window.shell.state.snaps and window.shell.state.snap_to == "ground"  # what is chosen is on
    choose(window, "header.pivot.active")
    assert window.shell.state.pivot == "active"
    assert not grabbing.history.undo_steps and grabbing.view.selected_objects == ("teapot",)


def test_it_is_there_while_an_object_is_selected(window: HeadlessWindow, grabbing: Editor) -> None:  # noqa: F811
    assert "button.snaps" in window.shell.handles.names()
    grabbing.select(None)
    window.frames(3)
    assert "button.snaps" not in window.shell.handles.names()


def test_increments_count_without_ctrl_and_ctrl_is_free_of_them(
    window: HeadlessWindow, grabbing: Editor  # noqa: F811
) -> None:  # fmt: skip
    choose(window, "header.snap.increments")
    steps = []
    for ctrl in (False, True):
        window.move(*middle(window))
        window.key(Key.g)
        window.key(Key.x)
        window.hold(Key.mod_ctrl, ctrl)
        moved_by(window, 47.0, 0.0)
        steps.append(transform(grabbing).translation[0] / 0.1)
        window.hold(Key.mod_ctrl, False)
        window.key(Key.escape)
    assert steps[0] > 0.5 and steps[0] == pytest.approx(round(steps[0]), abs=1e-6)
    assert abs(steps[1] - round(steps[1])) > 1e-3


def test_on_the_ground_it_stands_on_what_is_below(window: HeadlessWindow, grabbing: Editor) -> None:  # noqa: F811
    """From a height of 0.4 m, as high as the tray's box about x = 1; beside that the lowest of all is its bottom."""
    choose(window, "header.snap.ground")
    grabbing.do(SetTransform("teapot", (0.0, 0.4, 0.0), (0.0, 0.0, 0.0)))
    grabbing.do(SetTransform("tray", (0.0, -0.6, 0.0), (0.0, 0.0, 0.0)))
    window.frames(2)
    for x, y in ((1.0, 0.4), (-0.7, -0.6)):
        window.move(*middle(window))
        foot, place = seen_at(window, (0.0, 0.4, 0.0)), seen_at(window, (x, 0.4, 0.2))
        window.key(Key.g)
        assert transform(grabbing).translation == (0.0, 0.4, 0.0)
        moved_by(window, place[0] - foot[0], place[1] - foot[1])
        # The plane is seen from little above.
        assert transform(grabbing).translation == pytest.approx((x, y, 0.2), abs=0.06)
        window.key(Key.escape)
    assert transform(grabbing).translation == (0.0, 0.4, 0.0)


@pytest.mark.parametrize("target", ["ground", "surfaces"])
def test_ctrl_is_free_of_what_moves_snap_to(window: HeadlessWindow, grabbing: Editor, target: str) -> None:  # noqa: F811
    """And snaps to increments, as the header says."""
    choose(window, f"header.snap.{target}")
    grabbing.do(SetTransform("teapot", (0.0, 0.4, 0.0), (0.0, 0.0, 0.0)))
    window.frames(2)
    window.move(*middle(window))
    window.key(Key.g)
    window.hold(Key.mod_ctrl, True)
    moved_by(window, 60.0, -47.0)
    x, y, _ = transform(grabbing).translation
    assert x > 0.05 and y > 0.45
    assert (x / 0.1, y / 0.1) == pytest.approx((round(x / 0.1), round(y / 0.1)), abs=1e-6)
    window.hold(Key.mod_ctrl, False)
    window.key(Key.escape)


@pytest.mark.parametrize("target", ["ground", "surfaces"])
def test_what_is_not_moved_stays(window: HeadlessWindow, grabbing: Editor, target: str) -> None:  # noqa: F811
    choose(window, f"header.snap.{target}")
    window.move(*middle(window))
    window.key(Key.g)
    window.frames(2)
    window.key(Key.enter)
    assert transform(grabbing) == Transform() and not grabbing.history.undo_steps


def test_a_pixel_on_the_ground_is_a_small_step(window: HeadlessWindow, grabbing: Editor) -> None:  # noqa: F811
    choose(window, "header.snap.ground")
    window.shell.do(SetPanel({"gizmo": "move"}))
    window.frames(2)
    window.drag_handle("gizmo.ground", (6.0, 0.0))
    x, y, z = transform(grabbing).translation
    assert 0.0 < x < 0.1 and (y, z) == pytest.approx((0.0, 0.0), abs=0.05)


def test_they_turn_and_grow_about_the_active_one(window: HeadlessWindow, grabbing: Editor) -> None:  # noqa: F811
    """The teapot at 0 is active: half a turn takes the tray from x = 1 to -1, twice the size from there to 2."""
    choose(window, "header.pivot.active")
    grabbing.select(("tray", "teapot"))
    window.move(*middle(window))
    for key in (Key.r, Key.y, Key._1, Key._8, Key._0, Key.enter):
        window.key(key)
    assert transform(grabbing).translation == (0.0, 0.0, 0.0)
    assert transform(grabbing, "tray").translation == pytest.approx((-2.0, 0.0, 0.0))
    grabbing.undo()
    for key in (Key.s, Key._2, Key.enter):
        window.key(key)
    assert transform(grabbing) == Transform(scale=(2.0, 2.0, 2.0))
    assert transform(grabbing, "tray").translation == pytest.approx((1.0, 0.0, 0.0))
    assert labels(grabbing) == ["scale 2 objects"]


def test_scripts_set_both(window: HeadlessWindow, grabbing: Editor, tmp_path: Path) -> None:  # noqa: F811
    run(window, tmp_path, '[[step]]\nsnap = "ground"\n[[step]]\npivot = "own"')
    state = window.shell.state
    assert (state.snaps, state.snap_to, state.pivot) == (True, "ground", "own")
    run(
        window,
        tmp_path,
        '[[step]]\nsnap = "none"\n[[step]]\nmove = {objects = ["tray", "teapot"], scale = 2, about = "active"}',
    )
    assert not window.shell.state.snaps
    assert transform(grabbing, "tray").translation == pytest.approx((1.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", range(3))
def test_any_order_of_buttons_and_moves_is_undone_to_the_bit(
    window: HeadlessWindow, grabbing: Editor, seed: int  # noqa: F811
) -> None:  # fmt: skip
    rng, start = random.Random(seed), grabbing.document
    for _ in range(12):
        window.shell.do(SetPanel({
            "snaps": rng.random() < 0.7, "snap_to": rng.choice(("increments", "ground", "surfaces")),
            "pivot": rng.choice(("middle", "own", "active")),
        }))  # fmt: skip
        grabbing.select(rng.choice((("teapot",), ("tray", "teapot"), ("teapot", "tray"))))
        window.frames(2)
        window.move(*middle(window))
        window.key(rng.choice((Key.g, Key.r, Key.s)))
        moved_by(window, rng.uniform(-80.0, 80.0), rng.uniform(10.0, 80.0))
        window.key(rng.choice((Key.enter, Key.enter, Key.escape)))
    while grabbing.undo_label is not None:
        grabbing.undo()
    assert grabbing.document == start
