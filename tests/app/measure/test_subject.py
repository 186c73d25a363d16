"""Errors in closed form, the oracle, and the resolutions at which scenes are measured."""

from __future__ import annotations

import pytest

from app.measure.subject import at_most, open_subject, oracle, precompute, random_rows, reflected
from engine.precompute.direct.pipeline import FINAL
from engine.render.picture_difference import errors


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
