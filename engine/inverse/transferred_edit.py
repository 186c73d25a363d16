"""The change that was drawn on one curve, as an operator for another.

With f and f' a curve below and above its operators, and g the other curve, the changed g is

    absolute   g + (f' - f)
    relative   g + (f' - f) max g / max f       the change as a share of the highlight's middle
    ratio      g f' / f                         the same number of stops at each angle

A ratio is a sum of logarithms: it keeps what it finds in its own proportions, and makes nothing of nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from engine.curve.operators import EditedCurve, collapse, unique_sorted
from engine.curve.tables import HALF_PI, Float64Array, TabulatedCurve
from engine.material.layer import Layer

Measure = Literal["absolute", "relative", "ratio"]
MEASURES: tuple[Measure, ...] = get_args(Measure)
# A ratio of a curve that is less than this share of its largest value is one of noise: it is that of this share.
_LEAST_SHARE = 1e-6
_MOST_RATIO = 1e6


def transferred_edit(source: Layer, target: Layer, factor: str, measure: Measure) -> TabulatedCurve | None:
    """The operator that does to a curve of `target` what its operators do to the curve of `source`; None where they do
    nothing."""
    below, above = (
        source.generated_curve(factor),
        EditedCurve(tuple(each for each in source.operators(factor) if not each.muted), source.generated_curve(factor)),
    )
    gamma = _angles(source, factor, below)
    before, after = below(gamma), np.maximum(above(gamma), 0.0)
    if np.array_equal(before, after):
        return None
    values, kind = after - before, "change"
    if measure == "ratio":
        least = _LEAST_SHARE * max(float(before.max()), 1e-300)
        values, kind = np.clip(np.maximum(after, least) / np.maximum(before, least), 0.0, _MOST_RATIO), "ratio"
    elif measure == "relative":
        values = values * _largest(target.generated_curve(factor), gamma) / max(float(before.max()), 1e-300)
    triples = tuple((float(r), float(g), float(b)) for r, g, b in values)
    return TabulatedCurve(tuple(gamma.tolist()), triples, kind=kind)  # type: ignore[arg-type]


def _angles(source: Layer, factor: str, below: Callable[[Float64Array], Float64Array]) -> Float64Array:
    """Angles at which both curves are known by lines between their values."""
    edited = collapse(source.operators(factor), below, most=512).gammas
    generated = collapse((), below, most=512).gammas
    return unique_sorted(np.clip(np.array([*edited, *generated, 0.0, HALF_PI]), 0.0, HALF_PI))


def _largest(curve: Callable[[Float64Array], Float64Array], gamma: Float64Array) -> float:
    return float(np.maximum(curve(gamma), 0.0).max())
