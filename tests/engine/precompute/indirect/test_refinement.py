"""Where a picture gets more gather points and sample sets: by the halves of its rays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.precompute.indirect import smoothing
from engine.precompute.indirect._ray_kernels import NORMAL
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.lattice import Lattice
from engine.precompute.indirect.refinement import Refinement
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve

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
    run_to_end(refinement.measure(found.points, len(found.cells)))
    first, second = (found.at_points(LAYERS, half) / found.unit for half in (0, 1))
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
        run_to_end(each.measure(found.points, len(found.cells)))
    np.testing.assert_array_equal(some._light, whole._light)
    assert 0.0 < some._light[rows].mean() < found.at_points(LAYERS).mean() / found.unit


def test_extra_sets_are_numbered_at_their_points(found: IndirectLight, monkeypatch: pytest.MonkeyPatch) -> None:
    refinement, n = refinement_of(found, found.radiosity(LAYERS)), len(found.points.samples.points)
    run_to_end(refinement.measure(found.points, len(found.cells)))
    monkeypatch.setattr(smoothing, "NOISY", 0.0)
    monkeypatch.setattr(smoothing, "VERY_NOISY", 0.0)
    rows, nth = refinement.extra_sets(found.points, found.footprint, 10.0)
    assert len(rows) > n and nth.dtype == np.uint8
    assert set(rows) <= set(found.points.samples.points)
    # Each point has the numbers 1, 2, ... without a gap: 0 is its first set.
    for row in np.unique(rows):
        np.testing.assert_array_equal(nth[rows == row], 1 + np.arange((rows == row).sum()))
    fewer, _ = refinement.extra_sets(found.points, found.footprint, 0.5)
    assert len(fewer) <= 0.5 * n
    none, _ = refinement.extra_sets(found.points, found.footprint, 0.0)
    assert not len(none)
