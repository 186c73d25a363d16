"""Grips of deformers in the real window, under a hurried hand: each drag is a step, Esc takes one back."""

from __future__ import annotations

import pytest

from tests.ui.real_window import PRESS, RELEASE, RealWindow, chord_events, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture()
GRIP = "pose.handle.0"
AMOUNT = "editor.document.object('teapot').deformations[0].amount"


@pytest.fixture
def grip(real: RealWindow) -> tuple[float, float]:
    """Deform with a teapot a metre high that is about to be bent; where its grip is."""
    real.fresh()
    real.do(
        "boxes = np.tile([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], (len(editor.document.objects), 1, 1)); "
        "editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)"
    )
    real.click("mode.2")
    real.do(
        "from app.document.commands import AddDeformer; editor.select('teapot'); "
        "editor.do(AddDeformer('teapot', 'bend'))"
    )
    assert real.ask("editor.mode.name") == "deform" and real.n_steps() == 1
    return real.at(GRIP)


def hurried_drag(start: tuple[float, float], by: float, steps: int = 4) -> list[tuple[object, ...]]:
    """A drag to the right of which all comes in between two frames."""
    x, y = start
    moves = [("move", x + by * (i + 1) / steps, y) for i in range(steps)]
    return [("move", x, y), ("button", 0, PRESS, 0), *moves, ("button", 0, RELEASE, 0)]


def test_a_drag_is_a_step(real: RealWindow, grip: tuple[float, float]) -> None:
    real.drag(GRIP, by=(40.0, 0.0))
    assert real.ask(AMOUNT) > 1.0 and real.n_steps() == 2
    real.key("ctrl+z")
    assert real.ask(AMOUNT) == 0.0 and real.n_steps() == 1
    real.key("ctrl+shift+z")
    assert real.ask(AMOUNT) > 1.0 and real.n_steps() == 2


def test_quick_drags_are_steps_of_their_own(real: RealWindow, grip: tuple[float, float]) -> None:
    """Two drags one after the other, and their undoing, each in a single long frame."""
    real.slow(120)
    real.events(*hurried_drag(grip, 30.0))
    once, there = real.ask(AMOUNT), real.at(GRIP)
    assert once > 1.0 and real.n_steps() == 2
    real.events(*hurried_drag(there, 20.0))
    assert real.ask(AMOUNT) > once and real.n_steps() == 3
    real.quick("ctrl+z", 2)
    assert real.ask(AMOUNT) == 0.0 and real.n_steps() == 1


def test_a_double_click_on_a_grip_changes_nothing(real: RealWindow, grip: tuple[float, float]) -> None:
    real.quick_clicks(GRIP)
    real.double_click(GRIP)
    assert real.ask(AMOUNT) == 0.0 and real.n_steps() == 1 and real.ask("editor.view.selected.object") == "teapot"


def test_escape_takes_a_drag_back_and_ends_it(real: RealWindow, grip: tuple[float, float]) -> None:
    real.drag(GRIP, by=(40.0, 0.0), let_go=False)
    assert real.ask("editor.history.dragging")
    real.key("escape")
    real.events(("move", grip[0] + 80.0, grip[1]), ("move", grip[0] + 90.0, grip[1]))
    assert real.ask(AMOUNT) == 0.0 and not real.ask("editor.history.dragging")
    real.release()
    assert real.ask(AMOUNT) == 0.0 and real.n_steps() == 1 and real.ask("editor.view.selected.object") == "teapot"
    # All of it in one frame: the press, the drag, Esc and what the hand does after.
    real.slow(120)
    (*moved, released) = hurried_drag(grip, 40.0)
    real.events(*moved, *chord_events("escape"), ("move", grip[0] - 30.0, grip[1]), released)
    assert real.ask(AMOUNT) == 0.0 and real.n_steps() == 1


def test_undo_in_a_drag_waits_for_the_hand(real: RealWindow, grip: tuple[float, float]) -> None:
    real.drag(GRIP, by=(40.0, 0.0))
    before = real.ask(AMOUNT)
    real.drag(GRIP, by=(20.0, 0.0), let_go=False)
    real.key("ctrl+z")
    assert real.ask("editor.history.dragging")
    real.release()
    assert real.ask(AMOUNT) > before and real.n_steps() == 3
