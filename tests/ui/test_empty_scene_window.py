"""An empty scene in the window: objects are added to it and all of them deleted, in every mode."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.worker.cache import ArrayCache
from app.worker.orbit_worker import OrbitWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.scene_text import camera, environment
from tests.ui.small_scene import opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow

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


def test_new_is_an_empty_scene(context: moderngl.Context, tmp_path: Path) -> None:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = write_small_scene(tmp_path, EMPTY)
    with opened_window(context, scene, client, resolution=(24, 16), n_lights=40, n_bounces=1) as window:
        exact_picture(window)
        window.key(imgui.Key.n, imgui.Key.mod_ctrl)
        exact_picture(window)
        assert window.shell.editor.document.source == "empty" and not window.shell.editor.document.objects
