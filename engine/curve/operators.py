"""Edits of a 1D curve: translate and amplify, in x and in y, over regions a <= b <= c <= d [BenArtzi07, ch. 9].

An operator acts at full strength on [b, c], fades out smoothly over [a, b] and [c, d], and leaves the curve unchanged
outside [a, d]. A curve maps angles (N,) in radians to values (N, 3), one column per colour channel.

Conventions, where the source leaves a choice:

* A positive translation in x moves the curve to the right, and an amplification in x by more than 1 widens it
  about its baseline: the composed map is x - m w(x), and base + (x - base) (1 + (1/m - 1) w(x)).
* Amplification is neutral at magnitude 1, translation at 0.
* Operators apply in the order of their tuple. A diagonal drag is Y first, then X (see `diagonal`): the Y-operator
  carries the mark (`Operator.joined`), and the X-operator is right above it. Two operators that merely have equal
  parameters are no pair. An *edit* is one entry of the user's list: such a pair, or any other single operator.
* X-operators compose the curve with a map that must remain monotone, so their magnitude is clamped to the largest
  one for which it does (`largest_monotone_magnitude`). A falloff of zero width is a step; in x only steps that jump
  forwards are possible.

Falloffs are made of exp(-1/x), the textbook function that is smooth and still exactly zero on one side. Two of them
form a step whose derivatives all vanish at both ends. Rejected: sine ramps, of which only the first derivative is
continuous; and splines, because edits in the thesis preserve the character of the curve below them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.curve.tables import (
    ALL_CHANNELS,
    HALF_PI,
    LARGEST_NUMBER,
    VALUE_LIMIT,
    Channels,
    Float64Array,
    OperatorError,
    Regions,
    TabulatedCurve,
    check_regions,
    ordered_regions,
)

Curve = Callable[[Float64Array], Float64Array]

# The least factor of an amplification in x; its reciprocal is the greatest.
SMALLEST_STRETCH = 1e-3
# Narrower falloffs are steps: no distinguishable angle lies inside them.
STEP_WIDTH = 1e-12
# The largest slope of `smooth_step`, at its centre: s (1 - s) (1/t^2 + 1/(1-t)^2) at 1/2 is 8/4.
STEEPEST = 2.0


@dataclass(frozen=True)
class Operator:
    """One edit. Angles in radians; `baseline` is a value for axis "y" and an angle for axis "x".

    `joined`: this Y-operator and the X-operator above it form one diagonal edit. Raises
    OperatorError for regions out of order and for numbers that are not finite or beyond 1e12.
    """

    kind: Literal["translate", "amplify"]
    axis: Literal["x", "y"]
    a: float
    b: float
    c: float
    d: float
    magnitude: float
    baseline: float = 0.0
    channels: Channels = ALL_CHANNELS
    muted: bool = False
    joined: bool = False

    def __post_init__(self) -> None:
        if self.kind not in ("translate", "amplify") or self.axis not in ("x", "y"):
            raise OperatorError(f"kind, axis = {self.kind}, {self.axis}, expected translate|amplify and x|y")
        if not all(abs(v) <= LARGEST_NUMBER for v in (*self.regions, self.magnitude, self.baseline)):
            raise OperatorError(f"numbers of {self.kind}-{self.axis} must be finite and within {LARGEST_NUMBER:g}")
        check_regions(self.regions)
        if self.kind == "amplify" and self.axis == "x" and self.magnitude <= 0.0:
            raise OperatorError(f"magnitude of amplify-x = {self.magnitude}, expected more than 0")

    @property
    def regions(self) -> Regions:
        """(a, b, c, d), radians."""
        return (self.a, self.b, self.c, self.d)

    @property
    def neutral_magnitude(self) -> float:
        """The magnitude without effect."""
        return 1.0 if self.kind == "amplify" else 0.0

    def with_regions(
        self, a: float | None = None, b: float | None = None, c: float | None = None, d: float | None = None
    ) -> Operator:
        """The operator with some region ends moved, as `ordered_regions` does."""
        a, b, c, d = ordered_regions(self.regions, a=a, b=b, c=c, d=d)
        return dataclasses.replace(self, a=a, b=b, c=c, d=d)

    @property
    def at_limit(self) -> bool:
        """Whether any stronger magnitude would fold the curve over."""
        return self.clamp_magnitude().magnitude == largest_monotone_magnitude(self)

    def clamp_magnitude(self) -> Operator:
        """The operator with its magnitude clamped so that an X-operator remains monotone; a Y-operator unchanged."""
        if self.axis == "y":
            return self
        limit = largest_monotone_magnitude(self)
        bound = min if self.magnitude >= self.neutral_magnitude else max
        return dataclasses.replace(self, magnitude=bound(self.magnitude, limit))


Edit = Operator | TabulatedCurve


def smooth_step(t: Float64Array) -> Float64Array:
    """C-infinity step: 0 for t <= 0, 1 for t >= 1, all derivatives 0 at both ends.

    e(t) / (e(t) + e(1 - t)) with e(t) = exp(-1/t), written as (1 - tanh((1/t - 1/(1-t)) / 2)) / 2, which
    neither overflows nor divides by zero.
    """
    inside = np.minimum(np.maximum(t, 1e-3), 1.0 - 1e-3)
    return np.asarray(0.5 - 0.5 * np.tanh(0.5 / inside - 0.5 / (1.0 - inside)))


def strength(operator: Edit, x: Float64Array) -> Float64Array:
    """The weight of the operator at x: 1 on [b, c], exactly 0 outside [a, d], smooth in between [BenArtzi07, eq.
    9.2]."""
    a, b, c, d = operator.regions
    t = np.ones_like(x)
    if b - a > STEP_WIDTH:
        np.divide(x - a, b - a, out=t)
    if d - c > STEP_WIDTH:
        t = np.minimum(t, (d - x) / (d - c))
    weight = smooth_step(t)
    weight[(x < a) | (x > d)] = 0.0
    return weight


def shift(operator: Operator, x: Float64Array) -> Float64Array:
    """The position at which an X-operator evaluates the curve below for its value at x [BenArtzi07, eq. 9.3, 9.5],
    clamped to [0, pi/2]."""
    operator = operator.clamp_magnitude()
    weight = strength(operator, x)
    if operator.kind == "translate":
        moved = x - operator.magnitude * weight
    else:
        moved = operator.baseline + (x - operator.baseline) * (1.0 + (1.0 / operator.magnitude - 1.0) * weight)
    return np.where(weight > 0.0, np.minimum(np.maximum(moved, 0.0), HALF_PI), x)


def combine(operator: Edit, x: Float64Array, values: Float64Array) -> Float64Array:
    """Applies a Y-operator or a table to values (N, 3) of the curve below at x (N,) or (N, 3) [BenArtzi07, eq. 9.1,
    9.4]; a table: see `engine.curve.tables`."""
    weight = strength(operator, x)
    weight = (weight[:, None] if weight.ndim == 1 else weight) * np.array(operator.channels, dtype=float)
    if isinstance(operator, TabulatedCurve):
        changed = _combine_table(operator, weight, _evaluate(operator, x), values)
    elif operator.kind == "translate":
        changed = values + operator.magnitude * weight
    else:
        changed = values + (values - operator.baseline) * ((operator.magnitude - 1.0) * weight)
    return np.minimum(np.maximum(changed, -VALUE_LIMIT), VALUE_LIMIT)


def _combine_table(
    table: TabulatedCurve, weight: Float64Array, samples: Float64Array, values: Float64Array
) -> Float64Array:
    """A table's scaled samples (N, 3) on values of the curve below, at a weight, see `engine.curve.tables`."""
    if table.kind == "change":
        return values + weight * samples
    if table.kind == "ratio":
        return values * (1.0 + weight * (samples - table.magnitude))
    return values * (1.0 - weight) + samples * weight


@lru_cache(maxsize=256)
def largest_monotone_magnitude(operator: Operator) -> float:
    """The magnitude farthest from neutral, in the operator's direction, for which its map of x remains monotone.

    Translate-x: the map x - m w(x) falls where m w' > 1, and w' is at most 2 / (b - a) on the rising side, so 0 <= m <=
    (b - a) / 2, and likewise -(d - c) / 2 <= m < 0. Amplify-x: with k = 1/m - 1 the slope is 1 + k (w + (x - base) w'),
    so k is bounded by the extremes of the bracket; for m < 1 the result is the smallest m. A falloff beyond the ends of
    [0, pi/2] does not limit the magnitude. Y-operators have no limit: infinity.
    """
    if operator.axis == "y":
        return math.copysign(math.inf, operator.magnitude - operator.neutral_magnitude)
    return _translate_limit(operator) if operator.kind == "translate" else _amplify_limit(operator)


def _translate_limit(operator: Operator) -> float:
    """The limit for a translation in x, see `largest_monotone_magnitude`."""
    a, b, c, d = operator.regions
    if operator.magnitude >= 0.0:
        return HALF_PI if b <= 0.0 else min((b - a) / STEEPEST, HALF_PI)
    return -HALF_PI if c >= HALF_PI else max(-(d - c) / STEEPEST, -HALF_PI)


def _amplify_limit(operator: Operator) -> float:
    """The limit for an amplification in x, see `largest_monotone_magnitude`."""
    low, high = _bracket_extremes(operator)
    largest = 1.0 / SMALLEST_STRETCH
    if operator.magnitude >= 1.0:  # k = 1/m - 1 in (-1, 0]: needs k >= -1 / high
        return 1.0 if math.isinf(high) else min(high / max(high - 1.0, SMALLEST_STRETCH), largest)
    return 1.0 if math.isinf(low) else max(low / (low - 1.0), SMALLEST_STRETCH)


def _bracket_extremes(operator: Operator) -> tuple[float, float]:
    """Bounds of w + (x - base) w' over the domain; infinite at a step that an amplification could make jump."""
    a, b, c, d = operator.regions
    low, high = 0.0, 1.0
    for start, end, rise in ((a, b, 1.0), (d, c, -1.0)):
        if max(start, end) <= 0.0 or min(start, end) >= HALF_PI:
            continue
        if abs(end - start) <= STEP_WIDTH:
            lever = rise * (start - operator.baseline)
            least, most = (-math.inf if lever < 0.0 else 0.0), (math.inf if lever > 0.0 else 1.0)
        else:
            least, most = falloff_extremes(start, end, operator.baseline)
        low, high = min(low, least), max(high, most)
    return low, high


_GRID = np.linspace(0.0, 1.0, 1025)[1:-1]
_STEP = smooth_step(_GRID)
_SLOPE = _STEP * (1.0 - _STEP) * (1.0 / _GRID**2 + 1.0 / (1.0 - _GRID) ** 2)


def falloff_extremes(start: float, end: float, baseline: float) -> tuple[float, float]:
    """Least and largest w + (x - baseline) w' where w fades from 0 at `start` to 1 at `end` (start > end: leftwards).

    Widened by the error of the sampling; infinite for a step whose distance from the baseline is not zero.
    """
    width = end - start
    lever = start + _GRID * width - baseline
    bracket = _STEP + lever * _SLOPE / width
    margin = 1e-4 * float(np.max(np.abs(bracket)))
    return float(bracket.min()) - margin, float(bracket.max()) + margin


def unique_sorted(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unique values among finite values (N,), ascending.

    `np.unique` imports numpy.ma at its first call, which blocks the window's thread for 35 ms.
    """
    ordered = np.sort(values)
    return ordered[np.diff(ordered, prepend=-np.inf) > 0.0]


def helper_function(operator: Edit, x: Float64Array) -> tuple[Float64Array, Float64Array]:
    """The function that defines an operator, at x (N,), and the one that it is made of [BenArtzi07, 9.1].

    It is the operator applied to a base function: to y = 0 for a translation in y, to which the curve is then added; to
    y = 1 for an amplification in y, by which the curve's distance from its baseline is then multiplied; to y = x along
    the angle, of which the curve is then taken. Of a table it is its strength, over y = 0.
    """
    if isinstance(operator, TabulatedCurve):
        return strength(operator, x), np.zeros_like(x)
    if operator.axis == "x":
        return shift(operator, x), x
    base = np.full_like(x, operator.neutral_magnitude)
    return base + (operator.magnitude - operator.neutral_magnitude) * strength(operator, x), base


def diagonal(regions: Regions, dx: float, dy: float, channels: Channels = ALL_CHANNELS) -> tuple[Operator, Operator]:
    """A diagonal drag as two layered translations, Y first: after X the regions would no longer be in place."""
    return (
        Operator("translate", "y", *regions, magnitude=dy, channels=channels, joined=True),
        Operator("translate", "x", *regions, magnitude=dx, channels=channels),
    )


@dataclass(frozen=True)
class EditedCurve:
    """A curve with operators on top; callable like any curve, angles (N,) to values (N, 3)."""

    operators: tuple[Edit, ...]
    below: Curve

    def __call__(self, gamma: Float64Array) -> Float64Array:
        """The edited values. From the last operator down, X-operators move the position of evaluation. Then, from the
        first up, Y-operators change the value found there. Channels are evaluated separately only if an operator
        excludes one of them."""
        x: Float64Array = np.asarray(gamma, dtype=float)
        lifted: list[tuple[Edit, Float64Array]] = []
        source = self.below
        for operator in reversed(self.operators):
            if isinstance(operator, TabulatedCurve) and operator.replaces_all:
                source = operator
                break
            if operator.axis == "x":
                x = _shift_channels(operator, x)
            else:
                lifted.append((operator, x))
        values = _evaluate(source, x)
        for operator, where in reversed(lifted):
            values = combine(operator, where, values)
        return values

    @property
    def features(self) -> tuple[float, ...]:
        """Angles where the curve may bend sharply or jump: region ends, mapped through the X-operators above them."""
        places: Float64Array = np.array(getattr(self.below, "features", ()), dtype=float)
        for operator in self.operators:
            if isinstance(operator, TabulatedCurve):
                inside = [gamma for gamma in operator.gammas if operator.regions[0] < gamma < operator.regions[3]]
                places = np.concatenate([[] if operator.replaces_all else places, inside])
            if operator.axis == "x":
                places = np.concatenate([places, _inverse_shift(operator, places)])
            places = np.concatenate([places, operator.regions])
        return tuple(unique_sorted(places[(places > 0.0) & (places < HALF_PI)]).tolist())


def apply_operators(operators: Sequence[Edit], curve: Curve) -> EditedCurve:
    """The curve with all unmuted operators on top, the first of the sequence lowest."""
    return EditedCurve(tuple(operator for operator in operators if not operator.muted), curve)


def collapse(operators: Sequence[Edit], curve: Curve, tolerance: float = 1e-4, most: int = 2048) -> TabulatedCurve:
    """The edited curve as one table [BenArtzi07, 9.2]: denser where it bends, with at most about `most` samples.

    Between samples the error is about `tolerance` of the local value, or 1e-6 of the largest.
    """
    edited = apply_operators(operators, curve)
    ends = np.array([0.0, HALF_PI, *edited.features])
    spread = np.concatenate([np.linspace(0.0, HALF_PI, 65), HALF_PI * 0.5 ** np.arange(1, 18)])
    steps = np.concatenate([ends - STEP_WIDTH, ends, ends + STEP_WIDTH])
    gamma = unique_sorted(np.clip(np.concatenate([spread, steps]), 0.0, HALF_PI))
    values = edited(gamma)
    while gamma.size < most:
        middle = 0.5 * (gamma[1:] + gamma[:-1])
        found = edited(middle)
        error = np.abs(found - 0.5 * (values[1:] + values[:-1]))
        wrong = (error > tolerance * np.abs(found) + 1e-6 * np.abs(values).max()).any(axis=1)
        wrong &= np.diff(gamma) > 4.0 * STEP_WIDTH
        if not wrong.any():
            break
        order = np.argsort(np.concatenate([gamma, middle[wrong]]), kind="stable")
        gamma = np.concatenate([gamma, middle[wrong]])[order]
        values = np.concatenate([values, found[wrong]])[order]
    return TabulatedCurve(tuple(gamma.tolist()), tuple((r, g, b) for r, g, b in values.tolist()))


def _shift_channels(operator: Operator, x: Float64Array) -> Float64Array:
    """Applies `shift` to the operator's channels only; x is (N,), or (N, 3) where channels differ."""
    moved = shift(operator, x)
    if all(operator.channels):
        return moved
    columns = [np.broadcast_to(v[:, None] if v.ndim == 1 else v, (x.shape[0], 3)) for v in (moved, x)]
    return np.where(np.array(operator.channels), *columns)


def _evaluate(curve: Curve, x: Float64Array) -> Float64Array:
    """The curve at x (N,), or per channel at x (N, 3)."""
    if x.ndim == 1:
        return curve(x)
    return np.stack([curve(np.ascontiguousarray(x[:, channel]))[:, channel] for channel in range(3)], axis=-1)


def _inverse_shift(operator: Operator, places: Float64Array) -> Float64Array:
    """Maps `places` through the X-operator, to within 1/4000 of its regions' width: the inverse of `shift`."""
    lookup = np.linspace(max(operator.a, 0.0), min(max(operator.d, operator.a), HALF_PI), 4001)
    return np.interp(places, np.maximum.accumulate(shift(operator, lookup)), lookup)


def is_pair(operators: Sequence[Edit], index: int) -> bool:
    """Whether the operators at `index` and above it are Y and X of one diagonal edit."""
    if not 0 <= index < len(operators) - 1:
        return False
    low, high = operators[index], operators[index + 1]
    if not isinstance(low, Operator) or not isinstance(high, Operator) or not low.joined:
        return False
    alike = (low.kind, low.regions, low.channels) == (high.kind, high.regions, high.channels)
    return alike and (low.axis, high.axis) == ("y", "x")


def edits_of(operators: Sequence[Edit]) -> list[range]:
    """The index range of each edit, from the lowest up."""
    spans: list[range] = []
    while (start := spans[-1].stop if spans else 0) < len(operators):
        spans.append(range(start, start + (2 if is_pair(operators, start) else 1)))
    return spans


def edit_at(operators: Sequence[Edit], index: int) -> range:
    """The index range of the edit that the operator at `index` belongs to; raises IndexError if there is none."""
    return next(span for span in edits_of(operators) if range(len(operators))[index] in span)


def move_edit(operators: Sequence[Edit], index: int, to: int) -> tuple[Edit, ...]:
    """The operators with the edit at `index` moved to the place of the edit at `to`; pairs remain adjacent."""
    edits = [tuple(operators[k] for k in span) for span in edits_of(operators)]
    places = edits_of(operators)
    target = places.index(edit_at(operators, to))
    edits.insert(target, edits.pop(places.index(edit_at(operators, index))))
    return tuple(operator for edit in edits for operator in edit)
