"""The gizmo in the real window by mouse and keys: a drag is a step, a hurried hand loses nothing, and the
picture of the worker afterwards has the object where the hand left it."""

from __future__ import annotations

import pytest

from tests.ui.real_window import PRESS, RELEASE, RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
BALL = "editor.document.object('ball').transform"
BRIGHTNESS = "float(window._feed.source.renderer.display_image()[..., :3].mean())"


@pytest.fixture
def moving(real: RealWindow) -> RealWindow:
    """The small scene with the handles that move its ball."""
    real.fresh(select="ball.1.theta_h")
    real.wait_until("editor.status.is_finished")
    real.key("v")
    assert real.ask("state.gizmo") == "move"
    return real


def test_a_drag_moves_the_ball_in_one_step_and_the_picture_follows(moving: RealWindow) -> None:
    before = moving.ask(BRIGHTNESS)
    moving.drag("gizmo.x", by=(60.0, 0.0))
    x, y, z = moving.ask(f"{BALL}.translation")
    assert x > 0.05 and (y, z) == (0.0, 0.0) and moving.n_steps() == 1
    moving.move((1.0, 1.0))  # what is under the mouse is brighter
    moving.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {before}) > 0.1")
    assert not moving.ask("editor.status.is_error"), moving.notice()
    moving.key("ctrl+z")
    assert moving.ask(f"{BALL}.is_identity") and moving.n_steps() == 0
    moving.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {before}) < 0.02")


def test_the_tools_by_keys_in_turn(moving: RealWindow) -> None:
    for key, part in (("shift+r", "rotation"), ("z", "scale"), ("shift+g", "translation")):
        moving.key(key)
        before = moving.ask(f"{BALL}.{part}")
        moving.drag("gizmo.y", by=(25.0, -25.0))
        assert moving.ask(f"{BALL}.{part}") != before
    assert moving.n_steps() == 3
    moving.quick("ctrl+z", 3)
    assert moving.ask(f"{BALL}.is_identity")


def test_a_drag_within_one_long_frame_is_a_step(moving: RealWindow) -> None:
    x, y = moving.at("gizmo.y")
    moving.slow(120)
    moves = [("move", x, y - 10.0 * i) for i in range(1, 5)]
    moving.events(("move", x, y), ("button", 0, PRESS, 0), *moves, ("button", 0, RELEASE, 0))
    assert moving.ask(f"{BALL}.translation[1]") > 0.02 and moving.n_steps() == 1


def test_escape_takes_a_drag_back_and_then_the_handles_away(moving: RealWindow) -> None:
    moving.drag("gizmo.ground", by=(40.0, 10.0), let_go=False)
    assert moving.ask("editor.history.dragging") and not moving.ask(f"{BALL}.is_identity")
    moving.key("escape")
    moving.release()
    assert moving.ask(f"{BALL}.is_identity") and moving.n_steps() == 0 and moving.ask("state.gizmo") == "move"
    moving.key("escape")
    assert moving.ask("state.gizmo") == "" and "gizmo.y" not in moving.handles()


def test_after_a_key_the_ball_follows_the_mouse_until_a_click(moving: RealWindow) -> None:
    moving.key("escape")
    x, y = moving.at("viewport.centre")
    for key, part in (("g", "translation"), ("r", "rotation"), ("s", "scale")):
        before = moving.ask(f"{BALL}.{part}")
        moving.move((x + 80.0, y))
        moving.key(key)
        moving.events(*[("move", x + 80.0 + 6.0 * i, y - 8.0 * i) for i in range(1, 8)])
        assert moving.ask("state.grip is not None") and moving.ask(f"{BALL}.{part}") != before
        moving.click((x + 122.0, y - 56.0))
        assert moving.ask("state.grip is None and editor.view.selected_objects == ('ball',)")
    assert moving.n_steps() == 3
    moving.key("g", "x", "0", ".", "5")
    moving.key("escape")
    assert moving.n_steps() == 3 and moving.ask("state.grip is None")


def test_two_objects_are_selected_grouped_and_turned_in_one_step(moving: RealWindow) -> None:
    moving.click("objects.ground", held="ctrl")
    assert moving.ask("editor.view.selected_objects") == ("ball", "ground")
    moving.key("ctrl+g", "shift+r")
    assert moving.ask("editor.document.groups") == {"Group": ("ground", "ball")}
    moving.drag("gizmo.y", by=(40.0, 10.0))
    names = ("ball", "ground")
    assert all(moving.ask(f"editor.document.object('{name}').transform.rotation[1]") != 0.0 for name in names)
    assert moving.n_steps() == 2
    moving.quick("ctrl+z", 2)
    assert moving.ask(f"{BALL}.is_identity and editor.document.groups == {{}}")


def test_a_lamp_is_aimed_and_the_ball_stands_on_what_is_under_the_mouse(moving: RealWindow) -> None:
    lamp = "editor.document.object('lamp').transform"
    moving.click("objects.lamp")
    x, y = moving.at("viewport.centre")
    moving.move((x, y))
    moving.key("shift+t")
    moving.events(*[("move", x - 10.0 * i, y + 8.0 * i) for i in range(1, 7)])
    moving.key("enter")
    assert moving.ask(f"{lamp}.rotation") != (0.0, 0.0, 0.0) and moving.n_steps() == 1
    moving.click("objects.ball")
    moving.key("g", "1")
    moving.key("enter", "end")
    # Its radius is 0.45 m, and its centre was half a metre above the ground.
    assert moving.ask(f"{BALL}.translation") == pytest.approx((1.0, -0.05, 0.0), abs=1e-4)
    assert moving.n_steps() == 3
