"""Light as projection wants it: the cut and the patches keep their power, and every light knows its bits."""

import numpy as np
import pytest

from engine.light.emitters import emitter_tree
from engine.light.environment import Environment, constant_environment
from engine.light.triangle_lights import cut_lights
from engine.precompute.direct import lighting
from engine.precompute.direct.lighting import longest_edges, nearest_neighbours, prepare_lighting
from engine.sphere.geodesic import geodesic, locate
from engine.visibility.point_visibility import VISIBILITY_LEVEL
from tests.engine.precompute.direct.by_hand import irradiance, light_of, points_at, square


def with_a_sun() -> Environment:
    image = np.full((64, 128, 3), 0.2, np.float32)
    image[20, 30] = [4000.0, 3000.0, 2000.0]
    return Environment(image, "sun")


def lamp() -> np.ndarray:
    return square((0, 2, 0), (1, 0, 0), (0, 0, 1))


def test_power_is_kept_in_units_of_the_mean_radiance() -> None:
    cut = cut_lights(with_a_sun(), 1000, max_level=6)
    lighting = prepare_lighting(cut, None, 1.0)
    total = lighting.sky.colours.sum(axis=0, dtype=np.float64) * lighting.unit
    np.testing.assert_allclose(total, cut.power.sum(axis=0, dtype=np.float64), rtol=1e-5)
    # The mean over the sphere and the channels is 1 in these units.
    assert lighting.sky.colours.sum(dtype=np.float64) / 3 / (4 * np.pi) == pytest.approx(1.0, rel=1e-5)


def test_every_light_knows_the_bits_below_it() -> None:
    cut = cut_lights(with_a_sun(), 600, max_level=6)
    lighting = prepare_lighting(cut, None, 1.0)
    sky = lighting.sky
    coarse = cut.level <= VISIBILITY_LEVEL
    assert coarse.any() and not coarse.all() and (cut.level < VISIBILITY_LEVEL).any()
    # Coarse lights tile the level-4 triangles; each sees its centre among its own.
    centres = geodesic(VISIBILITY_LEVEL).centres
    for m in np.flatnonzero(coarse):
        below = np.arange(sky.first[m], sky.first[m] + sky.n_bits[m])
        assert len(below) == 4 ** (VISIBILITY_LEVEL - cut.level[m])
        assert (locate(centres[below], int(cut.level[m])) == cut.index[m]).all()
    # Fine lights have a direction of their own, and name the triangle it lies in.
    fine = np.flatnonzero(~coarse)
    np.testing.assert_array_equal(sky.fine[fine], np.arange(len(fine)))
    assert (sky.fine[coarse] == -1).all()
    np.testing.assert_allclose(lighting.fine_targets.positions, cut.centre[fine], atol=1e-7)
    np.testing.assert_array_equal(lighting.fine_targets.parents, locate(cut.centre[fine].astype(float), 4))


def test_with_rays_of_their_own_no_light_needs_the_sphere() -> None:
    cut = cut_lights(with_a_sun(), 200, max_level=6)
    lighting = prepare_lighting(cut, None, 1.0, own_rays=True)
    assert len(lighting.fine_targets.positions) == len(cut) and (lighting.sky.fine == np.arange(len(cut))).all()
    assert lighting.fine_targets.parents is None


def test_each_leaf_of_an_emitter_is_asked_for_at_a_place_on_its_front() -> None:
    tree = emitter_tree(lamp(), np.full((2, 3), 5.0), 64)
    lighting = prepare_lighting(None, tree, 1.0)
    assert lighting.unit == pytest.approx(5.0) and lighting.emitters.n_roots == 2
    np.testing.assert_allclose(lighting.emitters.radiance, 1.0)
    targets = lighting.emitter_targets
    np.testing.assert_allclose(targets.normals, np.tile([0, -1, 0], (64, 1)), atol=1e-7)
    assert targets.finite and len(targets.positions) == 64 and len(lighting.fine_targets.positions) == 0
    # The barycentric coordinates of every place in its leaf.
    edges = (tree.leaves.corners[:, 1:] - tree.leaves.corners[:, :1]).astype(float)
    inside = [np.linalg.lstsq(e.T, p - c, rcond=None)[0] for e, p, c in
              zip(edges, targets.positions, tree.leaves.corners[:, 0], strict=True)]  # fmt: skip
    assert np.min(inside) > 0.0 and np.sum(inside, axis=1).max() < 1.0


def test_no_light_and_a_black_one_have_unit_one() -> None:
    assert prepare_lighting(None, None, 1.0).unit == 1.0
    assert prepare_lighting(cut_lights(constant_environment(0.0), 50), None, 1.0).unit == 1.0


def test_sky_and_lamp_add_up() -> None:
    hits = points_at([[0.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    both = irradiance(hits, light_of(hits, with_a_sun(), lamp()))
    alone = irradiance(hits, light_of(hits, with_a_sun())) + irradiance(hits, light_of(hits, emitters=lamp()))
    np.testing.assert_allclose(both, alone, rtol=3e-3)


def test_a_turned_sky_lights_a_turned_plane_alike() -> None:
    # A turn by 72° maps the cut onto itself: what lit a wall before lights the turned wall now.
    turn = np.deg2rad(72.0)
    normals = [[1.0, 0.3, 0.0], [np.cos(turn), 0.3, -np.sin(turn)]]
    found = []
    for normal, rotation in zip(normals, (0.0, 72.0), strict=True):
        hits = points_at([[0.0, 0.0, 0.0]], [normal])
        found.append(irradiance(hits, light_of(hits, with_a_sun(), n_lights=600, rotation=rotation)))
    np.testing.assert_allclose(*found, rtol=2e-3)


def test_longest_edge_and_neighbours() -> None:
    triangle = np.array([[[0, 0, 0], [3, 0, 0], [0, 4, 0]]], np.float32)
    np.testing.assert_allclose(longest_edges(triangle), [5.0])
    line = np.arange(4.0)[:, None] * [1.0, 0.0, 0.0]
    neighbours = nearest_neighbours(line)
    assert [set(row[row >= 0]) for row in neighbours] == [{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}]
    assert neighbours.shape == (4, 6) and neighbours[0, 0] == 1
    assert (nearest_neighbours(line[:1]) == -1).all() and nearest_neighbours(line[:0]).shape == (0, 6)


def test_neighbours_are_the_same_by_pairs_and_by_a_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(3).normal(size=(700, 3)).astype(np.float32)
    monkeypatch.setattr(lighting, "_PAIRS_AT_ONCE", 1 << 16)  # several blocks, the last one short
    by_pairs = nearest_neighbours(points)
    monkeypatch.setattr(lighting, "TREE_PAYS_FROM", 100)
    np.testing.assert_array_equal(by_pairs, nearest_neighbours(points))
    assert (by_pairs != np.arange(700)[:, None]).all()
