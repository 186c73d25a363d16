"""Weighted sums of pictures."""

from __future__ import annotations

import numpy as np
import pytest

from engine.core import weighted_sum
from engine.core.weighted_sum import ChangingSum

N_POINTS = 9001  # blocks and a part of one
NAMES = "abcdefgh"


@pytest.fixture
def pictures() -> dict[str, np.ndarray | None]:
    random = np.random.default_rng(3)
    return {name: None if name == "c" else random.random((N_POINTS, 3), np.float32) for name in NAMES}


@pytest.fixture
def n_terms(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many pictures each sum adds."""
    counts, of_terms = list[int](), weighted_sum.weighted_sum

    def counted(pictures, weights, *others):  # type: ignore[no-untyped-def]
        counts.append(len(weights))
        return of_terms(pictures, weights, *others)

    monkeypatch.setattr(weighted_sum, "weighted_sum", counted)
    return counts


def naive(pictures: dict[str, np.ndarray | None], weights: dict[str, tuple[float, float, float]]) -> np.ndarray:
    total = np.zeros((N_POINTS, 3))
    for name, weight in weights.items():
        picture = pictures[name]
        total += 0.0 if picture is None else np.float64(picture) * weight
    return total


def test_a_sum_begins_with_a_start_and_leaves_it(pictures: dict[str, np.ndarray | None]) -> None:
    start = np.full((N_POINTS, 3), 0.5, np.float32)
    found = weighted_sum.weighted_sum(pictures, {"a": (1.0, 2.0, 0.0), "c": (1.0, 1.0, 1.0)}, N_POINTS, start)
    np.testing.assert_allclose(found, 0.5 + naive(pictures, {"a": (1.0, 2.0, 0.0)}), rtol=1e-6)
    assert (start == 0.5).all()


def test_any_sequence_of_weights_is_as_summed_anew(pictures: dict[str, np.ndarray | None]) -> None:
    """They change one by one, or several by one factor. A bright light that goes off leaves nothing: rounding errors of
    one of 10^6 would be 0.1."""
    random, summed = np.random.default_rng(4), ChangingSum(pictures.get, N_POINTS)
    weights, group = dict.fromkeys(NAMES, (1.0, 1.0, 1.0)), NAMES[:5]
    for _ in range(100):
        chosen = random.choice(list(NAMES), random.choice([0, 1, 1, 1, 2, 8]), replace=False)
        if random.random() < 0.5:  # by one factor
            gain = random.choice([1e-3, 0.5, 300.0])
            weights |= {name: tuple(gain * x for x in weights[name]) for name in group}
        else:
            for name in chosen:
                gain = random.choice([0.0, 0.5, 1e6])
                weights[name] = (gain, 2.0 * gain, gain)
        if random.random() < 0.3:
            group = chosen
        found = summed.at(weights)
        np.testing.assert_allclose(found, naive(pictures, weights), rtol=1e-5, atol=1e-6)
        found[:] = np.nan  # it belongs to the caller


def test_one_that_changes_costs_one_picture(pictures: dict[str, np.ndarray | None], n_terms: list[int]) -> None:
    summed = ChangingSum(pictures.get, N_POINTS)
    weights = dict.fromkeys(NAMES, (1.0, 1.0, 1.0))
    for gain in (1.0, 2.0, 3.0, 4.0, 0.0):
        summed.at({**weights, "a": (gain, gain, gain)})
    # All; then those that stayed are summed, seven of eight, and "a" is added to them, until it is off.
    assert n_terms == [8, 7, 1, 1, 1, 0]


def test_a_group_costs_one_picture(pictures: dict[str, np.ndarray | None], n_terms: list[int]) -> None:
    summed = ChangingSum(pictures.get, N_POINTS)
    weights = {name: (1.0 + i, 0.0, 0.5) for i, name in enumerate(NAMES)}
    for gain in (1.0, 2.0, 3.0, 4.0, 5.0):
        mix = weights | {name: (gain * weights[name][0], 0.0, 0.5 * gain) for name in "abdefg"}
        found = summed.at(mix)
        np.testing.assert_allclose(found, naive(pictures, mix), rtol=1e-5)
    # All; those that stay and the group, the sum of the group, and then that alone.
    assert n_terms[-2:] == [1, 1] and n_terms[:3] == [8, 2, 6]
