"""The yardstick and what is held against it."""

from __future__ import annotations

import numpy as np
import pytest

from app.measure.subject import open_subject, precompute, visibility_seconds
from benchmarks.brute_force_ratio import RawRate, hemisphere_directions, precompute_ratios, shadow_rays, wrong_answers
from engine.precompute.direct.pipeline import FINAL, PREVIEW, Placement
from engine.sphere.geodesic import geodesic
from engine.visibility.point_visibility import VISIBILITY_LEVEL, brute_force_visibility


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
