"""Textures and weight maps from the scene to the window's pixels: the same picture as a still, with and without."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from app.document.commands.maps import SetMap
from app.project.project import open_project
from app.stills.stills import render_picture
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.precompute.indirect.sampling_settings import BounceSeries
from tests.scene_text import camera, environment, material, placed, scaled
from tests.ui.small_scene import linear_picture, opened_window, wait_until_exact

pytestmark = pytest.mark.gl

RED = 'model = "lambert", albedo = 0.9, texture = "red.png", texture_scale = 6'
MASKED = 'model = "lambert", albedo = 0.8, weight = "mask.png"'
REST = 'model = "phong", exponent = 10, weight = "mask.png", weight_invert = true'
SCENE = (
    camera((0, 1.2, 2.2), 40, (32, 20), (0, 0.25, 0), "bounces = 1\n")
    + environment((0.8, 0.9, 1.0))
    + placed("ground", "quad", "4,0,0,0, 0,0,1,0, 0,-4,0,0, 0,0,0,1", material(RED))
    + placed("ball", "sphere", scaled(0.8, (0, 0.4, 0)), material(MASKED, REST))
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    field = (np.indices((16, 16)) // 8).sum(axis=0) % 2
    pixels = np.where(field[..., None] == 0, (230, 40, 30), (255, 255, 255))
    Image.fromarray(pixels.astype(np.uint8)).save(tmp_path / "red.png")
    Image.fromarray(np.tile(np.arange(0, 256, 16, dtype=np.uint8), (4, 1))).save(tmp_path / "mask.png")
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(np.mean((found - expected) ** 2)) / expected.mean())


def test_the_window_shows_what_a_still_has(context: moderngl.Context, file: Path, tmp_path: Path) -> None:
    project = open_project(str(file), None, [("ground.0.texture_strength", 0.5)])
    expected = render_picture(project, lambda step: None, n_lights=200, series=BounceSeries(1))
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, file, client, n_lights=200) as window:
        wait_until_exact(window)
        whole = linear_picture(window)
        window.shell.editor.do(SetMap("ground.0", "texture_strength", 0.5))
        wait_until_exact(window)
        found = linear_picture(window)
    assert error(found, expected) < 0.03 < error(found, whole)
