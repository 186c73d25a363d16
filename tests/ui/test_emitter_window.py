"""A lamp in the real window: clicked, dimmed, tinted, undone."""

from __future__ import annotations

import pytest

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)

EMISSION = "editor.document.object('lamp').emission"


def test_a_lamp_is_clicked_and_dimmed(real: RealWindow) -> None:
    real.fresh("ball.coat.theta_h")
    before = real.ask(EMISSION)
    x, y = real.at("viewport.centre")
    left, top = real.at("viewport.corner")
    width, height = real.ask("(lambda p: (p.width, p.height))(shell.source.picture)")
    columns = real.ask(
        f"[(c, r) for r in range({height}) for c in range({width}) if shell.source.object_at(c, r) == 'lamp']"
    )
    column, row = columns[len(columns) // 2]
    real.click((left + 2 * (x - left) * (column + 0.5) / width, top + 2 * (y - top) * (row + 0.5) / height))
    assert real.ask("editor.view.selected") == ("lamp", 0, None)
    assert {"emitter.strength", "emitter.r", "emitter.swatch"} <= set(real.handles())
    assert "curve.magnitude" not in real.handles() and not real.ask("state.message and state.message.is_error")
    steps = real.n_steps()
    real.drag("emitter.strength", by=(-20, 0))
    dimmed = real.ask(EMISSION)
    assert max(dimmed) < max(before)
    assert dimmed[1] / dimmed[0] == pytest.approx(before[1] / before[0])
    assert real.n_steps() == steps + 1
    real.drag("emitter.b", by=(60, 0))
    tinted = real.ask(EMISSION)
    assert tinted[:2] == dimmed[:2] and tinted[2] > dimmed[2]
    real.wait_until("editor.status.picture == 'exact'")
    real.key("ctrl+z", "ctrl+z")
    assert real.ask(EMISSION) == before
    real.wait_until("editor.status.picture == 'exact'")
    assert real.ask("editor.view.selected") == ("lamp", 0, None)
    for panel in ("brdf", "library", "curve", "material"):  # none of them trips over what has no material
        real.do(f"from ui.panels.actions import ShowPanel; shell.do(ShowPanel({panel!r}))")
    real.key("s", "m", "ctrl+c", "ctrl+v", "delete")
    assert real.ask(EMISSION) == before
