"""Searches for a scalar parameter by trial: evenly over its range, then by golden section about the best [Kiefer53]."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from engine.material.parameters import Parameter

N_SCANNED, N_SECTIONS = 7, 8
# Near a value: trials, and how far they go to each side, as a share of the whole range.
N_SCANNED_NEAR, N_SECTIONS_NEAR, NEAR = 5, 4, 0.1
_GOLDEN = (1.0 + 5.0**0.5) / 2.0


def search_parameter(
    parameter: Parameter, error: Callable[[float], float], about: float | None = None
) -> Iterator[tuple[float, float]]:
    """The share of the trials that is done and the value of the least error so far, at each trial. error: that of a
    value; about: searches near this value alone."""
    low, high = parameter.limits
    by_ratio = parameter.logarithmic and low > 0.0
    begin, end, n_scanned, n_sections = 0.0, 1.0, N_SCANNED, N_SECTIONS
    if about is not None:
        middle = math.log(about / low) / math.log(high / low) if by_ratio else (about - low) / (high - low)
        begin, end = max(middle - NEAR, 0.0), min(middle + NEAR, 1.0)
        n_scanned, n_sections = N_SCANNED_NEAR, N_SECTIONS_NEAR
    known: dict[float, float] = {}

    def value_of(share: float) -> float:
        return float(low * (high / low) ** share) if by_ratio else low + share * (high - low)

    def tried(share: float) -> float:
        if share not in known:
            known[share] = error(value_of(share))
        return known[share]

    def least() -> float:
        return value_of(min(known, key=lambda share: known[share]))

    n_trials, step = n_scanned + n_sections, (end - begin) / (n_scanned - 1)
    scanned = [begin + i * step for i in range(n_scanned)]
    for number, share in enumerate(scanned, 1):
        tried(share)
        yield number / n_trials, least()
    best = min(scanned, key=tried)
    left, right = max(best - step, begin), min(best + step, end)
    for number in range(n_scanned + 1, n_trials + 1):
        lower, upper = right - (right - left) / _GOLDEN, left + (right - left) / _GOLDEN
        left, right = (left, upper) if tried(lower) < tried(upper) else (lower, right)
        yield number / n_trials, least()
