"""The loop of the peers' programs, on a tracer that returns noise about the value that was set."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.programs import progressive
from benchmarks.programs.progressive import PASSES, Images, follow, refine, truths


class Noise:
    """Radiance `value` with a deviation of 1 a sample."""

    made_with = "noise"

    def __init__(self) -> None:
        self.value = 5.0
        self.seen: list[tuple[int, int, int]] = []

    def change(self, edit: dict[str, Any]) -> None:
        self.value = edit["value"]

    def render(self, samples: int, seed: int, done: int) -> Images:
        self.seen.append((samples, seed, done))
        rng = np.random.default_rng((seed, done))
        return (self.value + rng.standard_normal((32, 32, 9)) / np.sqrt(samples)).astype(np.float32)


class Steps:
    """A clock that goes on by 0.1 s at each look."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 0.1
        return self.now


@pytest.fixture
def undenoised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progressive, "denoised", lambda mean: mean[..., :3])
    monkeypatch.setattr(progressive.time, "perf_counter", Steps())
    monkeypatch.setattr(progressive.time, "process_time", Steps())


def test_samples_double_and_all_are_kept() -> None:
    found = list(refine(Noise(), 3, PASSES[:8]))
    assert [n for n, *_ in found] == [1, 2, 4, 8, 16, 32, 68, 132]
    deviations = np.array([mean.std() for _, mean, _ in found])
    assert deviations * np.sqrt([n for n, *_ in found]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.usefixtures("undenoised")
def test_pictures_follow_each_edit_until_its_horizon() -> None:
    tracer = Noise()
    found = follow(tracer, [{"value": 2.0, "horizon_s": 1.0}, {"value": 4.0, "horizon_s": 3.0}], 1)
    first, second = (found["edit"] == index for index in (0, 1))
    assert 1 < first.sum() < second.sum()
    assert found["pictures"][first].mean() == pytest.approx(2.0, abs=0.05)
    assert found["pictures"][second].mean() == pytest.approx(4.0, abs=0.05)
    assert (np.diff(found["seconds"][second]) > 0).all() and (np.diff(found["samples"][first]) > 0).all()
    assert found["raw"][1] == pytest.approx(found["pictures"][-1]) and len(found["raw"]) == 2
    assert len({seed for _, seed, _ in tracer.seen}) == 2  # each edit has its own


def test_truths_are_two_independent_halves() -> None:
    found = truths(Noise(), [[{"value": 2.0}], [{"value": 3.0}]], 512, 1)
    assert found.shape == (2, 2, 32, 32, 3)
    assert found.mean(axis=(1, 2, 3, 4)) == pytest.approx([2.0, 3.0], abs=0.01)
    apart = found - found.mean(axis=(1, 2, 3, 4), keepdims=True)
    assert apart.std() == pytest.approx(1 / np.sqrt(512), rel=0.05)
    assert abs(np.corrcoef(apart[0, 0].ravel(), apart[0, 1].ravel())[0, 1]) < 0.1
