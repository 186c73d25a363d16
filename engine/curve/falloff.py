"""The smooth step by which operators fade in and out, and the bounds of its slope.

exp(-1/x) is the textbook function that is smooth and still exactly zero on one side. Two of them form a step whose
derivatives all vanish at both ends [BenArtzi07, ch. 9]. Sine ramps were rejected: only their first derivative is
continuous.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

# Narrower falloffs are steps: no distinguishable angle lies inside them.
STEP_WIDTH = 1e-12
# The largest slope of `smooth_step`, at its centre: s (1 - s) (1/t^2 + 1/(1-t)^2) at 1/2 is 8/4.
STEEPEST = 2.0


def smooth_step(t: Float64Array) -> Float64Array:
    """C-infinity step: 0 for t <= 0, 1 for t >= 1, all derivatives 0 at both ends.

    e(t) / (e(t) + e(1 - t)) with e(t) = exp(-1/t), written as (1 - tanh((1/t - 1/(1-t)) / 2)) / 2, which
    neither overflows nor divides by zero.
    """
    inside = np.minimum(np.maximum(t, 1e-3), 1.0 - 1e-3)
    return np.asarray(0.5 - 0.5 * np.tanh(0.5 / inside - 0.5 / (1.0 - inside)))


_GRID = np.linspace(0.0, 1.0, 1025)[1:-1]
_STEP = smooth_step(_GRID)
_SLOPE = _STEP * (1.0 - _STEP) * (1.0 / _GRID**2 + 1.0 / (1.0 - _GRID) ** 2)


def lever_extremes(start: float, end: float, baseline: float) -> tuple[float, float]:
    """Least and largest w + (x - baseline) w' where w fades from 0 at `start` to 1 at `end` (start > end: leftwards).

    Widened by the error of the sampling; infinite for a step whose distance from the baseline is not zero.
    """
    width = end - start
    lever = start + _GRID * width - baseline
    bracket = _STEP + lever * _SLOPE / width
    margin = 1e-4 * float(np.max(np.abs(bracket)))
    return float(bracket.min()) - margin, float(bracket.max()) + margin
