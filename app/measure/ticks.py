"""Ticks of a logarithmic axis that can be read: a few, told apart from each other, and without exponents."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import Formatter, Locator, MaxNLocator, NullLocator

MOST = 6
# Of a decade, from coarse to fine.
_PARTS = ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
_MOST_DIGITS = 8


def read_well(axis: Axis) -> None:
    """Give a logarithmic axis such ticks."""
    axis.set_major_locator(_LogPlaces())
    axis.set_major_formatter(_LogNames())
    axis.set_minor_locator(NullLocator())


def log_places(low: float, high: float) -> list[float]:
    """A few round numbers between two above 0: parts of decades, and where these lie too close together for two,
    numbers at equal distances."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    found: list[float] = []
    for parts in _PARTS:
        places = [10.0**k * part for k in decades for part in parts if low <= 10.0**k * part <= high]
        if len(places) > MOST:
            break
        found = places
    if not found:
        tens = [10.0**k for k in decades if low <= 10.0**k <= high]
        found = tens[:: -(-len(tens) // MOST)] if tens else []
    if len(found) < 2:
        found = [float(x) for x in MaxNLocator(4).tick_values(low, high) if low <= x <= high]
    return found


def log_name(place: float) -> str:
    """With as many digits as it needs."""
    for digits in range(1, _MOST_DIGITS):
        name = np.format_float_positional(place, precision=digits, fractional=False, trim="-")
        if math.isclose(float(name), place, rel_tol=1e-6):
            break
    return name


class _LogPlaces(Locator):
    def __call__(self) -> list[float]:
        assert self.axis is not None
        low, high = self.axis.get_view_interval()
        return self.tick_values(low, high)

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        return log_places(*sorted((vmin, vmax)))


class _LogNames(Formatter):
    def __call__(self, x: float, pos: int | None = None) -> str:
        return log_name(x)
