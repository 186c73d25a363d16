"""The axes of the curve plot: values to pixels and back, and the places of the labels.

Angles are radians inside and degrees only in tick labels. Pure arithmetic: nothing here draws.

A highlight's curve is a thousand times higher at its peak than in the skirt that lights most of the picture. A linear
height gives the skirt a pixel, and a pixel's drag raises it far too much; the logarithm gives most of its room to
values near 0, and has no 0. So the height is linear up to 1, as reflectances are, and its logarithm above (*symlog*): a
drag adds up to there, and from there on it multiplies. Rejected: the cube root, by which a third of the height raised
the skirt of a ring's gold by 6.6 and reflected seven times the light it received.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

HALF_PI = math.pi / 2.0
ANGLE_STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0)
LARGEST_LOG_SPAN = 8.0

Scale = Literal["linear", "symlog", "log"]


@dataclass(frozen=True)
class Axis:
    """Maps values [low, high] to pixels [start, end] (start may exceed end), linearly, by logarithm or both."""

    low: float
    high: float
    start: float
    end: float
    scale: Scale = "linear"

    def to_pixel(self, value: float) -> float:
        """Pixel of `value`; a logarithmic axis puts values at or below its floor on the floor."""
        return float(self.to_pixels(np.array(value)))

    def to_pixels(self, values: np.ndarray) -> np.ndarray:
        """`to_pixel` of an array, any shape, float64."""
        start, end = self._warp(np.array([self.low, self.high]))
        warped = self._warp(np.asarray(values, dtype=np.float64))
        return np.asarray(self.start + (warped - start) / (end - start) * (self.end - self.start))

    def to_value(self, pixel: float) -> float:
        """Value at `pixel`, also beyond the axis' ends."""
        start, end = self._warp(np.array([self.low, self.high])).tolist()
        warped = start + (pixel - self.start) / (self.end - self.start) * (end - start)
        if self.scale == "log":
            return 10.0 ** min(max(warped, -300.0), 300.0)
        if self.scale == "linear" or abs(warped) <= 1.0:
            return warped
        return math.copysign(math.exp(min(abs(warped) - 1.0, 690.0)), warped)

    def _warp(self, values: np.ndarray) -> np.ndarray:
        """Values in the spacing of the axis: the logarithm continues at 1 with the slope of what is below."""
        if self.scale == "log":
            return np.log10(np.maximum(values, self.low))
        if self.scale == "linear":
            return values
        size = np.abs(values)
        return np.where(size <= 1.0, values, np.sign(values) * (1.0 + np.log(np.maximum(size, 1.0))))


@dataclass(frozen=True)
class Tick:
    """A grid line at `value`; `label` is empty for minor lines."""

    value: float
    label: str


def angle_ticks(axis: Axis, smallest_gap: float) -> list[Tick]:
    """Labelled ticks in whole steps of degrees, at least `smallest_gap` pixels apart."""
    low, high = math.degrees(axis.low), math.degrees(axis.high)
    pixels = abs(axis.end - axis.start)
    step = next((s for s in ANGLE_STEPS if s / (high - low) * pixels >= smallest_gap), ANGLE_STEPS[-1])
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [Tick(math.radians(k * step), f"{k * step:g}°") for k in range(first, last + 1)]


@functools.lru_cache(maxsize=16)
def value_ticks(axis: Axis, smallest_gap: float) -> tuple[Tick, ...]:
    """Ticks of the vertical axis: 1-2-5 steps when linear, decades (with unlabelled 2…9) when logarithmic."""
    if axis.scale == "log":
        return tuple(_decade_ticks(axis, smallest_gap))
    is_high = axis.scale == "symlog" and max(abs(axis.low), abs(axis.high)) > 2.0
    return tuple(_symlog_ticks(axis, smallest_gap) if is_high else _linear_ticks(axis, smallest_gap))


def _linear_ticks(axis: Axis, smallest_gap: float) -> list[Tick]:
    span = axis.high - axis.low
    least = span * smallest_gap / abs(axis.end - axis.start)
    magnitude = 10.0 ** math.floor(math.log10(least))
    step = next(magnitude * m for m in (1.0, 2.0, 5.0, 10.0) if magnitude * m >= least * (1 - 1e-9))
    first, last = math.ceil(axis.low / step - 1e-9), math.floor(axis.high / step + 1e-9)
    return [Tick(k * step, value_label(k * step, step)) for k in range(first, last + 1)]


def _symlog_ticks(axis: Axis, smallest_gap: float) -> list[Tick]:
    """0, 1 and as many of 10, 100…, then 5s and 2s, as keep their distance."""
    largest = math.ceil(math.log10(max(abs(axis.low), abs(axis.high))))
    decades = [1.0, *(10.0**k for k in range(1, largest + 1)), 0.1, 0.01]
    wanted = [0.0, *(sign * m * decade for m in (1.0, 5.0, 2.0) for decade in decades for sign in (1.0, -1.0))]
    taken: list[float] = []
    for value in wanted:
        pixel = axis.to_pixel(value)
        if axis.low <= value <= axis.high and all(abs(pixel - axis.to_pixel(each)) >= smallest_gap for each in taken):
            taken.append(value)
    return [Tick(value, value_label(value, value or 1.0)) for value in sorted(taken)]


def _decade_ticks(axis: Axis, smallest_gap: float) -> list[Tick]:
    first, last = math.floor(math.log10(axis.low) + 1e-9), math.ceil(math.log10(axis.high) - 1e-9)
    gap = abs(axis.end - axis.start) / max(math.log10(axis.high / axis.low), 1e-9)
    every = max(1, math.ceil(smallest_gap / gap))
    ticks = []
    for decade in range(first, last + 1):
        label = value_label(10.0**decade, 10.0**decade) if decade % every == 0 else ""
        ticks.append(Tick(10.0**decade, label))
        if gap > 3 * smallest_gap / 2:
            ticks += [Tick(m * 10.0**decade, "") for m in range(2, 10)]
    return [tick for tick in ticks if axis.low * (1 - 1e-9) <= tick.value <= axis.high * (1 + 1e-9)]


def value_label(value: float, step: float) -> str:
    """A short number with the digits that `step` needs; powers of ten beyond four digits are written 1e6."""
    if value == 0.0:
        return "0"
    if abs(value) >= 1e5 or abs(value) < 1e-3:
        mantissa, _, exponent = f"{value:.2e}".partition("e")
        return f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}"
    decimals = max(0, -math.floor(math.log10(abs(step)) + 1e-9))
    return f"{value:.{decimals}f}"


def nice_ceiling(value: float) -> float:
    """The least 1, 1.5, 2, 3, 5, 7 × 10^k that is not below `value` (> 0)."""
    magnitude = 10.0 ** math.floor(math.log10(value))
    return next(m * magnitude for m in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0) if m * magnitude >= value * (1 - 1e-9))


def value_range(values: np.ndarray, logarithmic: bool) -> tuple[float, float]:
    """A steady range that shows all of `values`: from 0 (or the least negative) up, or at most eight decades.

    The ends are rounded to few steps so that the axis does not move under small changes of the curve.
    """
    finite = values[np.isfinite(values)]
    top = float(finite.max(initial=0.0))
    if logarithmic:
        positive = finite[finite > 0.0]
        if positive.size == 0:
            return 1e-3, 1.0
        high = 10.0 ** math.ceil(math.log10(float(positive.max())) + 0.02)
        low = 10.0 ** math.floor(math.log10(float(positive.min())) - 0.02)
        return max(low, high * 10.0**-LARGEST_LOG_SPAN, 1e-280), high
    bottom = float(finite.min(initial=0.0))
    low = -nice_ceiling(-bottom * 1.05) if bottom < 0.0 else 0.0
    if top <= 0.0:
        return low, 1.0 if low == 0.0 else 0.0
    return low, nice_ceiling(top * 1.06)


def zoomed(low: float, high: float, centre: float, factor: float, limits: tuple[float, float]) -> tuple[float, float]:
    """[low, high] scaled about `centre` by `factor` (< 1 zooms in), kept inside `limits`."""
    span = min((high - low) * factor, limits[1] - limits[0])
    share = (centre - low) / (high - low)
    start = min(max(centre - share * span, limits[0]), limits[1] - span)
    return start, start + span
