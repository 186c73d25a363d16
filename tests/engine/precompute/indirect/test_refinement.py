"""Where the gather points of a picture lie, and where it gets more of them and of their sample sets."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.precompute.indirect import smoothing
from engine.precompute.indirect._ray_kernels import NORMAL
from engine.precompute.indirect.indirect_light import GatherPoints, IndirectLight
from engine.precompute.indirect.refinement import COARSEST, Lattice, Refinement, coarsest_of, count_by_shape
from engine.precompute.indirect.smoothing import GLOSSY_TURN
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve

HITS = placement_of(CORNER, **CORNER_VIEW, n=192).hits
OBJECTS = HITS.object_image.ravel()[HITS.pixel]
MATT = np.zeros(len(CORNER), bool)
FAR = np.full(len(HITS.pixel), np.inf, np.float32)


def refined(values: np.ndarray, noise: float = 0.0, clearance: np.ndarray = FAR) -> Lattice:
    lattice, turns = Lattice(HITS, MATT), 0
    lattice.missing_rows()
    while lattice.refine(values, np.full_like(values, noise), clearance):
        lattice.missing_rows()
        turns += 1
        assert turns <= 4
    return lattice


def test_a_smooth_picture_needs_few_points_and_is_kept():
    values = (HITS.position @ np.array([0.02, 0.01, 0.03], np.float32) + 1.0)[:, None]
    lattice = refined(values)
    rows, weights = lattice.footprint()
    assert len(lattice.rows) < 0.25 * len(HITS.pixel)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-5)
    kept = (values[lattice.rows][rows, 0] * weights).sum(axis=1)
    np.testing.assert_allclose(kept, values[:, 0], atol=0.01)


def test_nothing_bleeds_over_an_edge():
    lattice = refined(np.ones((len(HITS.pixel), 1)))
    rows, weights = lattice.footprint()
    other = OBJECTS[lattice.rows[rows]] != OBJECTS[:, None]
    assert not weights[other].any()
    assert len(lattice.rows) > len(HITS.pixel) / COARSEST**2


def test_a_step_is_found():
    y, x = np.divmod(HITS.pixel, HITS.resolution[0])
    values = np.where(x > 120.5, 2.0, 1.0)[:, None]
    lattice = refined(values)
    rows, weights = lattice.footprint()
    kept = (values[lattice.rows][rows, 0] * weights).sum(axis=1)
    assert np.mean(np.abs(kept - values[:, 0]) > 0.3) < 0.01


def test_where_something_is_near_every_pixel_is_a_point():
    # Next to a wall's foot the clearance grows as the distance from it does.
    even, foot = np.ones((len(HITS.pixel), 1)), HITS.position[:, 0] - HITS.position[:, 0].min()
    on_floor = OBJECTS == 0
    lattice = refined(even, clearance=np.where(on_floor, foot, np.inf).astype(np.float32))
    known = np.isin(np.arange(len(foot)), lattice.rows)
    near, far = on_floor & (foot < 0.1), on_floor & (foot > 1.5)
    assert near.sum() > 20 and known[near].all()
    assert known[far].mean() < 0.5


def test_beside_an_edge_every_pixel_stands_for_itself():
    rows, weights = (lattice := refined(np.ones((len(HITS.pixel), 1)))).footprint()
    objects = HITS.object_image
    beside = np.zeros(objects.shape, bool)
    beside[:, :-1] |= objects[:, 1:] != objects[:, :-1]
    own = np.flatnonzero(beside.ravel()[HITS.pixel])
    assert len(own) > 50
    says = (weights * (lattice.rows[rows] == np.arange(len(rows))[:, None])).sum(axis=1)
    np.testing.assert_allclose(says[own], 1.0, rtol=1e-5)


@pytest.mark.parametrize(("height", "coarsest"), [(24, 1), (36, 1), (72, 2), (96, 4), (192, 8), (1080, 8)])
def test_blocks_of_a_small_picture_are_small(height, coarsest):
    assert coarsest_of(height) == coarsest


def test_noise_is_no_reason_for_more_points():
    even = np.ones((len(HITS.pixel), 1))
    noisy = even + np.random.default_rng(1).normal(0.0, 0.3, even.shape)
    fewest = len(refined(even).rows)
    assert len(refined(noisy, noise=0.3).rows) < 1.15 * fewest
    assert len(refined(noisy).rows) > 1.5 * fewest


def test_a_groove_between_corners_that_are_alike_is_stood_for():
    normal = HITS.normal.copy()
    normal[np.random.default_rng(4).choice(len(normal), len(normal) // 40, replace=False)] *= -1.0
    lattice = Lattice(replace(HITS, normal=normal), MATT)
    lattice.missing_rows()
    while lattice.refine(np.ones((len(normal), 1)), np.zeros((len(normal), 1)), FAR):
        lattice.missing_rows()
    rows, weights = lattice.footprint()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-5)
    faces = np.einsum("pkc,pc->pk", normal[lattice.rows[rows]], normal)
    assert not weights[faces < 0.0].any()


@pytest.mark.parametrize("glossy", [False, True])
def test_a_gloss_is_stood_for_by_normals_like_its_own(glossy):
    turn = np.array([0.25, 0.0, 0.0], np.float32) * np.sin(6.0 * HITS.position[:, :1])
    normal = HITS.normal + turn
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    lattice = Lattice(replace(HITS, normal=normal), np.full(len(CORNER), glossy))
    lattice.missing_rows()
    while lattice.refine(np.ones((len(normal), 1)), np.zeros((len(normal), 1)), FAR):
        lattice.missing_rows()
    rows, weights = lattice.footprint()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-5)
    alike = np.einsum("pkc,pc->pk", normal[lattice.rows[rows]], normal)[weights > 0.0].min()
    assert (alike > GLOSSY_TURN - 1e-5) == glossy


def test_some_blocks_tell_how_many_points_all_of_them_ask_for():
    every = count_by_shape(Lattice(HITS, MATT))
    some = Lattice(HITS, MATT)
    some.thin(200, np.random.default_rng(1))
    asked = count_by_shape(some)
    assert asked < 0.7 * every
    assert some.n_expected == pytest.approx(every, rel=0.15)


@pytest.mark.parametrize("close", [True, False], ids=["close", "not close"])
@pytest.mark.parametrize("n", range(41, 51))
def test_whatever_the_size_every_point_is_stood_for_by_known_ones(n, close):
    # Blocks of eight pixels end on the last row and column of a picture of 41 or 49, where others begin: large ones, as
    # all is even in them, while those before are single pixels.
    hits = placement_of(CORNER, eye=(0.7, 0.7, 0.8), target=(0.0, 0.1, 0.0), n=n).hits  # floor and walls fill it
    values, far = np.random.default_rng(n).random((len(hits.pixel), 1)), np.full(len(hits.pixel), np.inf, np.float32)
    values[np.max(np.divmod(hits.pixel, n), axis=0) == n - 1] = 0.5
    lattice = Lattice(hits, MATT, close)
    lattice.missing_rows()
    while lattice.refine(values, np.zeros_like(values), far):
        lattice.missing_rows()
    rows, weights = lattice.footprint()
    assert rows.min() >= 0 and rows.max() < len(lattice.rows)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-5)


LAYERS = [matt(0, 0.7), matt(1, 0.5), matt(2, 0.3)]


@pytest.fixture(scope="module")
def found() -> IndirectLight:
    return solve(placement_of(CORNER, **CORNER_VIEW), LAYERS, 3, QUICK, constant_environment((1.0, 0.8, 0.6)))


def refinement_of(found: IndirectLight, radiosity: NDArray[np.float32]) -> Refinement:
    points = found.points
    return Refinement(Lattice(points.hits, points.lobe_axes != NORMAL), LAYERS, radiosity)


def test_light_is_the_mean_of_the_halves_and_noise_half_their_difference(found: IndirectLight) -> None:
    radiosity, rows = found.radiosity(LAYERS), found.points.samples.points
    refinement = refinement_of(found, radiosity)
    run_to_end(refinement.measure(found.points, len(found.cache)))
    first, second = run_to_end(found.points.halves(LAYERS, found.outgoing_radiance(LAYERS)))
    np.testing.assert_allclose(refinement._light[rows], 0.5 * (first + second), rtol=1e-5)
    np.testing.assert_allclose(refinement._noise[rows], 0.5 * abs(first - second), rtol=1e-4, atol=1e-6)
    np.testing.assert_array_equal(refinement._clearance[rows], found.points.samples.clearance)
    others = np.setdiff1d(np.arange(len(refinement._light)), rows)
    assert len(others) and not refinement._light[others].any()  # nothing is known between gather points


def test_records_that_are_not_lit_yet_are_dark(found: IndirectLight) -> None:
    radiosity, rows = found.radiosity(LAYERS), found.points.samples.points
    n_known = len(radiosity) // 2
    some, dark = refinement_of(found, radiosity[:n_known]), radiosity.copy()
    dark[n_known:] = 0.0
    whole = refinement_of(found, dark)
    for each in (some, whole):
        run_to_end(each.measure(found.points, len(found.cache)))
    np.testing.assert_array_equal(some._light, whole._light)
    assert 0.0 < some._light[rows].mean() < found.at_points(LAYERS).mean() / found.unit


def test_each_gather_point_is_measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    measured = list[NDArray[np.int32]]()
    measure = Refinement.measure

    def measuring(refinement: Refinement, points: GatherPoints, n_records: int) -> Generator[None, None, None]:
        measured.append(points.samples.rows)
        return measure(refinement, points, n_records)

    monkeypatch.setattr(Refinement, "measure", measuring)
    light = solve(placement_of(CORNER, **CORNER_VIEW, n=64), LAYERS, 3, QUICK, constant_environment((1.0, 0.8, 0.6)))
    assert len(measured) > 2  # the lattice was refined
    np.testing.assert_array_equal(np.sort(np.concatenate(measured)), light.points.samples.points)


def test_extra_sets_are_numbered_at_their_points(found: IndirectLight, monkeypatch: pytest.MonkeyPatch) -> None:
    refinement, n = refinement_of(found, found.radiosity(LAYERS)), len(found.points.samples.points)
    run_to_end(refinement.measure(found.points, len(found.cache)))
    monkeypatch.setattr(smoothing, "NOISY", 0.0)
    monkeypatch.setattr(smoothing, "VERY_NOISY", 0.0)
    rows, nth = refinement.extra_sets(found.points.samples.points, found.footprint, 10.0)
    assert len(rows) > n and nth.dtype == np.uint8
    assert set(rows) <= set(found.points.samples.points)
    # Each point has the numbers 1, 2, ... without a gap: 0 is its first set.
    for row in np.unique(rows):
        np.testing.assert_array_equal(nth[rows == row], 1 + np.arange((rows == row).sum()))
    fewer, _ = refinement.extra_sets(found.points.samples.points, found.footprint, 0.5)
    assert len(fewer) <= 0.5 * n
    none, _ = refinement.extra_sets(found.points.samples.points, found.footprint, 0.0)
    assert not len(none)
