"""What a user draws on a curve: freehand strokes, and control points that are added, moved and removed.

Each makes a `TabulatedCurve`, one operator. Where the channels of the curve below differ, what is drawn is the height
of the largest of the edited channels; the others keep their ratio to it, so that a drawn highlight keeps its colour.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from engine.curve.tables import (
    ALL_CHANNELS,
    HALF_PI,
    LEAST_GAP,
    Channels,
    Float64Array,
    Regions,
    TabulatedCurve,
    Triple,
)

# Samples of a stroke; over 90 degrees they are 0.35 degrees apart.
MOST_SAMPLES = 257
# Standard deviation of the smoothing, and width of the falloff beside a stroke or the outer points, as shares of the
# angle that is shown (of 90 degrees in a script).
SMOOTHING, FALLOFF = 0.008, 0.06
# A Gaussian beyond so many standard deviations is less than 3e-4.
KERNEL_REACH = 4.0


def follow_pointer(path: Sequence[tuple[float, float]], n_samples: int) -> tuple[Float64Array, Float64Array]:
    """What a pointer drew along its path of (x, y): increasing x (S,) and y (S,), S at most `n_samples`.

    Between two places the stroke is straight. Where the pointer goes back, what it drew last counts.
    """
    xs = np.array([x for x, _ in path])
    low, high = float(xs.min()), float(xs.max())
    if high <= low:
        return np.array([low]), np.array([path[-1][1]])
    x = np.linspace(low, high, n_samples)
    places = np.array(path, dtype=float)
    (x0, y0), (x1, y1) = places[:-1].T, places[1:].T
    # The last part of the path over each x; a rise in place counts by its end.
    over = (np.minimum(x0, x1)[:, None] <= x) & (x <= np.maximum(x0, x1)[:, None])
    last = len(x0) - 1 - np.argmax(over[::-1], axis=0)
    width = (x1 - x0)[last]
    share = np.divide(x - x0[last], width, out=np.ones_like(x), where=width != 0.0)
    return x, y0[last] + share * (y1 - y0)[last]


def smooth(y: Float64Array, deviation: float) -> Float64Array:
    """Evenly spaced values (S,) convolved with a Gaussian of this standard deviation, in samples.

    Beyond its ends the stroke is continued by its point reflection there, so that its ends remain in place, and a
    straight stroke remains straight.
    """
    reach = min(int(np.ceil(KERNEL_REACH * deviation)), y.size - 1)
    if reach < 1:
        return y
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    before = 2.0 * y[0] - y[reach:0:-1]
    after = 2.0 * y[-1] - y[-2 : -reach - 2 : -1]
    return np.convolve(np.concatenate([before, y, after]), kernel / kernel.sum(), mode="valid")


def stroke(
    gammas: Float64Array, heights: Float64Array, below: Float64Array, falloff: float, channels: Channels = ALL_CHANNELS
) -> TabulatedCurve:
    """A stroke through heights (S,) at increasing angles (S,), over a curve with the values `below` (S, 3) there; it
    goes over into that curve within `falloff` radians on either side."""
    values = coloured(heights, below, channels)
    regions = _regions_about(float(gammas[0]), float(gammas[-1]), falloff)
    return TabulatedCurve(tuple(gammas.tolist()), _triples(values), False, "stroke", regions, channels=channels)


def coloured(heights: Float64Array, below: Float64Array, channels: Channels) -> Float64Array:
    """Values (S, 3) whose largest among the channels is the height (S,), in the ratios of the values `below` (S, 3);
    equal values where none of those is above 0."""
    edited = np.where(np.array(channels), np.maximum(below, 0.0), 0.0)
    largest = edited.max(axis=1, keepdims=True)
    ratios = np.divide(edited, largest, out=np.ones_like(edited), where=largest > 0.0)
    return heights[:, None] * np.where(np.array(channels), ratios, 1.0)


def first_point(
    gamma: float, height: float, below: Float64Array, falloff: float, channels: Channels = ALL_CHANNELS
) -> TabulatedCurve:
    """One control point at an angle, over a curve with the values `below` (3,) there."""
    values = coloured(np.array([height]), below[None], channels)
    regions = _regions_about(gamma, gamma, falloff)
    return TabulatedCurve((gamma,), _triples(values), False, "points", regions, channels=channels)


def through_points(
    gammas: Sequence[float], values: Sequence[Triple], falloff: float, channels: Channels = ALL_CHANNELS
) -> TabulatedCurve:
    """Control points at increasing angles. Raises OperatorError."""
    if not gammas:
        return TabulatedCurve((), ())
    regions = _regions_about(gammas[0], gammas[-1], falloff)
    return TabulatedCurve(tuple(gammas), tuple(values), False, "points", regions, channels=channels)


def add_point(points: TabulatedCurve, gamma: float, height: float, below: Float64Array) -> tuple[TabulatedCurve, int]:
    """The control points with one more, and its index; at the angle of another it takes that one's place.

    below (3,): the curve without these points there, whose colour it has outside of them; inside it has theirs.
    """
    near = [i for i, each in enumerate(points.gammas) if abs(each - gamma) < LEAST_GAP]
    if near:
        return move_point(points, near[0], points.gammas[near[0]], height), near[0]
    inside = points.gammas[0] <= gamma <= points.gammas[-1]
    colour = _unscaled(points)(np.array([gamma])) if inside else below[None]
    (value,) = _triples(coloured(np.array([height]), colour, points.channels))
    i = int(np.searchsorted(points.gammas, gamma))
    gammas = (*points.gammas[:i], gamma, *points.gammas[i:])
    values = (*points.values[:i], value, *points.values[i:])
    return _with_points(points, gammas, values), i


def move_point(points: TabulatedCurve, index: int, gamma: float, height: float) -> TabulatedCurve:
    """The control points with one moved: between its neighbours, and to a height of its largest channel."""
    gammas, values = list(points.gammas), list(points.values)
    low = gammas[index - 1] + LEAST_GAP if index > 0 else 0.0
    high = gammas[index + 1] - LEAST_GAP if index + 1 < len(gammas) else HALF_PI
    if low <= high:
        gammas[index] = min(max(gamma, low), high)
    if height != point_height(points, index):
        old = np.array(values[index])[None]
        (values[index],) = _triples(coloured(np.array([height]), old, points.channels))
    return _with_points(points, tuple(gammas), tuple(values))


def remove_point(points: TabulatedCurve, index: int) -> TabulatedCurve | None:
    """The control points without one; None where it was the last."""
    if len(points.gammas) == 1:
        return None
    gammas = (*points.gammas[:index], *points.gammas[index + 1 :])
    return _with_points(points, gammas, (*points.values[:index], *points.values[index + 1 :]))


def point_height(points: TabulatedCurve, index: int) -> float:
    """The value of a control point in the largest of the channels that are edited."""
    return max(v for v, on in zip(points.values[index], points.channels, strict=True) if on or not any(points.channels))


def _with_points(points: TabulatedCurve, gammas: tuple[float, ...], values: tuple[Triple, ...]) -> TabulatedCurve:
    """Other control points; where the outer ones have moved, the region's ends move with them."""
    left, right = gammas[0] - points.gammas[0], gammas[-1] - points.gammas[-1]
    by = (left, left, right, right)
    a, b, c, d = (min(max(end + step, 0.0), HALF_PI) for end, step in zip(points.regions, by, strict=True))
    if b > c:
        b, c = gammas[0], gammas[-1]
    regions = (min(a, b), b, c, max(c, d))
    return dataclasses.replace(points, gammas=gammas, values=values, regions=regions)


def _unscaled(points: TabulatedCurve) -> TabulatedCurve:
    return dataclasses.replace(points, magnitude=1.0)


def _regions_about(low: float, high: float, falloff: float) -> Regions:
    return max(low - falloff, min(low, 0.0)), low, high, min(high + falloff, max(high, HALF_PI))


def _triples(values: Float64Array) -> tuple[Triple, ...]:
    return tuple((r, g, b) for r, g, b in values.tolist())
