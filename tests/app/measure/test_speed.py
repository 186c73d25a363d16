"""The yardstick and what is held against it."""

from __future__ import annotations

import numpy as np
import pytest

from app.measure.accuracy import errors, oracle, random_rows, reflected
from app.measure.speed import (
    RawRate,
    hemisphere_directions,
    precompute,
    precompute_ratios,
    shadow_rays,
    visibility_seconds,
    wrong_answers,
)
from app.measure.subject import at_most, open_subject
from engine.precompute.direct.pipeline import FINAL, PREVIEW, Placement
from engine.sphere.geodesic import geodesic
from engine.visibility.point_visibility import brute_force_visibility
from engine.visibility.targets import VISIBILITY_LEVEL


@pytest.fixture(scope="module")
def placement(tiny_scene: str) -> Placement:
    return Placement(open_subject(tiny_scene).scene)


def test_brute_force_asks_half_of_the_directions_of_every_point(placement: Placement) -> None:
    # The directions of level 4 come in opposite pairs to within its 5,120: half of them are above any horizon.
    n_points = len(placement.hits.pixel)
    assert hemisphere_directions(placement.hits) == pytest.approx(2560 * n_points, rel=0.02)


def test_brute_force_visibility_asks_as_many(placement: Placement) -> None:
    rows = np.arange(len(placement.hits.pixel))
    truth = brute_force_visibility(placement.hits, placement.caster, placement.sphere.targets, rows)
    # The packed bits and the count decide the same question in different single-precision sums.
    assert truth.rays.possible == pytest.approx(hemisphere_directions(placement.hits), rel=1e-3)


def test_shadow_rays_are_the_scenes_own_and_above_the_horizon(placement: Placement) -> None:
    origins, directions = shadow_rays(placement.hits, 5000)
    assert len(origins) == len(directions) >= 5000
    assert origins.flags.c_contiguous and directions.dtype == np.float32
    points = {point.tobytes() for point in placement.hits.offset_position}
    assert all(origin.tobytes() in points for origin in origins[::97])
    centres = np.asarray(geodesic(VISIBILITY_LEVEL).centres, np.float32)
    assert {d.tobytes() for d in directions[::97]} <= {d.tobytes() for d in centres}


def test_the_raw_rate_is_a_positive_number(placement: Placement) -> None:
    assert 1e3 < RawRate(placement, 20_000).measure() < 1e12


def test_a_ratio_is_seconds_over_brute_force_of_the_same_run(tiny_scene: str) -> None:
    subject = open_subject(tiny_scene)
    ((ratio, done),) = list(precompute_ratios(subject, PREVIEW, 1, 20_000))
    n_brute = hemisphere_directions(done.placement.hits)
    assert ratio.value == pytest.approx(done.seconds * ratio.rate / n_brute)
    assert done.seconds == done.light_seconds + done.projection_seconds > 0


def test_preview_needs_no_visibility_of_the_sphere_and_final_does(tiny_scene: str) -> None:
    subject = open_subject(tiny_scene)
    assert not precompute(subject, PREVIEW).light.sphere.done.any()
    assert precompute(subject, FINAL).light.sphere.done.all()


def test_wrong_answers_are_counted_bit_by_bit(tiny_scene: str) -> None:
    placement = Placement(open_subject(tiny_scene).scene)
    rows = np.arange(len(placement.hits.pixel))
    placement.sphere = brute_force_visibility(placement.hits, placement.caster, placement.sphere.targets, rows)
    assert wrong_answers(placement, 10_000) == 0.0  # brute force agrees with itself
    placement.sphere.bits[:, 0] ^= np.uint64(1)  # one answer of every point turned over
    assert wrong_answers(placement, 10_000) == pytest.approx(len(rows) / placement.sphere.rays.possible)


def test_coherent_visibility_leaves_the_sphere_done(tiny_scene: str) -> None:
    placement = Placement(open_subject(tiny_scene).scene)
    assert visibility_seconds(placement) > 0
    assert placement.sphere.done.all()
    assert wrong_answers(placement) < 0.01


def test_errors_in_closed_form() -> None:
    truth = np.full((10, 3), 2.0)
    # Half of the values 10 % too dark: rms difference 0.2·sqrt(½) over a mean of 2, means differ by 5 %.
    ours = truth.copy()
    ours[:5] *= 0.9
    found = errors(ours, truth)
    assert found.rmse == pytest.approx(0.1 * np.sqrt(0.5))
    assert found.mean == pytest.approx(-0.05)


def test_the_brightest_are_clamped_at_the_truths_percentile() -> None:
    truth = np.ones((2000, 3))
    ours = truth.copy()
    ours[0] = 1e6  # a firefly: clamped at 1, the 99.9 percentile of the truth
    assert errors(ours, truth).rmse == 0.0


def test_transport_agrees_with_the_oracle(tiny_scene: str) -> None:
    subject = open_subject(tiny_scene)
    done = precompute(subject, FINAL)
    rows = random_rows(done.placement, 16)
    truth = oracle(subject, done.placement, rows, level=5)
    assert errors(reflected(done)[rows], truth).rmse < 0.03


@pytest.mark.parametrize(
    ("resolution", "side", "expected"),
    [((512, 256), 128, (128, 64)), ((100, 50), 128, (100, 50)), ((1000, 1), 10, (10, 1))],
)
def test_resolutions_shrink_with_their_aspect(
    resolution: tuple[int, int], side: int, expected: tuple[int, int]
) -> None:
    assert at_most(resolution, side) == expected
