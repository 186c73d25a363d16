"""Curves given by samples: tables, freehand strokes and control points, each as one operator on a curve.

Beside translate and amplify [BenArtzi07, ch. 9] a user draws (fig. 4.4 d, 4.5 c) or loads the values that a curve is to
have. Where a table t acts at full strength, in [b, c], the curve has the table's values. Over [a, b] and [c, d] it goes
over smoothly into what is below, with the strength w of any operator, and outside [a, d] nothing changes:

    f(x) + w(x) (m t(x) - f(x)),   m the magnitude, which scales the table.

Two kinds keep what is below, as edits of a curve that were solved for or come from another curve do [docs/inverse.md]:
a *change* t is added, and a *ratio* t multiplies,

    f(x) + w(x) m t(x),   f(x) (1 + w(x) m (t(x) - 1)).

Between the samples of a table or a stroke, values are linear. Between control points they are monotone cubics [Fritsch
and Butland 1984]: a curve through points that rise nowhere falls, so that no point has to be corrected for what
another one did ("counter-editing", [BenArtzi07, 9.3]). Rejected: natural cubic splines, which overshoot.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Channels = tuple[bool, bool, bool]
Regions = tuple[float, float, float, float]
Triple = tuple[float, float, float]
TableKind = Literal["curve", "stroke", "points", "change", "ratio"]
TABLE_KINDS: tuple[TableKind, ...] = ("curve", "stroke", "points", "change", "ratio")

HALF_PI = math.pi / 2
EVERYWHERE: Regions = (0.0, 0.0, HALF_PI, HALF_PI)
ALL_CHANNELS: Channels = (True, True, True)
# Values of a curve are clamped to this magnitude, so that any stack of operators is finite in single precision.
VALUE_LIMIT = 1e18
LARGEST_NUMBER = 1e12
# Control points keep this distance, radians: a hundredth of a degree is less than a pixel.
LEAST_GAP = 1e-4


class OperatorError(ValueError):
    """An invalid operator or table: regions out of order, or numbers that are not finite."""


def check_regions(regions: Regions) -> None:
    """Raises OperatorError unless a <= b <= c <= d, numbers within 1e12."""
    if not all(abs(end) <= LARGEST_NUMBER for end in regions):
        raise OperatorError(f"regions = {regions}, expected finite numbers within {LARGEST_NUMBER:g}")
    a, b, c, d = regions
    if not a <= b <= c <= d:
        raise OperatorError(f"regions = {regions}, expected a <= b <= c <= d")


def ordered_regions(regions: Regions, **wanted: float | None) -> Regions:
    """The regions with some of the ends a, b, c, d moved; other ends move along to preserve the order.

    Moving b past c moves c (and d) too, so that any drag of one handle gives valid regions.
    """
    ends = list(regions)
    for name, to in wanted.items():
        if to is None:
            continue
        i = "abcd".index(name)
        ends[i] = to
        ends[:i] = [min(end, to) for end in ends[:i]]
        ends[i + 1 :] = [max(end, to) for end in ends[i + 1 :]]
    return ends[0], ends[1], ends[2], ends[3]


@dataclass(frozen=True)
class TabulatedCurve:
    """Samples in place of the curve below, or a change of it, in a region. By default that is everywhere: "collapse"
    replaces all operators below by one.

    `gammas` (S,) radians that do not decrease, at least 1e-6 apart for "points"; `values` S triples; `kind`: "curve" a
    table, "stroke" what was drawn, "points" control points, "change" values that are added to the curve below, "ratio"
    factors of it; `magnitude` scales the values, or how far the factors are from 1; 1 leaves them. Raises
    OperatorError.
    """

    gammas: tuple[float, ...]
    values: tuple[Triple, ...]
    muted: bool = False
    kind: TableKind = "curve"
    regions: Regions = EVERYWHERE
    magnitude: float = 1.0
    channels: Channels = ALL_CHANNELS

    # What it has in common with an amplification of what it holds.
    axis: Literal["y"] = dataclasses.field(default="y", init=False, repr=False)
    baseline: float = dataclasses.field(default=0.0, init=False, repr=False)
    neutral_magnitude: float = dataclasses.field(default=1.0, init=False, repr=False)

    def __post_init__(self) -> None:
        if len(self.gammas) != len(self.values) or not self.gammas:
            raise OperatorError(f"{len(self.gammas)} angles for {len(self.values)} values, expected as many")
        if self.kind not in TABLE_KINDS:
            raise OperatorError(f"kind = {self.kind}, expected {', '.join(TABLE_KINDS[:-1])} or {TABLE_KINDS[-1]}")
        if any(len(value) != 3 for value in self.values) or not (abs(_samples(self)[1]) <= VALUE_LIMIT).all():
            raise OperatorError(f"values of a tabulated curve must be triples of numbers within {VALUE_LIMIT:g}")
        gammas = _samples(self)[0]
        if not (abs(gammas) <= LARGEST_NUMBER).all() or (np.diff(gammas) < 0).any():
            raise OperatorError("angles of a tabulated curve must be finite and not decrease")
        if self.kind == "points" and (np.diff(gammas) < 0.01 * LEAST_GAP).any():
            raise OperatorError("angles of control points must increase")
        check_regions(self.regions)
        if not abs(self.magnitude) <= LARGEST_NUMBER:
            raise OperatorError(f"magnitude of a table = {self.magnitude}, expected a number within {LARGEST_NUMBER:g}")

    @property
    def replaces(self) -> bool:
        """Whether it has the values that the curve is to have, and not those of a change or a ratio."""
        return self.kind not in ("change", "ratio")

    @property
    def replaces_all(self) -> bool:
        """Whether nothing is left of the curve below."""
        return self.replaces and self.regions[1] <= 0.0 and self.regions[2] >= HALF_PI and all(self.channels)

    def with_regions(
        self, a: float | None = None, b: float | None = None, c: float | None = None, d: float | None = None
    ) -> TabulatedCurve:
        """The table in another region; its samples remain in place."""
        return dataclasses.replace(self, regions=ordered_regions(self.regions, a=a, b=b, c=c, d=d))

    def clamp_magnitude(self) -> TabulatedCurve:
        """Itself: what acts in y has no limit."""
        return self

    def moved(self, by: float) -> TabulatedCurve:
        """The table with samples and region moved by so many radians."""
        a, b, c, d = (end + by for end in self.regions)
        return dataclasses.replace(
            self, gammas=tuple(gamma + by for gamma in self.gammas), regions=(a, b, c, d)
        )  # fmt: skip

    def __call__(self, gamma: Float64Array) -> Float64Array:
        """The table's values (N, 3) at angles (N,), scaled; constant beyond the ends."""
        gammas, values = _samples(self)
        if self.kind == "points":
            found = _cubic(gammas, values, _slopes(self), gamma)
        else:
            found = np.stack([np.interp(gamma, gammas, values[:, channel]) for channel in range(3)], axis=-1)
        return found if self.magnitude == 1.0 else np.clip(self.magnitude * found, -VALUE_LIMIT, VALUE_LIMIT)


@lru_cache(maxsize=64)
def _samples(table: TabulatedCurve) -> tuple[Float64Array, Float64Array]:
    return np.array(table.gammas, dtype=float), np.array(table.values, dtype=float).reshape(-1, 3)


@lru_cache(maxsize=64)
def _slopes(table: TabulatedCurve) -> Float64Array:
    return monotone_slopes(*_samples(table))


def monotone_slopes(x: Float64Array, values: Float64Array) -> Float64Array:
    """Slopes (S, 3) at increasing x (S,), for which cubics between the values (S, 3) are monotone.

    Inside: the harmonic mean of the secants beside x, weighted by their widths; 0 where they differ in sign. At the
    ends: the parabola through three points, as far as that is monotone [Fritsch and Butland 1984].
    """
    if x.size == 1:
        return np.zeros_like(values)
    width = np.diff(x)[:, None]
    secant = np.diff(values, axis=0) / width
    if x.size == 2:
        return np.repeat(secant, 2, axis=0)
    slopes = np.zeros_like(values)
    before, after = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    alike = secant[:-1] * np.sign(secant[1:]) > 0.0
    left, right = (np.where(alike, each, 1.0) for each in (secant[:-1], secant[1:]))
    slopes[1:-1] = np.where(alike, (before + after) / (before / left + after / right), 0.0)
    slopes[0] = _end_slope(width[0], width[1], secant[0], secant[1])
    slopes[-1] = _end_slope(width[-1], width[-2], secant[-1], secant[-2])
    return slopes


def _end_slope(
    width: Float64Array, next_width: Float64Array, secant: Float64Array, after: Float64Array
) -> Float64Array:
    slope = ((2.0 * width + next_width) * secant - width * after) / (width + next_width)
    slope = np.where(np.sign(slope) != np.sign(secant), 0.0, slope)
    too_steep = (np.sign(secant) != np.sign(after)) & (np.abs(slope) > 3.0 * np.abs(secant))
    return np.where(too_steep, 3.0 * secant, slope)


def _cubic(nodes: Float64Array, values: Float64Array, slopes: Float64Array, x: Float64Array) -> Float64Array:
    """Hermite's cubic through the values with these slopes, (N, 3), constant beyond the ends."""
    if nodes.size == 1:
        return np.repeat(values, x.size, axis=0)
    i = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    width = (nodes[i + 1] - nodes[i])[:, None]
    t = np.clip((x[:, None] - nodes[i][:, None]) / width, 0.0, 1.0)
    rise = t * t * (3.0 - 2.0 * t)
    bends = width * t * (1.0 - t) * ((1.0 - t) * slopes[i] - t * slopes[i + 1])
    return np.asarray(values[i] * (1.0 - rise) + values[i + 1] * rise + bends)
