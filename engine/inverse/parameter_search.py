"""Searches for a scalar parameter by trial: evenly over its range, then by golden section about the best [Kiefer53]."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from engine.material.parameters import Parameter

# Trials over the range, and by golden section.
N_SCANNED, N_SECTIONS = 7, 9
# The same near a value, and how far they go to each side, as a share of the whole range.
N_SCANNED_NEAR, N_SECTIONS_NEAR, NEAR = 5, 5, 0.1
_GOLDEN = (1.0 + 5.0**0.5) / 2.0


def search_parameter(
    parameter: Parameter, error: Callable[[float], float], about: float | None = None
) -> Iterator[tuple[float, float]]:
    """The share of the trials that is done and the value of the least error so far, at each trial. error: that of a
    value; about: searches near this value alone."""
    low, high = max(parameter.limits[0], parameter.minimum), min(parameter.limits[1], parameter.maximum)
    by_ratio = parameter.logarithmic and low > 0.0
    begin, end, n_scanned, n_sections = 0.0, 1.0, N_SCANNED, N_SECTIONS
    if about is not None:
        low, high = min(low, about), max(high, about)
        middle = math.log(about / low) / math.log(high / low) if by_ratio else (about - low) / (high - low)
        begin, end = max(middle - NEAR, 0.0), min(middle + NEAR, 1.0)
        n_scanned, n_sections = N_SCANNED_NEAR, N_SECTIONS_NEAR
    tried: list[tuple[float, float]] = []

    def value_of(share: float) -> float:
        return float(low * (high / low) ** share) if by_ratio else low + share * (high - low)

    def error_at(share: float) -> float:
        tried.append((error(value_of(share)), share))
        return tried[-1][0]

    def so_far() -> tuple[float, float]:
        return len(tried) / (n_scanned + n_sections), value_of(min(tried)[1])

    step = (end - begin) / (n_scanned - 1)
    for i in range(n_scanned):
        error_at(begin + i * step)
        yield so_far()
    best = min(tried)[1]
    left, right = max(best - step, begin), min(best + step, end)
    lower, upper = right - (right - left) / _GOLDEN, left + (right - left) / _GOLDEN
    below = error_at(lower)
    yield so_far()
    above = error_at(upper)
    yield so_far()
    for _ in range(n_sections - 2):
        # Of the two inner points, the better one divides the narrower section as well: its error is known.
        if below < above:
            right, upper, above = upper, lower, below
            lower = right - (right - left) / _GOLDEN
            below = error_at(lower)
        else:
            left, lower, below = lower, upper, above
            upper = left + (right - left) / _GOLDEN
            above = error_at(upper)
        yield so_far()
