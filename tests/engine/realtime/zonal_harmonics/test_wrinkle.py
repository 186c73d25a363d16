"""Wrinkles: transfer of grooves against rays in a mesh of them, and a map whose lobes correspond."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics import wrinkle
from engine.realtime.zonal_harmonics.patches import simulate_patch
from engine.realtime.zonal_harmonics.surface_details import WrinkleDetail
from engine.realtime.zonal_harmonics.transfer import cosine_directions
from engine.realtime.zonal_harmonics.wrinkle import DEEPEST, Wrinkles, add_reflections, form_factors, transfer, wrinkles
from engine.scene.surface_kinds import Wrinkles as Says
from engine.texture.pyramid import make_pyramid

CONSTANT = math.sqrt(4.0 * math.pi)  # light of radiance 1, in the constant band


@pytest.fixture(scope="module")
def small() -> Wrinkles:
    return run_to_end(wrinkles(4, 7))


def test_no_groove_is_a_flat_surface_and_a_ridge_sees_all_that_it_faces() -> None:
    flat = cosine_directions(500, 4)[1].mean(axis=0)
    assert transfer([0.0, 0.3, 0.5], 0.0, 4, 500) == pytest.approx(np.tile(flat, (3, 1)), abs=1e-12)
    assert transfer(0.5, 1.0, 4, 500)[0] == pytest.approx(flat, abs=1e-12)


def test_grooves_are_those_that_rays_find() -> None:
    """As a patch that repeats: one period of it across, 48 points."""
    x = (np.arange(48) + 0.5) / 48
    heights = np.tile(0.4 * (1.0 - np.cos(2.0 * np.pi * x)) / 2.0, (2, 1))
    by_rays = run_to_end(simulate_patch(heights, 4, n_rays=1500))[:48]
    assert transfer(x, 0.4, 4, 1500) == pytest.approx(by_rays, abs=0.02)


def test_reflections_in_grooves_are_those_that_rays_find() -> None:
    x, positions = (np.arange(48) + 0.5) / 48, np.linspace(0.0, 1.0, 63)
    heights = np.tile(0.6 * (1.0 - np.cos(2.0 * np.pi * x)) / 2.0, (2, 1))
    by_rays = run_to_end(simulate_patch(heights, 4, 0.8, 2, n_rays=1500))[:48]
    direct = transfer(positions, 0.6, 4, 1500)
    found = add_reflections(direct[:, None], np.array([0.6]), 0.8, 2)[:, 0]
    between = np.stack([np.interp(x, positions, each) for each in found.T], axis=1)
    assert between == pytest.approx(by_rays, abs=0.02)
    assert np.abs(found - direct).max() > 0.1


@pytest.mark.parametrize("depth", [0.0, 0.2, 1.0])
def test_a_groove_that_absorbs_nothing_is_as_bright_as_the_sky_around_it(depth: float) -> None:
    """A furnace: what does not see the sky sees the groove, and after many bounces all has radiance 1."""
    direct = transfer(np.linspace(0.0, 1.0, 63), depth, 1)
    assert CONSTANT * direct[:, 0] + form_factors(63, depth).sum(axis=1) == pytest.approx(1.0, abs=0.01)
    everything = add_reflections(direct[:, None], np.array([depth]), 1.0, 400)
    assert CONSTANT * everything == pytest.approx(1.0, abs=0.01)


def test_the_two_sides_of_a_groove_mirror_each_other() -> None:
    left, right = transfer([0.2], 0.7, 4), transfer([0.8], 0.7, 4)
    mirror = np.array([1 if m == 0 or (m > 0) == (m % 2 == 0) else -1 for b in range(4) for m in range(-b, b + 1)])
    assert left * mirror == pytest.approx(right, abs=3e-3)


def test_the_gradient_is_how_the_error_changes() -> None:
    rng, shapes = np.random.default_rng(2), ((3, 3, 3, 3), (3, 3, 3, 4))
    places, targets = rng.uniform(0.0, 2.0, (12, 2)), rng.normal(size=(12, 16))
    values, along = rng.normal(size=81 + 108), rng.normal(size=81 + 108)
    along[81:].reshape(shapes[1])[..., :2] = 0.0  # bands that are kept
    slope = wrinkle._error(values, targets, places, shapes)[1] @ along
    ends = [wrinkle._error(values + h * along, targets, places, shapes)[0] for h in (1e-6, -1e-6)]
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)


def test_the_map_holds_grooves_between_its_samples(small: Wrinkles) -> None:
    """As far as straight lines between 7 nodes allow: of the bands that are kept most is lost."""
    rng = np.random.default_rng(1)
    x, depth = rng.uniform(0.0, 1.0, 200), rng.uniform(0.0, 0.5, 200)
    expected = transfer(x, depth, 4)
    left = np.linalg.norm(small.at(x, depth).harmonics() - expected) / np.linalg.norm(expected)
    assert left < 0.09


def test_the_errors_are_what_lobes_leave_at_nodes_and_between(small: Wrinkles) -> None:
    node = np.linspace(0.0, 1.0, 13)
    position, depth = (each.ravel() for each in np.meshgrid(node, node * DEEPEST, indexing="ij"))
    expected = transfer(position, depth, 4)
    found = small.at(position, depth)
    left = np.linalg.norm(found.harmonics() - expected, axis=1)
    assert np.sqrt((found.errors**2).mean()) == pytest.approx(np.sqrt((left**2).mean()), rel=0.2)
    # Flat grooves are one lobe; deep ones, of which a foot sees a slit of the sky, are harder.
    assert small.errors[:, 0].max() < 0.5 * small.errors[:, -1].max() and found.relative_errors.max() < 0.5


@pytest.mark.parametrize("across", ["u", "v"])
def test_on_a_surface_their_errors_lie_across_one_coordinate(small: Wrinkles, across: str) -> None:
    grooves = WrinkleDetail(small, Says(across=across, repeats=3.0, depth=0.8))
    uvs = np.random.default_rng(1).uniform(0.0, 1.0, (20, 2))
    along = grooves.errors_at(uvs + ((0.0, 0.4) if across == "u" else (0.4, 0.0)))
    assert along == pytest.approx(grooves.errors_at(uvs)) and np.ptp(along) > 0.001


@pytest.mark.parametrize("across", ["u", "v"])
def test_grooves_are_as_deep_as_an_image_says(small: Wrinkles, across: str) -> None:
    """Flat on the left and 0.8 deep on the right: there as those of one depth."""
    image = make_pyramid(np.repeat([[0.0, 0.0, 0.8, 0.8]], 4, axis=0)[:, :, None])
    by_image = WrinkleDetail(small, Says(across=across, repeats=3.0, depth="deep.png"), image)
    left, right = (np.random.default_rng(1).uniform(low, low + 0.2, (20, 2)) for low in (0.15, 0.65))
    for uvs, depth in ((left, 0.0), (right, 0.8)):
        even = WrinkleDetail(small, Says(across=across, repeats=3.0, depth=depth))
        for name in ("low", "axes", "coefficients"):
            assert getattr(by_image.at(uvs), name) == pytest.approx(getattr(even.at(uvs), name), abs=1e-5)
        assert by_image.normals_at(uvs) == pytest.approx(even.normals_at(uvs), abs=1e-5)


def test_normals_are_those_of_the_heights(small: Wrinkles) -> None:
    """Down a slope of 45 degrees and back; across v the grooves fall along v."""
    uvs = np.array([[0.25, 0.6], [0.75, 0.6]])
    depth, half = 1.0 / math.pi, math.sqrt(0.5)
    found = WrinkleDetail(small, Says(across="u", repeats=1.0, depth=depth)).normals_at(uvs)
    assert found == pytest.approx(np.array([[-half, 0, half], [half, 0, half]]), abs=0.06)
    found = WrinkleDetail(small, Says(across="v", repeats=1.0, depth=depth)).normals_at(uvs[:, ::-1])
    assert found == pytest.approx(np.array([[0, -half, half], [0, half, half]]), abs=0.06)


def test_lobes_of_neighbours_correspond(small: Wrinkles) -> None:
    """So what is half way between them is about the mean of what they are, and not a lobe's other end."""
    across = np.einsum("hwna,hwna->hwn", small.axes[:-1], small.axes[1:])
    assert np.median(across) > 0.8


def test_positions_repeat_and_depths_have_an_end(small: Wrinkles) -> None:
    here, there = small.at([0.25, 0.25], [0.5, DEEPEST]), small.at([3.25, -1.75], [0.5, 9.0 * DEEPEST])
    assert here.harmonics() == pytest.approx(there.harmonics(), abs=1e-12)
    assert np.linalg.norm(here.axes, axis=2) == pytest.approx(1.0)
