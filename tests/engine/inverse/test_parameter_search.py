"""The search for a parameter: by trial, over a range or near a value."""

import math

import pytest

from engine.inverse.parameter_search import (
    N_SCANNED,
    N_SCANNED_NEAR,
    N_SECTIONS,
    N_SECTIONS_NEAR,
    search_parameter,
)
from engine.material import MODELS

ALPHA = next(p for p in MODELS["rough_conductor"].parameters if p.name == "alpha")
SIGMA = next(p for p in MODELS["oren_nayar"].parameters if p.name == "sigma")


@pytest.mark.parametrize("best", [0.002, 0.03, 0.21, 0.9])
def test_finds_the_least_error_of_one_that_is_perceived_by_ratio(best):
    *_, (done, value) = search_parameter(ALPHA, lambda alpha: abs(math.log(alpha / best)))
    assert done == 1.0
    assert value == pytest.approx(best, rel=0.1)


@pytest.mark.parametrize("best", [0.0, 0.37, 1.0])
def test_finds_the_least_error_of_another(best):
    *_, (_, value) = search_parameter(SIGMA, lambda sigma: (sigma - best) ** 2)
    assert value == pytest.approx(best, abs=0.02)


def test_near_a_value_it_finds_the_least_error_there():
    tried = []

    def error(alpha: float) -> float:
        tried.append(alpha)
        return abs(math.log(alpha / 0.22))

    *_, (_, value) = search_parameter(ALPHA, error, about=0.2)
    assert value == pytest.approx(0.22, rel=0.02)
    assert 0.05 < min(tried) < max(tried) < 0.8


def test_stays_within_the_range_near_its_end():
    tried = []
    *_, (_, value) = search_parameter(SIGMA, lambda sigma: tried.append(sigma) or -sigma, about=1.0)
    assert value == 1.0
    assert max(tried) == 1.0


def test_tries_only_what_a_parameter_accepts_and_beyond_its_slider_where_it_is():
    """The coat's index has a slider from 1, and accepts 1.01 to 5."""
    tried: list[float] = []
    index = next(p for model in MODELS.values() for p in model.parameters if p.soft == (1.0, 3.0))
    *_, (_, value) = search_parameter(index, lambda each: tried.append(each) or each)
    assert value == min(tried) == index.minimum
    *_, (_, value) = search_parameter(index, lambda each: tried.append(each) or abs(each - 4.0), about=4.0)
    assert value == pytest.approx(4.0) and max(tried) <= index.maximum


@pytest.mark.parametrize("best", [0.03, 0.21, 0.4, 0.9])
@pytest.mark.parametrize("about, n_trials", [(None, N_SCANNED + N_SECTIONS), (0.4, N_SCANNED_NEAR + N_SECTIONS_NEAR)])
def test_each_trial_costs_one_error_and_no_value_is_tried_twice(best: float, about: float | None, n_trials: int):
    for parameter in (ALPHA, SIGMA):
        tried: list[float] = []

        def error(value: float, best: float = best, tried: list[float] = tried) -> float:
            tried.append(value)
            return abs(value - best)

        shares = [done for done, _ in search_parameter(parameter, error, about)]
        assert len(tried) == len(shares) == n_trials == (16 if about is None else 10)
        assert shares == [i / n_trials for i in range(1, n_trials + 1)]
        apart = sorted(tried)
        assert all(b - a > 1e-9 for a, b in zip(apart, apart[1:], strict=False))
