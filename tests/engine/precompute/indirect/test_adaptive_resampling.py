"""Which gather points ask for further fans, and what comes of several fans of a point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine.light.environment import constant_environment
from engine.precompute.indirect import smoothing
from engine.precompute.indirect.direction_patterns import MAX_SAMPLE_SETS
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import STILL
from engine.precompute.indirect.smoothing import NOISY, VERY_NOISY, extra_sample_sets
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placed, placement_of, solve

PLACEMENT = placement_of(CORNER, **CORNER_VIEW, n=32)
HITS = PLACEMENT.hits
ROWS = np.arange(len(HITS.pixel), dtype=np.int32)
OBJECTS = HITS.object_image.ravel()[HITS.pixel]
ALIKE = np.full(len(CORNER), 0.9, np.float32)
LAYERS = [matt(0, 0.5), matt(1, 0.6), matt(2, 0.7)]
SKY = constant_environment((1.0, 1.0, 1.0))
ALL = MAX_SAMPLE_SETS - 1.0
# Two chambers and a slit of 20 cm between them; in the one behind it a lamp, and a board that hides it from the slit.
SLIT = [
    {"name": name, "primitive": "cube", "transform": placed(*middle, *size)}
    for name, middle, size in (
        ("floor", (0, -0.05, -0.5), (2.2, 0.1, 3.2)),
        ("ceiling", (0, 2.05, -0.5), (2.2, 0.1, 3.2)),
        ("left", (-1.05, 1, -0.5), (0.1, 2, 3.2)),
        ("right", (1.05, 1, -0.5), (0.1, 2, 3.2)),
        ("back", (0, 1, -2.05), (2, 2, 0.1)),
        ("front", (0, 1, 1.05), (2, 2, 0.1)),
        ("left of the slit", (-0.55, 1, -1), (0.9, 2, 0.04)),
        ("right of the slit", (0.55, 1, -1), (0.9, 2, 0.04)),
        ("board", (0.58, 1, -1.2), (0.82, 2, 0.02)),
    )
]
SLIT.append({"name": "lamp", "primitive": "cube", "emission": [200.0] * 3, "transform": placed(0.6, 1, -1.4, 0.2)})
# Light of 1, and the quarter of its mean that is added.
HELD_AGAINST = 1.25


def asked(
    noise: np.ndarray | float, shown: np.ndarray | float = 1.0, most: float = ALL, scale: float = 1.0
) -> np.ndarray:
    """Where there is light of 1 and this noise, relative to what it is held against."""
    even = np.repeat(np.broadcast_to(np.float32(noise * HELD_AGAINST), len(ROWS))[:, None], 3, axis=1)
    shown = np.broadcast_to(shown, len(ROWS))
    return extra_sample_sets(HITS, ROWS, ALIKE, np.ones_like(even), even, shown, most, scale)


def test_points_ask_by_their_noise() -> None:
    for noise, n in ((0.0, 0), (0.95 * NOISY, 0), (1.05 * NOISY, 1), (0.95 * VERY_NOISY, 1), (1.05 * VERY_NOISY, ALL)):
        assert (asked(noise) == n).all()
        assert (asked(0.4 * noise, scale=0.4) == n).all()


def test_surfaces_ask_for_themselves_and_only_where_the_picture_shows_them() -> None:
    first = OBJECTS == 0
    for fans in (asked(np.where(first, 1.0, 0.0)), asked(1.0, np.where(first, 1.0, 1e-3))):
        assert (fans[first] == ALL).all() and not fans[~first].any()


def test_a_point_whose_halves_agree_by_chance_asks_for_what_its_neighbours_ask_for() -> None:
    noise = 1.5 * VERY_NOISY * np.random.default_rng(2).normal(size=len(ROWS))
    fans = asked(noise)
    lucky = abs(noise) < 0.4 * NOISY
    assert lucky.sum() > 20 and fans[lucky].mean() == pytest.approx(fans[~lucky].mean(), rel=0.05)


@pytest.mark.parametrize("most", [0.0, 0.25, 1.0, 1.5, ALL])
def test_no_more_are_given_than_there_are(most: float) -> None:
    worse = np.where(OBJECTS == 0, 2.0, 1.0)
    fans = asked(VERY_NOISY * (1.0 + worse), most=most)
    assert fans.sum() == int(most * len(ROWS))
    assert abs(fans - most).max() <= (1.0 if most <= 1.0 else 2.0)  # all have one before any has three
    if most not in (0.0, 1.0, ALL):
        assert fans[OBJECTS == 0].mean() > fans[OBJECTS != 0].mean()


def test_no_light_and_no_points_are_borne() -> None:
    dark = np.zeros((len(ROWS), 3), np.float32)
    assert not extra_sample_sets(HITS, ROWS, ALIKE, dark, dark, np.ones(len(ROWS)), ALL).any()
    assert len(extra_sample_sets(HITS, ROWS[:0], ALIKE, dark[:0], dark[:0], np.zeros(0), ALL)) == 0


def in_the_corner(most: float, n_rays: int = 64) -> IndirectLight:
    fineness = replace(QUICK, n_rays=n_rays, max_extra_sets=most, n_samples=64, n_photons=0)
    return solve(PLACEMENT, LAYERS, 2, fineness, SKY)


@pytest.fixture
def touchy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points ask for what is hardly noise."""
    monkeypatch.setattr(smoothing, "NOISY", 0.005)
    monkeypatch.setattr(smoothing, "VERY_NOISY", 0.01)


@pytest.mark.usefixtures("touchy")
def test_a_point_has_the_mean_of_its_hemisphere_samples() -> None:
    found = in_the_corner(1.5).with_smoothing(None)
    gathered = found.points.samples
    point = np.cumsum(gathered.nth == 0) - 1
    counts = np.bincount(point)
    assert {1, 2, MAX_SAMPLE_SETS} <= set(counts.tolist()) and counts.mean() <= 2.5
    np.testing.assert_array_equal(gathered.nth, np.arange(len(point)) - (np.cumsum(counts) - counts)[point])
    bright = found.radiosity(LAYERS)[:, 0]  # what the cells send, by the rays that see them: matt fans count all alike
    seen = np.append(bright, np.zeros((1, 3)), axis=0)[np.minimum(gathered.records, len(bright))].mean(axis=1)
    means = np.stack([np.bincount(point, seen[:, c]) / counts for c in range(3)], axis=1)
    objects = np.searchsorted(HITS.object_ranges[:, 1], gathered.points, "right")
    expected = means * np.array([layer.albedo[0] for layer in LAYERS])[objects][:, None] / np.pi
    np.testing.assert_allclose(found.at_points(LAYERS) / expected, found.unit, rtol=2e-3)


@pytest.mark.usefixtures("touchy")
def test_fans_are_the_same_by_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = (_gathered_by(n, monkeypatch) for n in (1, 2))
    assert one.nth.any()
    for name in ("rows", "nth", "records"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def _gathered_by(n: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("engine.core.threads.n_threads", lambda: n)
    return in_the_corner(1.0).points.samples


def test_where_nothing_is_asked_for_nothing_changes() -> None:
    with_none, may = (in_the_corner(most, 256) for most in (0.0, ALL))
    np.testing.assert_array_equal(with_none.picture(LAYERS), may.picture(LAYERS))


def test_a_room_that_is_lit_through_a_slit_asks_and_is_nearer() -> None:
    # All that comes through the slit has been reflected behind it; 32 times the rays are the judge.
    placement, layers = placement_of(SLIT, (-0.5, 1.5, -0.8), (0.3, 0.6, 1.0), n=12), [matt(i, 0.7) for i in range(9)]
    room = replace(STILL, n_rays=128, max_extra_sets=0, n_cache_records=1500, n_record_rays=32, n_samples=64)
    given = ({"n_rays": 4096}, {}, {"max_extra_sets": 1}, {"max_extra_sets": ALL})
    found = [solve(placement, layers, 2, replace(room, **each)) for each in given]
    truth, *pictures = (each.picture(layers) for each in found)
    n_fans = [len(each.points.samples.nth) / len(each.points.samples.points) for each in found[1:]]
    assert n_fans[:2] == [1.0, 2.0] and n_fans[2] > 3.0
    once, twice, most = (np.linalg.norm(picture - truth) / np.linalg.norm(truth) for picture in pictures)
    assert twice < 0.75 * once and most < 0.65 * once  # 0.68 and 0.57 of it
