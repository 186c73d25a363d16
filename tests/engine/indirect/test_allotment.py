"""How fans are shared out among gather points, and what comes of several fans of a point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine.indirect.allotment import fans_of_points
from engine.indirect.gather import MOST_FANS
from engine.indirect.solver import Fineness
from engine.light.environment import constant_environment
from engine.threads import n_threads
from tests.engine.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve

PLACEMENT = placement_of(CORNER, **CORNER_VIEW, n=48)
HITS = PLACEMENT.hits
ROWS = np.arange(len(HITS.pixel), dtype=np.int32)
OBJECTS = HITS.object_image.ravel()[HITS.pixel]
ALIKE = np.full(len(CORNER), 0.9, np.float32)
LAYERS = [matt(0, 0.5), matt(1, 0.6), matt(2, 0.7)]
SKY = constant_environment((1.0, 1.0, 1.0))


def allotted(noise: np.ndarray, shown: np.ndarray | float = 1.0, mean: float = 2.0) -> np.ndarray:
    even = np.repeat(np.float32(noise)[:, None], 3, axis=1)
    return fans_of_points(HITS, ROWS, ALIKE, even, np.broadcast_to(shown, len(ROWS)), mean)


@pytest.mark.parametrize("mean", [1.0, 1.5, 2.0, 4.0, float(MOST_FANS)])
def test_as_many_are_shared_out_as_there_are(mean: float) -> None:
    noise = np.random.default_rng(1).gamma(0.5, size=len(ROWS))
    fans = allotted(noise, mean=mean)
    assert fans.min() >= 1 and fans.max() <= MOST_FANS
    assert fans.mean() == pytest.approx(mean, abs=1e-2)


def test_what_is_noisy_gets_more_and_so_does_what_more_pixels_show() -> None:
    # Twice the noise is four times the variance, 4^0.4 = 1.74 times the fans; so is what counts four times.
    first = OBJECTS == 0
    for fans in (allotted(np.where(first, 2.0, 1.0)), allotted(np.ones(len(ROWS)), np.where(first, 4.0, 1.0))):
        assert fans[first].mean() / fans[~first].mean() == pytest.approx(4.0**0.4, rel=0.01)


def test_a_point_whose_halves_agree_by_chance_gets_what_its_neighbours_get() -> None:
    noise = abs(np.random.default_rng(2).normal(size=len(ROWS)))
    fans = allotted(noise)
    lucky, unlucky = noise < 0.3, noise > 1.5
    assert fans[lucky].mean() == pytest.approx(fans[unlucky].mean(), rel=0.1)


def test_no_noise_and_no_points_are_borne() -> None:
    assert (allotted(np.zeros(len(ROWS)))).mean() == pytest.approx(2.0, abs=1e-2)
    none = np.zeros((0, 3), np.float32)
    assert len(fans_of_points(HITS, ROWS[:0], ALIKE, none, none[:, 0], 2.0)) == 0


def quick(n_fans: float) -> Fineness:
    return replace(QUICK, n_rays=64, n_fans=n_fans, n_samples=64, n_photons=0)


def test_a_point_has_the_mean_of_its_fans() -> None:
    found = solve(PLACEMENT, LAYERS, 2, quick(3), SKY).unfiltered()
    gathered = found.points.gathered
    point = np.cumsum(gathered.nth == 0) - 1
    counts = np.bincount(point)
    assert counts.max() > counts.min() and counts.mean() == pytest.approx(3.0, abs=0.1)
    np.testing.assert_array_equal(gathered.nth, np.arange(len(point)) - (np.cumsum(counts) - counts)[point])
    bright = found.radiosity(LAYERS)[:, 0]  # what the cells send, by the rays that see them: matt fans count all alike
    seen = np.append(bright, np.zeros((1, 3)), axis=0)[np.minimum(gathered.seen, len(bright))].mean(axis=1)
    means = np.stack([np.bincount(point, seen[:, c]) / counts for c in range(3)], axis=1)
    objects = np.searchsorted(HITS.object_ranges[:, 1], gathered.points, "right")
    expected = means * np.array([layer.albedo[0] for layer in LAYERS])[objects][:, None] / np.pi
    np.testing.assert_allclose(found.at_points(LAYERS) / expected, found.unit, rtol=2e-3)


def test_fans_are_the_same_by_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = (_gathered_by(n, monkeypatch) for n in (1, max(n_threads(), 2)))
    for name in ("rows", "nth", "seen"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def _gathered_by(n: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("engine.threads.n_threads", lambda: n)
    return solve(PLACEMENT, LAYERS, 2, quick(2), SKY).points.gathered
