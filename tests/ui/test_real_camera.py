"""The hand on the camera in the real window, over a worker that traces: quick, cancelled, as in Maya."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from tests.ui.real_window import PRESS, RELEASE, RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
LOOK, UNDO = "editor.camera_history.camera.position", "editor.camera_history.history.undo_label"
RESTS = "not editor.status.is_away and editor.status.picture == 'exact'"
LONG, PATIENCE = 70.0, 300.0


def test_drags_wheel_and_keys_move_it_and_a_view_that_was_computed_is_there_again(
    real: RealWindow, tmp_path_factory: pytest.TempPathFactory
) -> None:
    real.fresh(select=None)
    folder = tmp_path_factory.mktemp("pictures")
    own = real.ask(LOOK)
    real.events(("move", -1.0, -1.0))
    before = np.asarray(Image.open(real.shot(folder / "before.png")), int)
    x, y = real.at("viewport.centre")
    for button, held, label in ((2, "", "orbit"), (2, "shift", "pan"), (2, "ctrl", "dolly")):
        real.drag((x, y), by=(30, 18), button=button, held=held)
        assert real.ask(UNDO) == label
    real.wheel(1.0, (x - 40, y), times=3)
    assert real.ask("len(editor.camera_history.history.undo_steps)") == 4 and real.n_steps() == 0
    real.wait_until(RESTS, PATIENCE)
    real.events(("move", -1.0, -1.0))
    moved = np.asarray(Image.open(real.shot(folder / "moved.png")), int)
    size = real.ask("imgui.internal.find_window_by_name('Picture###viewport').size.y")
    middle = np.s_[int(y - 0.4 * size) : int(y + 0.4 * size), int(x) - 100 : int(x) + 100]
    assert np.abs(moved - before)[middle].mean() > 2.0  # it is seen from elsewhere
    real.key("alt+z", "alt+z", "alt+z", "alt+z")
    assert real.ask(LOOK) == own and real.ask(UNDO) is None
    real.wait_until(RESTS, PATIENCE)
    real.events(("move", -1.0, -1.0))
    again = np.asarray(Image.open(real.shot(folder / "again.png")), int)
    assert np.abs(again - before)[middle].max() <= 1  # the same picture, from the cache
    real.key("shift+alt+z")
    assert real.ask(UNDO) == "orbit"


@pytest.mark.parametrize("size", [(1380, 860), (800, 600)])
def test_esc_in_mid_drag_restores_and_a_drag_within_a_frame_counts(real: RealWindow, size: tuple[int, int]) -> None:
    real.fresh(select="ball.1")
    real.resize(*size)
    own, (x, y) = real.ask(LOOK), real.at("viewport.centre")
    real.drag((x, y), by=(60, 20), button=2, let_go=False)
    assert real.ask(LOOK) != own
    real.key("escape")
    assert real.ask(LOOK) == own and real.ask(UNDO) is None and real.ask("editor.view.selected is not None")
    real.release(2)
    real.slow(LONG)
    press, release = ("button", 2, PRESS, 0), ("button", 2, RELEASE, 0)
    real.events(("move", x, y), press, ("move", x + 50, y), release, ("move", x, y))
    quick = real.ask(LOOK)
    assert quick != own and real.ask(UNDO) == "orbit" and real.ask("state.grip") is None
    real.slow(0.0)
    real.key("alt+z")
    assert real.ask(LOOK) == own
    real.drag((x, y), by=(50, 0), button=2)
    assert real.ask(LOOK) == pytest.approx(quick)  # slow or quick, the same way


def test_as_in_maya(real: RealWindow) -> None:
    real.fresh()
    real.do("shell.actor.preferences.choose(mouse='maya')")
    x, y = real.at("viewport.centre")
    for button, label in ((0, "orbit"), (2, "pan"), (1, "dolly")):
        real.drag((x, y), by=(30, 18), button=button, held="alt")
        assert real.ask(UNDO) == label
    # Alt was not tapped by itself: no menu; and the picture's own gestures are with Ctrl and Alt.
    assert real.ask("imgui.get_current_context().open_popup_stack.size()") == 0
    look = real.ask(LOOK)
    real.wheel(1.0, (x, y), held="ctrl+alt", times=8)
    real.drag((x, y), by=(30, 10), held="ctrl+alt")
    assert real.ask(LOOK) == look and real.ask("editor.view.fit") is False
    assert real.ask("editor.view.lobe_pixel") is None
