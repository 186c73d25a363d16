"""The harness itself: a hand in the real window reaches the document, and the window under it begins anew."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from tests.ui.real_window import RealWindow, chord_events, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture()


def test_a_drag_moves_a_handle_and_a_chord_takes_it_back(real: RealWindow) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -40))
    assert real.n_steps() == 1
    assert len(real.ask("editor.document.layer('teapot.1').operators('theta_h')")) == 1
    real.key("ctrl+z")
    assert real.n_steps() == 0 and real.notice().startswith("undone")


def test_it_begins_anew(real: RealWindow) -> None:
    real.fresh()
    real.key("c", "l")
    real.drag("curve.magnitude", by=(0, -40))
    real.click("library.search")
    real.text("gold 2")
    assert real.ask("state.library.search") == "gold 2"
    real.fresh()
    assert real.n_steps() == 0
    assert real.ask("(editor.view.compare, editor.view.log_y, state.library.search)") == (None, False, "")
    assert real.ask("editor.view.selected.key") == "teapot.1"


def test_the_wheel_and_clicks_with_keys_held(real: RealWindow) -> None:
    real.fresh()
    real.wheel(1.0, "curve.plot", times=3)
    low, high = real.ask("editor.view.curve_zoom")[:2]
    assert high - low < 1.5
    real.click("viewport.corner", held="alt")
    real.drag("viewport.centre", by=(40, 0), held="shift")
    assert real.ask("editor.document.light.rotation") != 0.0


def test_pictures_sizes_and_what_is_wrong(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    real.resize(800, 600)
    with Image.open(real.shot(tmp_path / "window.png")) as picture:
        assert picture.size == (800, 600)
    real.resize(1380, 860)
    with pytest.raises(AssertionError, match=r"no handle 'curve\.z'.*curve\.magnitude"):
        real.click("curve.z")
    with pytest.raises(AssertionError, match="did not come to False"):
        real.wait_until("False", timeout=0.1)


def test_hurried_fingers_let_the_modifier_go_first() -> None:
    pressed = chord_events("ctrl+z", modifiers_first=True)
    assert pressed == [("key", 341, 1, 0), ("key", 90, 1, 2), ("key", 341, 0, 2), ("key", 90, 0, 0)]
    assert chord_events("?")[1] == ("char", ord("?"))
