"""Images in a mesh's second set of texture coordinates in Orbit's and Deform's shaders, against compiled code."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.project.project import Project, open_project
from tests.engine.render.test_uv_sets import USES_BOTH, card_glb, write_images
from tests.scene_text import camera, environment, placed
from tests.ui.modes.moving_pictures import deform_pictures, orbit_pictures

pytestmark = pytest.mark.gl

SIZE = 48, 48


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A matt card whose colour lies in the first set, the weights of its albedo's map and its holes in the second."""
    (tmp_path / "card.glb").write_bytes(card_glb(USES_BOTH))
    write_images(tmp_path)
    shade = 'parameter_maps.albedo = { map = "grey.png", range = [[0.2, 0.2, 0.2], [1, 1, 1]], uv_set = 1 }'
    matt = f'{{ model = "lambert", albedo = 1.0, texture = "colour.png", {shade} }}'
    images = (
        'normal_map = { file = "relief.png", uv_set = 1 }\nopacity = { mode = "mask", file = "hole.png", uv_set = 1 }\n'
    )
    text = camera((0, 0, 3), 20, SIZE, head="bounces = 1\n") + environment((0.7, 0.8, 1.0))
    (tmp_path / "scene.toml").write_text(text + placed("card", "card.glb", more=f"layer = [{matt}]\n{images}"))
    return open_project(str(tmp_path / "scene.toml"))


def assert_alike(found: np.ndarray, expected: np.ndarray) -> None:
    """Pictures (H, W, 3) that differ at edges of holes alone."""
    off = np.abs(found - expected).max(axis=2)
    assert np.quantile(off, 0.95) < 0.02 and np.median(off) < 2e-3 and expected.std() > 0.05


def test_orbits_shader(project: Project, context: moderngl.Context) -> None:
    assert_alike(*orbit_pictures(project, context, SIZE, 200)[1])


def test_deforms_shader(project: Project, context: moderngl.Context) -> None:
    assert_alike(*deform_pictures(project, context, SIZE, 200))
