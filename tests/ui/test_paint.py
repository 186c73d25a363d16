"""The brush in the window: on and off, strokes by the mouse, its keys, and the same from a script."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetParameter
from app.operators.script import load_script
from engine.scene.surface_spot import SurfaceSpot
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.panels.actions import SaveMaterial
from ui.scene_view import stroke_at
from ui.script_runner import ScriptError, run_steps

pytestmark = pytest.mark.gl


def strokes(window: HeadlessWindow, key: str = "teapot.0") -> tuple:
    return window.shell.editor.document.layer(key).maps.strokes.strokes


def place(window: HeadlessWindow, column: float, row: float) -> tuple[float, float]:
    """Where on screen a pixel of the picture is."""
    x, y = window.shell.handle_position("viewport.corner")
    centre, middle = window.shell.handle_position("viewport.centre")
    scale = max(2 * (centre - x) / WIDTH, 2 * (middle - y) / HEIGHT)
    return x + column * scale, y + row * scale


@pytest.fixture
def brush(window: HeadlessWindow) -> HeadlessWindow:
    """The window with the brush on the teapot's base, which fills the first twelve columns of the picture."""
    window.shell.editor.select("teapot.0")
    window.frames(4)
    window.click_handle("material.images.0")
    window.frames(2)
    window.click_handle("material.paint.0")
    window.frames(2)
    assert window.shell.state.paints
    return window


def test_drags_paint_keys_size_the_brush_and_escape_ends_it(brush: HeadlessWindow) -> None:
    window, history = brush, brush.shell.editor.history
    n_steps = len(history.undo_steps)
    window.drag(place(window, 3, 8), place(window, 9, 20))
    (stroke,) = strokes(window)
    # A map that was white all over: the brush takes away. At 4 m a pixel of the 32 is 2 · 4 tan 20° / 32 of a metre.
    assert stroke.value == 0.0 and stroke.radius == pytest.approx(24 * 8 * 0.36397 / 32, rel=0.05)
    assert stroke.n_dabs > 2 and len(history.undo_steps) == n_steps + 1
    window.hold(imgui.Key.mod_alt, True)
    window.drag(place(window, 3, 8), place(window, 9, 8))
    window.hold(imgui.Key.mod_alt, False)
    assert strokes(window)[1].value == 1.0
    window.drag(place(window, 16, 8), place(window, 22, 20))  # over the tray, which is not selected
    assert len(strokes(window)) == 2 and len(history.undo_steps) == n_steps + 2
    assert window.shell.editor.view.selected.object == "teapot"
    window.shell.editor.undo()
    window.shell.editor.undo()
    assert strokes(window) == ()
    exposure, radius = window.shell.editor.view.exposure, window.shell.state.brush.radius
    window.key(imgui.Key.right_bracket)
    assert window.shell.state.brush.radius > radius and window.shell.editor.view.exposure == exposure
    window.key(imgui.Key.left_bracket)
    assert window.shell.state.brush.radius == pytest.approx(radius)
    window.key(imgui.Key.escape)
    assert not window.shell.state.paints and window.shell.editor.view.selected is not None
    window.drag(place(window, 3, 8), place(window, 9, 20))
    assert strokes(window) == ()  # a click selects again


def test_an_even_map_and_its_clearing(brush: HeadlessWindow) -> None:
    window, editor = brush, brush.shell.editor
    window.click_handle("button.fold.light")  # so that the whole material panel is on screen
    window.frames(2)
    window.click_handle("material.weight_start.1")
    window.frames(2)
    assert editor.document.layer("teapot.0").maps.weight_start == 0.0 and not window.shell.state.brush.erases
    window.drag(place(window, 3, 8), place(window, 4, 8))
    assert strokes(window)[0].value == 1.0
    window.click_handle("material.blend")
    window.frames(2)
    window.click_handle("material.blend.coat")
    window.frames(2)
    assert strokes(window, "teapot.1") == strokes(window)
    window.shell.do(SaveMaterial("teapot", "Painted"))
    assert "without the strokes" in editor.status.message
    assert all(layer.maps.is_plain for layer in window.shell.actor.library.entry("Painted").material.layers)
    window.click_handle("button.clear_weight")
    assert editor.document.layer("teapot.0").maps.is_plain


def test_a_script_paints(window: HeadlessWindow, tmp_path: Path) -> None:
    step = '[[step]]\npaint = {{ layer = "{}", points = [{}], radius = 2, value = 0.5 }}\n'
    (tmp_path / "a.toml").write_text(step.format("teapot.base", "[3, 8], [9, 20], [40, 20]"))
    run_steps(window, window.shell.editor, load_script(tmp_path / "a.toml"))
    (stroke,) = strokes(window)
    assert stroke.value == 0.5 and (stroke.array[:, 5] == 1.0).all()
    (tmp_path / "b.toml").write_text(step.format("teapot.base", "[40, 8]"))
    with pytest.raises(ScriptError, match="no point of the stroke"):
        run_steps(window, window.shell.editor, load_script(tmp_path / "b.toml"))
    window.shell.editor.do(SetParameter("teapot.0", "albedo", 0.3))
    assert len(strokes(window)) == 1


def test_a_stroke_far_from_the_origin_is_exact_to_a_twentieth_of_a_millimetre() -> None:
    place, up = np.array([500_000.3, 4_600_000.12345, -0.2]), np.array([0.0, 0.0, 1.0])
    stroke = stroke_at([SurfaceSpot(place, up, 0.01)] * 2, 0.1, 1.0, 1.0, 0.5)
    found = stroke.array[:, :3].astype(np.float64) + stroke.origin
    np.testing.assert_allclose(found, [place, place], rtol=0.0, atol=5e-5)
    assert stroke_at([SurfaceSpot(np.array([1.0, -2.0, 300.0]), up, 0.01)], 0.1, 1.0, 1.0, 0.5).origin == (
        0.0,
        0.0,
        0.0,
    )
