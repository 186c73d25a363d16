"""Emitters as points cut them: irradiance in closed form, shadows' edges, and what must not matter."""

from __future__ import annotations

import numpy as np
import pytest

from engine.light.emitters import emitter_tree
from engine.precompute.direct._emitter_kernels import Around
from engine.precompute.direct._near_kernels import _mark_edges
from engine.precompute.direct.lighting import BESIDE, prepare_lighting
from engine.precompute.direct.near_leaves import MOST, NearLeaves, near_leaves
from engine.visibility.point_visibility import brute_force_visibility
from tests.engine.precompute.direct.by_hand import NOWHERE, caster_of, irradiance, light_of, points_at, square

UP = np.array([[0.0, 1.0, 0.0]])
ORIGIN = np.zeros((1, 3))
LAMP = square((0, 1, 0), (1, 0, 0), (0, 0, 1))
BELOW = 0.752275  # of the unit square at height 1, straight below: E / L
HALF_SCREEN = square((-5, 0.5, 0), (10, 0, 0), (0, 0, 20))  # hides the lamp's half x < 0 from the origin


def polygon_irradiance(polygon: np.ndarray, place: np.ndarray, normal: np.ndarray) -> float:
    """E / L of a polygon (K, 3) above the horizon by Lambert's formula: half the sum of its edges' angles, each times
    the cosine of its plane to the normal."""
    unit = polygon - place
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(unit, np.roll(unit, -1, axis=0), strict=True):
        across = np.cross(a, b)
        total += np.arctan2(np.linalg.norm(across), a @ b) * float(across @ normal) / np.linalg.norm(across)
    return abs(total) / 2.0


def near_of(places: np.ndarray, blockers: np.ndarray, n_leaves: int = 256) -> tuple[NearLeaves, np.ndarray]:
    """What points that face up know of the lamp's leaves from nearby, and the leaves' middles by node."""
    hits, caster = points_at(places, UP), caster_of(blockers)
    tree = emitter_tree(LAMP, np.ones((2, 3)), n_leaves)
    lighting, rows = prepare_lighting(None, tree, 0.5), np.arange(len(places))
    seen = brute_force_visibility(hits, caster, lighting.emitter_targets, rows)
    return near_leaves(hits, caster, lighting.emitters, seen, rows), tree.corners.mean(axis=1)


def test_any_triangles_bring_what_lamberts_formula_says() -> None:
    random = np.random.default_rng(3)
    for _ in range(8):
        middle = random.uniform([-2.0, 1.0, -2.0], [2.0, 3.0, 2.0])
        triangle = middle + random.uniform(-0.9, 0.9, (3, 3))
        if np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]) @ triangle[0] > 0.0:
            triangle = triangle[::-1]
        for n_leaves in (1, 40):
            found = irradiance(points_at(ORIGIN, UP), light_of(points_at(ORIGIN, UP), emitters=triangle[None],
                               n_patches=n_leaves))[0, 0]  # fmt: skip
            assert found == pytest.approx(polygon_irradiance(triangle.copy(), ORIGIN[0], UP[0]), rel=3e-3)


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e6])
def test_size_does_not_matter(size: float) -> None:
    hits = points_at(ORIGIN, UP, lift=1e-6 * size)
    found = irradiance(hits, light_of(hits, emitters=LAMP * size))
    np.testing.assert_allclose(found, BELOW, rtol=1e-3)


def test_a_tiny_lamp_far_away_shines_by_its_area() -> None:
    # E = L A cos / d² of a square of a millimetre at ten metres.
    hits = points_at(ORIGIN, UP)
    lamp = square((6, 8, 0), (1e-3, 0, 0), (0, 0, 1e-3))
    assert irradiance(hits, light_of(hits, emitters=lamp))[0, 0] == pytest.approx(1e-6 * 0.8 * 0.8 / 100.0, rel=2e-3)


def test_light_adds_up_and_grows_with_radiance() -> None:
    lamps = [LAMP, square((1.5, 1.2, 0.4), (0.3, 0, 0), (0, 0, 0.2)), square((-1, 0.7, 0), (0.1, 0, 0), (0, 0, 0.5))]
    places = np.random.default_rng(1).uniform([-1, 0, -1], [1, 0, 1], (12, 3))
    hits = points_at(places, UP)
    together = irradiance(hits, light_of(hits, emitters=np.concatenate(lamps)))
    alone = sum(irradiance(hits, light_of(hits, emitters=lamp)) for lamp in lamps)
    np.testing.assert_allclose(together, alone, rtol=3e-3)
    tree = [emitter_tree(LAMP, np.full((2, 3), radiance), 64) for radiance in (1.0, 7.0)]
    one, seven = (prepare_lighting(None, each, 0.5) for each in tree)
    assert seven.unit == pytest.approx(7.0 * one.unit)
    np.testing.assert_array_equal(one.emitters.radiance, seven.emitters.radiance)


def test_no_emitter_is_dark() -> None:
    hits = points_at(ORIGIN, UP)
    assert irradiance(hits, light_of(hits)).max() == 0.0


@pytest.mark.parametrize("place", [(0.0, 1.0, 0.0), (0.5, 1.0, 0.5), (3.0, 1.0, 0.0)], ids=["on", "corner", "beside"])
@pytest.mark.parametrize("normal", [(0, 1, 0), (0, -1, 0), (1, 0, 0)])
def test_an_emitter_is_dark_in_its_own_plane(place: tuple[float, ...], normal: tuple[float, ...]) -> None:
    hits = points_at(np.array([place]), np.array([normal]))
    assert irradiance(hits, light_of(hits, emitters=LAMP)).max() < 1e-3


def test_an_emitter_that_is_seen_edge_on_fades_to_nothing() -> None:
    # Of a lamp from 2 m aside, h below its plane: Lambert's formula, down to where nothing is left of it.
    heights = np.array([0.1, 0.01, 1e-3])
    places = np.stack([0 * heights + 2.0, 1.0 - heights, 0 * heights], axis=1)
    hits = points_at(places, np.array([[-1.0, 0.0, 0.0]]))
    corners = np.array([[-0.5, 1, -0.5], [0.5, 1, -0.5], [0.5, 1, 0.5], [-0.5, 1, 0.5]])
    expected = [polygon_irradiance(corners, place, np.array([-1.0, 0.0, 0.0])) for place in places]
    np.testing.assert_allclose(irradiance(hits, light_of(hits, emitters=LAMP))[:, 0], expected, rtol=5e-3)


def test_right_below_an_emitter_it_fills_the_sky() -> None:
    hits = points_at(np.array([[0.1, 1.0 - 1e-4, -0.2]]), UP, lift=1e-7)
    np.testing.assert_allclose(irradiance(hits, light_of(hits, emitters=LAMP)), np.pi, rtol=5e-3)


def test_of_a_lamp_half_hidden_a_point_gets_half() -> None:
    hits = points_at(ORIGIN, UP)
    np.testing.assert_allclose(
        irradiance(hits, light_of(hits, emitters=LAMP, blockers=HALF_SCREEN)), BELOW / 2, rtol=0.02
    )


def test_a_shadows_edge_follows_lamberts_formula() -> None:
    # The screen at half height ends above x = 0: from (x, 0, 0) it hides the lamp up to -x.
    x = np.linspace(-0.6, 0.6, 61)
    hits = points_at(np.stack([x, 0 * x, 0 * x], axis=1), UP)
    found = irradiance(hits, light_of(hits, emitters=LAMP, blockers=HALF_SCREEN))[:, 0]
    expected = np.zeros(len(x))
    for i, edge in enumerate(np.clip(-x, -0.5, 0.5)):
        seen = np.array([[edge, 1, -0.5], [0.5, 1, -0.5], [0.5, 1, 0.5], [edge, 1, 0.5]])
        if edge < 0.5:
            expected[i] = polygon_irradiance(seen, np.array([x[i], 0.0, 0.0]), UP[0])
    assert np.abs(found - expected).max() < 0.02 * BELOW
    assert found.mean() == pytest.approx(expected.mean(), rel=3e-3)


def test_rays_of_its_own_go_to_leaves_along_a_shadows_edge_alone() -> None:
    near, middles = near_of(np.array([[0.021, 0.0, 0.0]]), HALF_SCREEN)
    assert 0 < len(near.node) <= MOST
    # With 256 leaves of 1/16 m none is farther than two from where the screen's edge parts what is seen, x = -0.02.
    assert np.abs(middles[near.node][:, 0]).max() < 2 / 16
    assert (np.abs(near.delta) <= 1.0).all() and near.delta.all()  # what a bit says already is not kept
    assert 0 < near.delta.max() < 1 and len(near_of(ORIGIN, NOWHERE)[0].node) == 0


def test_leaves_are_marked_as_one_by_one() -> None:
    """Twin: each leaf asks its neighbours in turn, and whether it is large."""
    lamps = np.concatenate([LAMP, square((3, 1, 0), (0.2, 0, 0), (0, 0, 0.3))])
    leaves = prepare_lighting(None, emitter_tree(lamps, np.ones((4, 3)), 300), 0.5).emitters.leaves
    n, random, near = len(leaves.node), np.random.default_rng(5), np.float32(0.2)
    assert n > 128 and n % 64
    middles = leaves.ball[:, :3].astype(np.float64)
    beside = [[m for m in range(n) if leaf_bit(leaves.beside, leaf, m)] for leaf in range(n)]
    assert {len(each) for each in beside} == {BESIDE}
    for place, share in zip(
        random.uniform([-1, -1, -1], [4, 0.95, 1], (24, 3)), np.tile([0, 0.02, 0.5, 1], 6), strict=True
    ):
        seen = random.random(n) < share
        seen[: n // 2] |= middles[: n // 2, 0] > 0.1 * place[0]  # an edge of a shadow
        bits = np.zeros(64 * -(-n // 64), np.uint8)
        bits[:n] = seen
        words = np.packbits(bits, bitorder="little").view(np.uint64)
        shares, marked = np.empty(4, np.float32), np.empty(len(words), np.uint64)
        _mark_edges(words, leaves, place.astype(np.float32), near, shares, marked)
        large = leaves.ball[:, 3] > near**2 * ((middles - place) ** 2).sum(axis=1)
        parted = np.array([0 < seen[each].sum() < len(each) for each in beside])
        np.testing.assert_array_equal(np.unpackbits(marked.view(np.uint8), bitorder="little")[:n] > 0, parted | large)
        np.testing.assert_allclose(shares, np.bincount(leaves.root, leaves.part * seen, 4), rtol=1e-5)


def leaf_bit(around: Around, i: int, leaf: int) -> bool:
    """Whether a leaf is among those of thing i."""
    own = slice(around.start[i], around.start[i + 1])
    masks = dict(zip(around.word[own].tolist(), around.mask[own].tolist(), strict=True))
    return bool(masks.get(leaf >> 6, 0) >> (leaf & 63) & 1)


def test_a_point_never_asks_for_more_than_so_many_leaves() -> None:
    lattice = [
        square((x, 0.5, z), (0.05, 0, 0), (0, 0, 0.05)) for x in np.arange(-1, 1, 0.1) for z in np.arange(-1, 1, 0.1)
    ]
    near, _ = near_of(np.array([[0.0, 0.0, 0.0], [0.2, 0.9, 0.1]]), np.concatenate(lattice), 1024)
    assert np.diff(near.start).max() <= MOST


def test_what_a_railing_leaves_of_a_lamp_does_not_hang_on_the_rarer_leaves() -> None:
    # Bars that hide an eighth of a lamp, each narrower than a leaf. Where leaves whose bit differs from all around them
    # got rays of their own, it was too bright: a leaf that is hidden was looked at more often than one that is seen.
    x = np.arange(-1.0, 1.0, 0.08)
    bars = np.concatenate([square((left, 0.5, 0), (0.01, 0, 0), (0, 0, 4)) for left in x])
    places = np.stack([np.linspace(-0.2, 0.2, 200), np.zeros(200), np.zeros(200)], axis=1)
    hits = points_at(places, UP)
    behind, free = (
        irradiance(hits, light_of(hits, emitters=LAMP, n_patches=256, **given))[:, 0].mean()
        for given in ({"blockers": bars}, {})
    )
    assert behind / free == pytest.approx(7 / 8, rel=0.015)  # 0.042 off by that
