"""Holes, coverage and colours of vertices in Orbit's and Deform's shaders, against compiled code and closed forms."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from app.project.project import open_project
from engine.material.opacity import OPAQUE
from engine.precompute.direct.pipeline import Placement
from tests.engine.render.test_vertex_colours import COLOURS, card_glb
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed
from tests.ui.modes.moving_pictures import deform_pictures, orbit_pictures

pytestmark = pytest.mark.gl

SIZE = 64, 48
WHITE = '[{ model = "lambert", albedo = 1.0, vertex_colours = true }]'


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A card, whose vertices are coloured and grow opaque to the right, over a floor: of one mask, of another, and one
    that blends."""
    colours = COLOURS.copy()
    colours[:, 3] = colours[:, 0]
    (tmp_path / "card.glb").write_bytes(card_glb(colours))
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[1:3, 1:3, 3] = 0
    Image.fromarray(pixels).save(tmp_path / "hole.png")
    text = camera((0.4, 0.9, 2.4), 40, SIZE, (0, 0.1, 0), "bounces = 1\n") + environment((0.7, 0.8, 1.0))
    text += placed("floor", "quad", facing_up(3, (0, -0.6, 0)), LAMBERT)
    for k, opacity in enumerate((
        'mode = "mask", vertices = true', 'mode = "mask", file = "hole.png", repeats = [2, 1]',
        'mode = "blend", factor = 0.5',
    )):  # fmt: skip
        where = f"0.7,0,0,{0.8 * (k - 1)}, 0,0.7,0,0, 0,0,0.7,0, 0,0,0,1"
        text += placed(f"card {k}", "card.glb", where, f"layer = {WHITE}\nopacity = {{ {opacity} }}\n")
    (tmp_path / "scene.toml").write_text(text)
    return tmp_path / "scene.toml"


def assert_alike(found: np.ndarray, expected: np.ndarray, n_blended: int) -> None:
    """found and expected (H, W, 3), but for pixels at edges and those of the card that blends, which either method
    covers by chances of its own."""
    off = np.abs(found - expected).max(axis=2)
    assert np.count_nonzero(off > 0.02) < n_blended + 0.015 * off.size
    assert np.median(off) < 1e-3
    assert found.mean() == pytest.approx(expected.mean(), rel=0.02)


def test_orbits_moving_pictures_have_holes(scene: Path, context: moderngl.Context) -> None:
    project = open_project(str(scene))
    orbit, pictures = orbit_pictures(project, context, SIZE)
    assert orbit.lit is not None
    met = orbit.lit.mesh.sample_view(project.scene.description.camera, SIZE).samples.i_object
    assert_alike(*pictures, int(np.count_nonzero(met == 3)))
    opaque = project.scene.with_opacities({f"card {k}": OPAQUE for k in range(3)})
    whole = Placement(opaque).hits.object_image
    shares = [np.count_nonzero(met == 1 + k) / np.count_nonzero(whole == 1 + k) for k in range(3)]
    # Opaque right of the middle; all but 2 x 2 of 4 x 4 texels, whose edges lie half a texel inwards; a half.
    np.testing.assert_allclose(shares, [0.5, 0.75, 0.5], atol=0.08)


def test_deforms_moving_pictures_have_holes(scene: Path, context: moderngl.Context) -> None:
    project = open_project(str(scene))
    blended = int(np.count_nonzero(Placement(project.scene).hits.object_image == 3))
    assert_alike(*deform_pictures(project, context, SIZE), blended)
