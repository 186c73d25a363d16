"""A/B in the window, with real transport: A remembered early becomes as exact as B, and keeps its own light."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetIntensity
from app.document.view_state import SetView
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from tests.ui.small_scene import linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

LIFT = Operator("translate", "y", 0.1, 0.2, 0.5, 0.7, magnitude=0.8)


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path) -> Iterator[HeadlessWindow]:
    """A window whose first, coarse picture has just come."""
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, write_small_scene(tmp_path), client, n_lights=800) as opened:
        assert opened.run_until(lambda: opened.shell.editor.status.picture != "waiting", 600.0)
        opened.shell.editor.select(None)  # no outline in the picture
        yield opened


def shown(window: HeadlessWindow, divider: float) -> np.ndarray:
    """The display picture (H,W,3): with the divider at 1 all of it is A, at 0 all is B."""
    window.shell.editor.do(SetView.of(compare_divider=divider))
    window.frames(2)
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source.source.renderer.display_image()[:, 1:-1]  # the divider takes a column


def assert_alike(found: np.ndarray, expected: np.ndarray, steps: int = 1) -> None:
    assert np.abs(found.astype(int) - expected.astype(int)).max() <= steps


def test_an_early_a_becomes_exact_beside_an_edited_b(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    assert editor.status.picture == "preview"
    remembered = editor.document
    window.key(imgui.Key.c)
    coarse = shown(window, 1.0)
    assert not editor.status.compared_exact
    # All that a picture is made of, besides light and quotients: a curve, a gain, f_o and visibility.
    editor.do(AddOperator("ball.1", "theta_h", LIFT))
    editor.do(SetParameter("ground.0", "albedo", (0.2, 0.6, 0.2)))
    editor.do(AddOperator("ball.0", "theta_o", Operator("amplify", "y", 0.0, 0.0, 0.3, 0.8, magnitude=0.2)))
    wait_until_exact(window)
    assert window.run_until(lambda: editor.status.compared_exact, 60.0)
    side_a, side_b, linear_b = shown(window, 1.0), shown(window, 0.0), linear_picture(window)
    edited = editor.document
    # B is what it would be without a comparison, bit by bit.
    window.key(imgui.Key.c)
    wait_until_exact(window)
    np.testing.assert_array_equal(linear_picture(window), linear_b)
    assert_alike(shown(window, 0.0), side_b, steps=0)
    assert editor.document is edited
    # A is what the document of then looks like when it is open alone.
    for _ in range(3):
        editor.undo()
    assert editor.document == remembered
    wait_until_exact(window)
    expected = shown(window, 0.0)
    assert_alike(side_a, expected, steps=2)
    # And neither the first stage nor B would have passed for it.
    assert np.abs(coarse.astype(int) - expected.astype(int)).mean() > 1.0
    assert np.abs(side_b.astype(int) - expected.astype(int)).mean() > 5.0


def test_a_hidden_layer_is_seen_on_side_a(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.key(imgui.Key.c)
    for key in ("ball.0", "ball.1"):
        editor.do(SetVisible(key, False))
    wait_until_exact(window)
    assert window.run_until(lambda: editor.status.compared_exact, 60.0)
    side_a = shown(window, 1.0)
    for key in ("ball.0", "ball.1"):
        editor.do(SetVisible(key, True))
    wait_until_exact(window)
    assert_alike(shown(window, 0.0), side_a)


def test_each_side_has_its_own_intensity(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    wait_until_exact(window)
    before = shown(window, 0.0)
    window.key(imgui.Key.c)
    editor.do(SetIntensity(4.0))
    assert_alike(shown(window, 1.0), before, steps=0)
    brighter = shown(window, 0.0)
    assert brighter.mean() > before.mean() + 20.0
    # Exposure belongs to looking, not to the light: it acts on both sides.
    editor.do(SetView.of(exposure=2.0))
    assert_alike(shown(window, 1.0), brighter, steps=0)


def test_a_preview_is_called_one(window: HeadlessWindow) -> None:
    window.key(imgui.Key.c)
    early = label(window)
    wait_until_exact(window)
    assert window.run_until(lambda: window.shell.editor.status.compared_exact, 60.0)
    # The ground of the label beside the divider is wider as long as it says so.
    assert (early < 80).sum() > 2 * (label(window) < 80).sum()


def label(window: HeadlessWindow) -> np.ndarray:
    """The pixels left of the divider's upper end."""
    window.frames(2)
    x, y = window.shell.handle_position("viewport.divider")
    top = window.shell.handle_position("viewport.corner")[1]
    assert y > top
    return window.pixels()[int(top) + 8 : int(top) + 28, int(x) - 90 : int(x) - 12].min(axis=-1)
