"""A camera that sees no surface shows the background, in every mode: turned away by a hand, and in the scene's file."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.view_state import Viewpoint
from app.modes.registry import MODES
from app.worker.cache import ArrayCache
from app.worker.orbit_worker import OrbitWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.camera import centre_directions
from engine.light.environment import load_environment
from engine.scene.description import Camera
from tests.ui.small_scene import SCENE, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl

UP = Camera(position=(0.0, 3.0, 0.0), target=(0.0, 10.0, 0.1), fov_y=30.0)
SIZE = (24, 16)
AWAY = SCENE.replace("position = [0.4, 1.2, 2.6]", "position = [0, 3, 0]").replace(
    "target = [0, 0.45, 0]\nfov_y = 42", "target = [0, 10, 0.1]\nfov_y = 30"
)


@pytest.fixture(autouse=True)
def few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OrbitWorker, "n_points", 1000)


def shown_radiance(window: HeadlessWindow) -> np.ndarray:
    still = window.shell.source.still(window.shell.editor)
    return np.zeros((0, 0, 3)) if still is None else still.radiance


@pytest.mark.parametrize(
    "mode", [pytest.param(mode.name, marks=[pytest.mark.sweep] * (mode.name == "deform")) for mode in MODES]
)
@pytest.mark.parametrize(
    "turned", [True, pytest.param(False, marks=pytest.mark.sweep)], ids=["turned away", "opened so"]
)
def test_a_camera_that_sees_no_surface_shows_the_background(
    context: moderngl.Context, tmp_path: Path, mode: str, turned: bool
) -> None:
    scene = write_small_scene(tmp_path, SCENE if turned else AWAY)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, scene, client, resolution=SIZE, mode=mode, n_lights=40, n_bounces=1) as window:
        wait_until_exact(window)
        editor, before = window.shell.editor, shown_radiance(window)
        if turned:
            editor.camera_history.set_viewpoint(Viewpoint(UP, editor.view.resolution), "up")
            window.frames(2)
            wait_until_exact(window)
        assert "the camera sees no surface, the background alone" in editor.status.message
        sky = load_environment(tmp_path / "sky.exr")
        expected = sky.evaluate(centre_directions(UP, SIZE).reshape(-1, 3)).reshape(SIZE[1], SIZE[0], 3)
        np.testing.assert_allclose(shown_radiance(window), expected, rtol=0.02, atol=0.002)
        if turned:
            editor.camera_history.undo()
            window.frames(2)
            wait_until_exact(window)
            np.testing.assert_allclose(shown_radiance(window), before, rtol=1e-3, atol=1e-4)
