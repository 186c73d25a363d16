"""Errors in closed form, the oracle, and the resolutions at which scenes are measured."""

from __future__ import annotations

import numpy as np
import pytest

from app.measure.subject import at_most, errors, open_subject, oracle, precompute, random_rows, reflected
from engine.precompute.direct.pipeline import FINAL


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
