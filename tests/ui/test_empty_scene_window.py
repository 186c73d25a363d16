"""An empty scene in the window: objects are added to it and all of them deleted, in every mode."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import OpenEXR
import pytest
from imgui_bundle import imgui
from PIL import Image

import insitu
from app.operators.script import load_script
from app.worker.cache import ArrayCache
from app.worker.orbit_worker import OrbitWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.scene_text import camera, environment
from tests.ui.small_scene import opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.script_runner import ScriptError, run_steps

pytestmark = pytest.mark.gl

EMPTY = camera((0.0, 0.5, 3.0), 40, (24, 16)) + environment(radiance=[0.2, 0.4, 0.6])


def exact_picture(window: HeadlessWindow) -> np.ndarray:
    window.frames(3)
    wait_until_exact(window)
    assert not window.shell.editor.status.is_error, window.shell.editor.status
    still = window.shell.source.still(window.shell.editor)
    assert still is not None
    return still.radiance


@pytest.mark.parametrize("mode", ["placement", "orbit", "deform"])
def test_an_object_comes_and_goes(
    context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    monkeypatch.setattr(OrbitWorker, "n_points", 1000)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = write_small_scene(tmp_path, EMPTY)
    with opened_window(context, scene, client, resolution=(24, 16), mode=mode, n_lights=40, n_bounces=1) as window:
        bare = exact_picture(window)
        np.testing.assert_allclose(bare.reshape(-1, 3), np.tile((0.2, 0.4, 0.6), (24 * 16, 1)), rtol=2e-3)
        editor = window.shell.editor
        window.key(imgui.Key.a, imgui.Key.mod_shift)
        window.frames(2)
        window.click_handle("menu.add_sphere")
        assert window.run_until(lambda: not editor.exchange.is_reading, 60.0)
        with_ball = exact_picture(window)
        assert [state.name for state in editor.document.objects] == ["sphere"]
        assert np.abs(with_ball - bare).max() > 0.05
        window.key(imgui.Key.delete, imgui.Key.mod_ctrl)
        np.testing.assert_allclose(exact_picture(window), bare, rtol=2e-3)
        assert not editor.document.objects and editor.scene_is_open
        window.key(imgui.Key.z, imgui.Key.mod_ctrl)
        np.testing.assert_allclose(exact_picture(window), with_ball, rtol=2e-3, atol=1e-4)
        window.key(imgui.Key.z, imgui.Key.mod_ctrl)
        np.testing.assert_allclose(exact_picture(window), bare, rtol=2e-3)


def test_a_script_saves_and_exports_what_it_made(context: moderngl.Context, tmp_path: Path) -> None:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene, script = write_small_scene(tmp_path, EMPTY), tmp_path / "steps.toml"
    script.write_text("""
[[step]]
add = {shape = "sphere", name = "ball"}
[[step]]
wait = "exact"
[[step]]
picture = "ball.png"
[[step]]
picture = "ball.exr"
[[step]]
save_as = "ball.insitu"
[[step]]
save_scene = "ball.insitu.zip"
[[step]]
export_scene = "mitsuba"
""")
    with opened_window(context, scene, client, resolution=(24, 16), n_lights=40, n_bounces=1) as window:
        steps = load_script(script)
        run_steps(window, window.shell.editor, steps)
        shown = exact_picture(window)
        with pytest.raises(ScriptError, match=r"ball\.insitu\.zip: is there already"):  # nothing is overwritten unasked
            run_steps(window, window.shell.editor, steps[5:6])
    for made in ("ball.insitu", "ball.insitu.zip"):
        np.testing.assert_allclose(insitu.open(tmp_path / made).image(bounces=1), shown, rtol=0.12)  # 40 lights
    stored = OpenEXR.File(str(tmp_path / "ball.exr")).channels()["RGB"].pixels
    np.testing.assert_allclose(stored, shown, rtol=2e-3, atol=1e-3)
    with Image.open(tmp_path / "ball.png") as image:
        assert image.size == (24, 16)
    assert (tmp_path / "mitsuba" / "scene.xml").exists()


def test_new_is_an_empty_scene(context: moderngl.Context, tmp_path: Path) -> None:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = write_small_scene(tmp_path, EMPTY)
    with opened_window(context, scene, client, resolution=(24, 16), n_lights=40, n_bounces=1) as window:
        exact_picture(window)
        window.key(imgui.Key.n, imgui.Key.mod_ctrl)
        exact_picture(window)
        assert window.shell.editor.document.source == "empty" and not window.shell.editor.document.objects
