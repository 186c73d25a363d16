"""The difference of an object's picture with two materials, by path tracing, without the noise.

Both materials are traced by the same random numbers, in two halves that are independent of each other. With differences
d_1 and d_2 of the halves,

    relRMSE = sqrt(mean d_1 d_2) / mean of the original's picture,

as E d_1 d_2 is the square of the true difference: noise, which is independent, does not count. A sum below 0, which is
noise about a difference of 0, is 0. Radiance is clamped at the original's 99.9th percentile, as in every relRMSE.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress, map_steps
from engine.inverse.highlight_brush import evenly
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.reference.path_tracer import trace_halves
from engine.render.picture_difference import CLAMP_PERCENTILE

N_POINTS, N_SAMPLES = 1024, 64


def placed_error(
    placement: Placement, layers_of: Mapping[int, Sequence[Layer]], i_object: int, original: Sequence[Layer],
    matched: Sequence[Layer], sky: SkyState, n_bounces: int = 1, n_points: int = N_POINTS, n_samples: int = N_SAMPLES,
) -> Generator[float, None, float | None]:  # fmt: skip
    """relRMSE of the picture of an object, over points spread evenly over its pixels; a generator of the share that is
    done. layers_of: those of all objects; None where no pixel sees the object, or the original is black there."""
    rows = evenly(placement.rows_of(i_object), n_points)
    if not rows.size:
        return None
    halves = []
    for i, layers in enumerate((original, matched)):
        there = {**layers_of, i_object: tuple(layers)}
        tracing = trace_halves(placement, there, sky, n_bounces, n_samples, 0, rows)
        found = yield from map_steps(tracing, partial(_share, i))
        halves.append(found[:, :, 1])
    return error_of_halves(*halves)


def _share(i_picture: int, step: StillProgress) -> float:
    """The share of both pictures."""
    return 0.5 * (i_picture + step.fraction)


def error_of_halves(original: NDArray[np.floating], matched: NDArray[np.floating]) -> float | None:
    """relRMSE of the halves (2, p, 3) of two pictures; None where the original is black."""
    top = np.percentile(original.mean(axis=0), CLAMP_PERCENTILE)
    if not top > 0.0:
        return None
    original, matched = np.minimum(original, top), np.minimum(matched, top)
    one, two = matched - original
    return float(np.sqrt(max(float(np.mean(one * two)), 0.0)) / original.mean())
