"""Matching a picture in the real window by mouse and keys: the menu, the typed name of a photograph, pairs of points,
Esc, the match by its process, and undo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.pictures import write_exr
from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
PHOTOGRAPHED = 0.35, 0.15, 0.1
SHOWN = "(editor.view.stored, editor.view.difference)"
ALBEDO = "editor.document.layer('ball.0').values['albedo']"


def photograph(real: RealWindow, file: Path) -> Path:
    """The picture of the ball in another colour, as a photograph."""
    real.do(
        "from app.document.commands.layers import SetParameter; "
        f"editor.do(SetParameter('ball.0', 'albedo', {PHOTOGRAPHED}))"
    )
    real.wait_until("editor.status.is_finished")
    write_exr(file, np.ascontiguousarray(real.ask("window._feed.source.renderer.linear_image()[..., :3]"), np.float32))
    real.key("ctrl+z")
    real.wait_until("editor.status.is_finished")
    return file


def test_a_photograph_is_matched_by_mouse(real: RealWindow, tmp_path: Path) -> None:
    real.fresh(select="ball.1.theta_h")
    real.wait_until("editor.status.is_finished")
    photo, n_steps, shown = photograph(real, tmp_path / "ball.exr"), real.n_steps(), real.ask(SHOWN)
    real.do("stage.document_before = editor.document")
    real.click("menu.File")
    real.click("menu.match_picture")
    real.text(str(photo))
    real.key("enter")
    assert real.ask("str(state.match.file), state.match.object") == (str(photo), "ball"), real.notice()

    # The first half of a pair is given up first, then the picking, and what was shown before comes back.
    real.click("match.camera.1")
    real.wait_until(f"{SHOWN} == ('ball.exr', 'present')")
    real.click("viewport.centre")
    assert real.ask("state.picking.point is not None") and real.ask(SHOWN) == ("ball.exr", "stored")
    real.key("escape")
    assert real.ask("state.picking.point is None") and real.ask(SHOWN) == ("ball.exr", "present")
    real.key("escape")
    assert real.ask("state.picking is None and state.match is not None") and real.ask(SHOWN) == shown

    for name in ("1.scale", "1.theta_h", "1.alpha"):
        real.click(f"match.find.{name}")
    assert real.ask("state.match.targets") == ("0.scale",)
    real.click("button.match.begin")
    assert "button.match.stop" in real.handles()
    real.wait_until("not shell.actor.photos.progress", timeout=120.0)
    assert real.ask("editor.undo_label") == "match ball to a picture", real.notice()
    assert real.n_steps() == n_steps + 1 and real.ask("editor.view.stored") == "ball.exr"
    np.testing.assert_allclose(real.ask(ALBEDO), PHOTOGRAPHED, rtol=0.05)
    assert "match.error" in real.handles()
    real.key("ctrl+z")
    assert real.ask("editor.document == stage.document_before") and real.n_steps() == n_steps
    real.key("escape")
    assert real.ask("state.match is None")
