"""A painted box in the real window by mouse and keys: it is added, moved and sized on the environment's picture, and
placed by its highlight; the scene's picture follows, and undo takes it back."""

from __future__ import annotations

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
PAINTED = "editor.document.light.painted"
BRIGHTNESS = "float(window._feed.source.renderer.display_image()[..., :3].mean())"


def test_a_painted_box_by_mouse(real: RealWindow) -> None:
    real.fresh(select="ball.1.theta_h")
    for panel in ("library", "brdf", "accuracy", "plan", "material"):  # room for the list and the picture
        real.do(f"import app.document.view_state as views; editor.do(views.OpenPanel({panel!r}, False))")
    real.wait_until("editor.status.is_finished")
    before, n_steps = real.ask(BRIGHTNESS), real.n_steps()
    real.click("painted.add")
    real.click("painted.add.box")
    assert real.ask(f"[each.name for each in {PAINTED}]") == ["Soft box"]
    real.wait_until(f"editor.status.is_finished and {BRIGHTNESS} > {before} + 0.01")
    lit = real.ask(BRIGHTNESS)
    # A drag on the picture of the environment is one step, and so is one of its corner.
    box = real.ask(f"{PAINTED}[0]")
    real.drag("painted.Soft box", by=(30.0, -6.0))
    moved = real.ask(f"{PAINTED}[0]")
    assert (moved.azimuth, moved.width) != (box.azimuth, box.width) and moved.width == box.width
    real.drag("painted.Soft box.size", by=(8.0, -5.0))
    sized = real.ask(f"{PAINTED}[0]")
    assert (sized.width, sized.height) != (box.width, box.height) and sized.azimuth == moved.azimuth
    assert real.n_steps() == n_steps + 3
    # With H held, a click in the scene's picture places its highlight.
    real.hold("h", True)
    real.click("viewport.centre")
    real.hold("h", False)
    placed = real.ask(f"{PAINTED}[0]")
    assert (placed.azimuth, placed.elevation) != (moved.azimuth, moved.elevation) and real.n_steps() == n_steps + 4
    real.wait_until("editor.status.is_finished")
    assert not real.ask("editor.status.is_error"), real.notice()
    real.quick("ctrl+z", 3)
    assert real.ask(f"{PAINTED}[0]") == box
    real.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {lit}) < 0.01")
    real.key("ctrl+z")
    assert real.ask(PAINTED) == ()
    real.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {before}) < 0.01")
