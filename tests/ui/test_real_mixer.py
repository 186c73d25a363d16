"""Lights in the real window by mouse: the mixer's rows, and a lamp that is placed by its highlight and by its shadow;
the picture follows, a drag is one step, and undo takes it back."""

from __future__ import annotations

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
MIX = "editor.document.light.mix"
LAMP = "editor.document.object('lamp').transform"
BRIGHTNESS = "float(window._feed.source.renderer.display_image()[..., :3].mean())"
AT_THE_CENTRE = "float(window._feed.source.renderer.linear_image_with_alpha()[14:18, 22:28, :3].max())"


@pytest.fixture
def lit(real: RealWindow) -> RealWindow:
    """The small scene with the Light panel's rows and the picture in sight, at rest."""
    real.fresh(select="lamp")
    for panel in ("library", "brdf", "accuracy", "plan", "material"):
        real.do(f"import app.document.view_state as views; editor.do(views.OpenPanel({panel!r}, False))")
    real.wait_until("editor.status.is_finished")
    return real


def test_rows_of_the_mixer(lit: RealWindow) -> None:
    before, n_steps = lit.ask(BRIGHTNESS), lit.n_steps()
    lit.drag("mix.lamp.strength", by=(25.0, 0.0))
    assert lit.ask("editor.document.light.row('lamp').strength") > 0.5 and lit.n_steps() == n_steps + 1
    lit.wait_until(f"editor.status.is_finished and {BRIGHTNESS} > {before} + 0.005")
    lit.click("mix.lamp.strength", button=1)
    assert lit.ask(MIX) == ()
    # Off without the environment, back, and nothing but the lamp.
    lit.click("button.mix.light.environment.on")
    lit.wait_until(f"editor.status.is_finished and {BRIGHTNESS} < 0.8 * {before}")
    dark = lit.ask(BRIGHTNESS)
    lit.click("button.mix.light.environment.on")
    lit.click("button.mix.lamp.solo")
    lit.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {dark}) < 0.002")
    lit.click("button.mix.lamp.solo")
    assert lit.ask(MIX) == () and not lit.ask("editor.status.is_error"), lit.notice()
    lit.wait_until(f"editor.status.is_finished and abs({BRIGHTNESS} - {before}) < 0.002")
    lit.quick("ctrl+z", lit.n_steps() - n_steps)
    assert lit.ask(MIX) == () and lit.n_steps() == n_steps


def test_a_lamp_is_placed_by_its_highlight_and_by_a_shadow(lit: RealWindow) -> None:
    n_steps, (x, y) = lit.n_steps(), lit.at("viewport.centre")
    before = lit.ask(AT_THE_CENTRE)
    lit.hold("h", True)
    lit.click((x, y))
    placed = lit.ask(LAMP)
    assert not placed.is_identity and lit.n_steps() == n_steps + 1
    lit.wait_until(f"editor.status.is_finished and {AT_THE_CENTRE} > 1.5 * {before}")  # the coat mirrors it there
    lit.drag((x, y), by=(-24.0, -8.0))
    slid = lit.ask(LAMP)
    assert slid != placed and lit.n_steps() == n_steps + 2
    lit.hold("h", False)
    lit.hold("j", True)
    lit.drag((x, y), by=(-70.0, 60.0))
    lit.hold("j", False)
    assert lit.ask(LAMP) != slid and lit.n_steps() == n_steps + 3
    lit.wait_until("editor.status.is_finished")
    assert not lit.ask("editor.status.is_error"), lit.notice()
    lit.quick("ctrl+z", 3)
    assert lit.ask(LAMP).is_identity and lit.n_steps() == n_steps
