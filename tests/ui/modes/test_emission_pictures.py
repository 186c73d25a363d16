"""Emission with textures in Orbit's and Deform's shaders, against compiled code and closed forms."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from app.project.project import open_project
from tests.engine.render.test_vertex_colours import COLOURS, card_glb
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed
from tests.ui.modes.moving_pictures import deform_pictures, orbit_pictures

pytestmark = pytest.mark.gl

SIZE = 64, 48


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Cards over a floor: a lamp that is red on its left half, an unlit one by colours of vertices, and a lamp that
    reflects as well, with holes."""
    (tmp_path / "card.glb").write_bytes(card_glb(COLOURS))
    pixels = np.zeros((32, 32, 3), np.uint8)
    pixels[:, :16, 0], pixels[:, 16:] = 255, 255
    Image.fromarray(pixels).save(tmp_path / "half.png")
    holes = np.full((4, 4, 4), 255, np.uint8)
    holes[1:3, 1:3, 3] = 0
    Image.fromarray(holes).save(tmp_path / "hole.png")
    text = camera((0.0, 0.5, 2.6), 40, SIZE, (0, 0.1, 0), "bounces = 1\n") + environment((0.7, 0.8, 1.0))
    text += placed("floor", "quad", facing_up(3, (0, -0.6, 0)), LAMBERT)
    textured = 'emission_texture = { texture = "half.png" }\n'
    for k, (shape, more) in enumerate((
        ("quad", textured), ("card.glb", "unlit = true\nemission_texture = { vertex_colours = true }\n"),
        ("quad", textured + 'opacity = { mode = "mask", file = "hole.png" }\n' + LAMBERT),
    )):  # fmt: skip
        where = f"0.7,0,0,{0.8 * (k - 1)}, 0,0.7,0,0, 0,0,0.7,0, 0,0,0,1"
        text += placed(f"card {k}", shape, where, "emission = [4, 3, 2]\n" + more)
    (tmp_path / "scene.toml").write_text(text)
    return tmp_path / "scene.toml"


def assert_alike(found: np.ndarray, expected: np.ndarray) -> None:
    """found and expected (H, W, 3), but for pixels at edges; the left card has its two colours."""
    off = np.abs(found - expected).max(axis=2)
    assert np.count_nonzero(off > 0.05) < 0.04 * off.size and np.median(off) < 2e-3
    assert found.mean() == pytest.approx(expected.mean(), rel=0.02)
    for picture in (found, expected):
        np.testing.assert_allclose(picture[18:30, 6:10], np.broadcast_to([4.0, 0.0, 0.0], (12, 4, 3)), atol=0.02)
        np.testing.assert_allclose(picture[18:30, 14:18], np.broadcast_to([4.0, 3.0, 2.0], (12, 4, 3)), atol=0.02)


def test_orbits_moving_pictures_shine_as_textures_say(scene: Path, context: moderngl.Context) -> None:
    assert_alike(*orbit_pictures(open_project(str(scene)), context, SIZE)[1])


def test_deforms_moving_pictures_shine_as_textures_say(scene: Path, context: moderngl.Context) -> None:
    assert_alike(*deform_pictures(open_project(str(scene)), context, SIZE))
