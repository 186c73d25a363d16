"""Patches of detail: simulated among their copies, laid on surfaces by their texture coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics import patches
from engine.realtime.zonal_harmonics.bending_points import numbers_of, uv_axes
from engine.realtime.zonal_harmonics.patches import Patch, Slab, patch, simulate_patch
from engine.realtime.zonal_harmonics.shading import band_light, shade
from engine.realtime.zonal_harmonics.transfer import Medium
from engine.realtime.zonal_harmonics.zonal import fit
from engine.scene.primitives import quad
from engine.sphere.harmonics import basis

CONSTANT = math.sqrt(4.0 * math.pi)  # light of radiance 1, in the constant band
UP, DOWN = basis([0.0, 0.0, 1.0], 4), basis([0.0, 0.0, -1.0], 4)


@pytest.mark.parametrize("name", patches.PATTERNS)
def test_patterns_go_on_without_a_seam(name: str) -> None:
    """No step across an edge is larger than the largest inside."""
    height = patches.PATTERNS[name](64)
    assert height.shape == (64, 64) and np.isfinite(height).all() and height.min() >= 0.0 and np.ptp(height) > 0.02
    for axis in (0, 1):
        inside = np.abs(np.diff(height, axis=axis)).max()
        across = np.abs(np.take(height, 0, axis) - np.take(height, -1, axis)).max()
        assert across <= inside + 1e-12


def test_pictures_become_heights_by_their_brightness() -> None:
    grey = np.array([[0.0, 0.5], [1.0, 0.25]])
    assert patches.heights_of_image(grey, 0.2) == pytest.approx(0.2 * grey)
    assert patches.heights_of_image(np.repeat(grey[:, :, None], 3, axis=2), 0.2) == pytest.approx(0.2 * grey)
    assert (patches.heights_of_image(np.full((2, 2), 7.0)) == 0.0).all()
    with pytest.raises(ValueError, match="expected finite"):
        patches.heights_of_image([[np.nan]])


def test_a_flat_patch_is_a_cosine() -> None:
    vectors = run_to_end(simulate_patch(np.zeros((8, 8)), 4, n_rays=500))
    assert vectors == pytest.approx(np.broadcast_to(_cosine(500), vectors.shape), abs=1e-9)


def _cosine(n_rays: int) -> np.ndarray:
    from engine.realtime.zonal_harmonics.transfer import cosine_directions

    return np.asarray(cosine_directions(n_rays, 4)[1].mean(axis=0))


def test_a_groove_is_dark_at_its_foot_and_lighter_by_what_it_reflects() -> None:
    """A saw across u of 45 degrees, which repeats without an end: beside its feet a wall sees little more than half."""
    saw = np.tile(np.abs((np.arange(32) + 0.5) / 32 - 0.5), (4, 1))
    dark = CONSTANT * run_to_end(simulate_patch(saw, 3, n_rays=800)).reshape(4, 32, 9)[:, :, 0]
    light = CONSTANT * run_to_end(simulate_patch(saw, 3, 0.8, 2, n_rays=800)).reshape(4, 32, 9)[:, :, 0]
    assert dark[:, [14, 17]].max() < 0.65 and dark[:, [1, 30]].min() > 0.8
    assert (light > dark)[:, 4:28].all() and light.max() < 1.0
    assert dark[:, ::-1] == pytest.approx(dark, abs=0.03)  # the same on both sides
    assert dark == pytest.approx(np.tile(dark[:1], (4, 1)), abs=0.03)  # and along the groove


def test_the_wall_of_a_groove_faces_where_it_leans_in_the_axes_of_the_surface() -> None:
    """u grows to the right: walls left of the foot, where height falls with u, look to +u."""
    saw = np.tile(np.abs((np.arange(32) + 0.5) / 32 - 0.5), (4, 1))
    vectors = run_to_end(simulate_patch(saw, 3, n_rays=300)).reshape(4, 32, 9)
    towards_u, towards_v = -vectors[:, :, 3], -vectors[:, :, 1]  # the linear band goes by -x and -y
    assert (towards_u[:, 2:12] > 0.05).all() and (towards_u[:, 20:30] < -0.05).all()
    assert np.abs(towards_v).max() < 0.03
    turned = run_to_end(simulate_patch(saw.T, 3, n_rays=300)).reshape(32, 4, 9)
    # rows go down, v goes up: height falls with growing row, that is, rises with v
    assert (-turned[2:12, :, 1] < -0.05).all() and (-turned[20:30, :, 1] > 0.05).all()


def test_light_comes_through_where_a_slab_is_thin() -> None:
    steps = np.zeros((16, 16))
    steps[:, 8:] = 0.4
    slab = Slab(Medium(12.0, 0.5), 0.1)
    vectors = run_to_end(simulate_patch(steps, 4, slab=slab, n_rays=300)).reshape(16, 16, 16)
    thin, thick = vectors[:, 3:5].mean(axis=(0, 1)), vectors[:, 11:13].mean(axis=(0, 1))
    assert thin @ DOWN > 3.0 * (thick @ DOWN) > 0.0
    assert thin @ UP > 0.0 and CONSTANT * thin[0] < 2.0
    with pytest.raises(ValueError, match="a slab 0.1 thick, expected more than 0.2"):
        run_to_end(simulate_patch(steps - 0.2, 4, slab=slab, n_rays=10))


@pytest.mark.parametrize("odd", [np.zeros(4), np.zeros((1, 4)), np.full((4, 4), np.nan)])
def test_maps_that_are_none_are_refused(odd: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected a map of finite ones"):
        run_to_end(simulate_patch(odd, 4))


def some_patch() -> Patch:
    vectors = np.tile(_cosine(500), (6, 1))
    vectors[:, 0] = np.arange(6)
    return patch(run_to_end(fit(vectors, 3)), np.zeros((2, 3)))


def test_texels_are_found_where_pictures_have_them_and_repeat() -> None:
    """Row 0 at the top, v upwards; between texels by even steps, also across the edge."""
    looked_up = some_patch().at(
        [[1 / 6, 0.75], [0.5, 0.75], [5 / 6, 0.25], [1 / 6 - 3.0, 7.75], [1 / 3, 0.75], [0, 0.75]]
    )
    assert looked_up.low[:, 0] == pytest.approx([0.0, 1.0, 5.0, 0.0, 0.5, 1.0])
    assert looked_up.axes.shape == (6, 3, 3) and looked_up.coefficients.shape == (6, 3, 4)


def uv_frames(positions: np.ndarray, triangles: np.ndarray, uvs: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """At the corners of triangles (T, 3, 3, 3)."""
    return uv_axes(positions, triangles, uvs, frames)[numbers_of(triangles, uvs)]


def test_axes_follow_texture_coordinates() -> None:
    mesh = quad()
    frames = np.tile(np.eye(3), (4, 1, 1))
    assert mesh.uvs is not None
    plain = uv_frames(mesh.vertices, mesh.triangles, mesh.uvs, frames)
    assert plain == pytest.approx(np.broadcast_to(np.eye(3), plain.shape))
    quarter = np.stack([mesh.uvs[:, :, 1], -mesh.uvs[:, :, 0]], axis=2)  # u is what v was: it runs upwards
    assert uv_frames(mesh.vertices, mesh.triangles, quarter, frames)[0, 0] == pytest.approx(
        np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    )
    mirrored = mesh.uvs * np.array([-1, 1], np.float32)
    found = uv_frames(mesh.vertices, mesh.triangles, mirrored, frames)
    assert found == pytest.approx(np.broadcast_to(np.diag([-1.0, 1.0, 1.0]), found.shape))  # left-handed
    turn = Rotation.from_euler("xyz", [0.3, -1.0, 2.0]).as_matrix()
    carried = uv_frames(mesh.vertices @ turn.T, mesh.triangles, mirrored, frames @ turn.T)
    assert carried == pytest.approx(found @ turn.T)


def test_a_seam_between_mirrored_halves_keeps_both_sides_axes() -> None:
    vertices = np.array([[-1.0, 0, 0], [0, 0, 0], [0, 1.0, 0], [1.0, 0, 0]])
    triangles = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    uvs = np.abs(vertices[triangles][:, :, :2]).astype(np.float32)
    found = uv_frames(vertices, triangles, uvs, np.tile(np.eye(3), (4, 1, 1)))
    assert found[0, :, 0] == pytest.approx(np.tile([-1.0, 0, 0], (3, 1)))
    assert found[1, :, 0] == pytest.approx(np.tile([1.0, 0, 0], (3, 1)))


@pytest.mark.parametrize("spoil", ["points", "coordinates", "both"])
def test_triangles_without_an_area_leave_the_vertices_own_axes(spoil: str) -> None:
    mesh = quad()
    assert mesh.uvs is not None
    places = mesh.vertices * (0.0 if spoil != "coordinates" else 1.0)
    uvs = mesh.uvs * np.float32(0.0 if spoil != "points" else 1.0)
    frames = np.asarray(Rotation.random(4, random_state=1).as_matrix())
    found = uv_frames(places, mesh.triangles, uvs, frames)
    assert found == pytest.approx(frames[mesh.triangles], abs=1e-9)


def test_a_mirrored_patch_is_lit_from_its_mirrored_side() -> None:
    """Light from +x on a wall that faces +u: where u runs along -x it looks away."""
    vectors = np.zeros((4, 4))
    vectors[:, 3] = -1.0  # x
    wall = patch(run_to_end(fit(vectors, 3)), np.zeros((2, 2))).at(np.full((2, 2), 0.5))
    light = np.zeros((4, 3))
    light[3] = -1.0
    axes = np.stack([np.eye(3), np.diag([-1.0, 1.0, 1.0])])
    assert shade(wall, axes, band_light(light))[:, 0] == pytest.approx([1.0, -1.0])
