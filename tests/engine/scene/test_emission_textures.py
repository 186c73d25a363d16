"""Parts of emitting triangles and their mean radiance, against closed forms of images."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.scene.emission_textures import barycentrics, emitting_parts, emitting_triangles_of
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import LAMBERT, camera, placed

HEAD = camera((0, 0, 3), 20, (8, 8))


@pytest.fixture
def lamp(tmp_path: Path) -> Scene:
    """A square of emission 2, 4, 8 whose image is linear in u from 0 to 1, and a plain one."""
    ramp = (np.arange(64) + 0.5) / 64
    pixels = np.repeat(np.repeat(ramp[None, :, None], 64, axis=0), 3, axis=2)
    Image.fromarray(np.uint8(np.round(255 * pixels))).save(tmp_path / "ramp.png")
    texture = 'emission_texture = { texture = "ramp.png", texture_space = "linear", texture_wrap = "clamp" }\n'
    text = placed("lamp", "quad", more="emission = [2, 4, 8]\n" + texture)
    text += placed("plain", "quad", "3,0,0,0, 0,3,0,0, 0,0,3,-1, 0,0,0,1", "emission = 1\n")
    text += placed("floor", "quad", "9,0,0,0, 0,9,0,0, 0,0,9,-2, 0,0,0,1", LAMBERT)
    (tmp_path / "scene.toml").write_text(HEAD + text)
    return load_scene(tmp_path / "scene.toml")


def test_means_of_triangles_are_those_of_the_image(lamp: Scene) -> None:
    found = emitting_triangles_of(lamp)
    # Of a ramp in u the mean over a triangle is that at its centre: thirds of the square's side.
    middles = found.corners.mean(axis=1)[:, 0] + 0.5
    for k in range(2):
        np.testing.assert_allclose(found.radiance[k], middles[k] * np.array([2, 4, 8]), rtol=0.01)
    np.testing.assert_array_equal(found.radiance[2:], 1.0)


def test_parts_have_the_radiance_of_their_places_and_all_of_the_power(lamp: Scene) -> None:
    parts = emitting_parts(lamp)
    own = lamp.object_of_triangle[parts.triangle] == 0
    assert own.sum() == 2 * 64**2 and (~own).sum() == 2
    corners = lamp.vertices[lamp.triangles[parts.triangle[own]]].astype(float)
    u, v = parts.corners[own].mean(axis=1).T
    place = corners[:, 0] + u[:, None] * (corners[:, 1] - corners[:, 0]) + v[:, None] * (corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(parts.radiance[own, 0], 2.0 * (place[:, 0] + 0.5), atol=0.03)
    # A square metre whose mean is half of the emission; the plain one has nine square metres.
    np.testing.assert_allclose(parts.area[own] @ parts.radiance[own], [1.0, 2.0, 4.0], rtol=2e-3)
    assert parts.area[~own].sum() == pytest.approx(9.0)


def test_points_of_a_part_are_found_in_it(lamp: Scene) -> None:
    parts = emitting_parts(lamp)
    generator = np.random.default_rng(1)
    shares = generator.dirichlet((1.0, 1.0, 1.0), len(parts.area))
    shares = 0.98 * shares + 0.02 / 3.0  # not on the edges
    u, v = np.einsum("nk,nki->in", shares, parts.corners)
    np.testing.assert_array_equal(parts.find(parts.triangle, u, v), np.arange(len(parts.area)))
    floor = np.flatnonzero(lamp.object_of_triangle == 2)
    assert (parts.find(floor, np.full(2, 0.3), np.full(2, 0.3)) == -1).all()


def test_barycentrics_are_those_of_places_in_a_plane() -> None:
    generator = np.random.default_rng(2)
    triangles, uv = generator.normal(size=(50, 3, 3)), generator.random((50, 4, 2))
    edges = triangles[:, 1:] - triangles[:, :1]
    places = triangles[:, :1] + np.einsum("nkc,nci->nki", uv, edges)
    np.testing.assert_allclose(barycentrics(triangles, places), uv, atol=1e-9)


def test_darkened_emitters_have_no_parts(lamp: Scene) -> None:
    dark = lamp.with_emission({"lamp": (0.0, 0.0, 0.0), "plain": (0.0, 0.0, 0.0)})
    assert not len(emitting_parts(dark).area)


def test_only_a_texture_multiplies_emission(tmp_path: Path) -> None:
    text = placed("lamp", "quad", more='emission = 1\nemission_texture = { weight = "a.png" }\n')
    (tmp_path / "scene.toml").write_text(HEAD + text)
    with pytest.raises(LoadError, match=r"weight.*keys of a texture, or vertex_colours"):
        load_scene(tmp_path / "scene.toml")
