"""Adaptive resampling: extra sample sets at gather points that are noisy and visible in the picture.

The two halves of a point's first sample set measure its noise [Rousselle12]. One point's halves are too few for a
reliable estimate, and a set that found little light by chance would look converged, which darkens pictures. Squared
differences are therefore averaged over neighbours on the same surface first, and so is the light they are compared
with. Samples are only added: redistributing the same number of rays by noise gained nothing in built-in rooms (a
stairwell 1.72 to 1.74 %, `ajar` 4.20 to 4.15 %) and lost on a tea tray (2.58 to 2.84 %), whose gloss the first pass
omits. In a room lit only through a slit of 6 cm, twice the rays reduce an error of 14 % to 10 %, four times to 7 %.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.gather import MAX_SAMPLE_SETS, object_of_rows
from engine.precompute.indirect.smoothing import mean_of_neighbours, neighbours_of
from engine.scene.primary_hits import PrimaryHits

# Noise relative to the light: above the first a point gets one extra sample set, above the second the most. Of a
# hundred points of cornell, stairwell, storeroom and room none exceeds the first, of `ajar` 0.4, of teatray 5.
NOISY, VERY_NOISY = 0.1, 0.2
# Fraction of the mean that is added to the light, so that dark points count less.
_DARK = 0.25
_TINY = 1e-30


def extra_sample_sets(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], light: NDArray[np.float32],
    noise: NDArray[np.float32], shown: NDArray[np.float64], most: float,
) -> NDArray[np.int64]:  # fmt: skip
    """The number of extra sample sets (p,), 0 to MAX_SAMPLE_SETS - 1, of gather points at `rows` (p,), ascending.

    light and noise (p, 3): the mean and half the difference of the halves of their first sets; shown (p,): the sum of
    squared weights with which pixels use their light; most: extra sets in all, per point; least_alike (M,): the least
    cosine between the normals of neighbours on an object.
    """
    relative = np.sqrt(np.minimum(shown, 1.0)) * relative_noise(hits, rows, least_alike, light, noise)
    requested = (relative > NOISY) + (MAX_SAMPLE_SETS - 2) * (relative > VERY_NOISY).astype(np.int64)
    return _within_budget(requested, shown * relative, int(most * len(rows)))


def relative_noise(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], light: NDArray[np.float32],
    noise: NDArray[np.float32],
) -> NDArray[np.float64]:  # fmt: skip
    """Noise over light (p,), both averaged over neighbours."""
    relative = np.zeros(len(rows))
    objects = object_of_rows(hits, rows)
    starts = np.searchsorted(objects, np.arange(len(hits.object_ranges) + 1))
    dark = _DARK * float(light.mean(axis=0).sum()) if len(rows) else 0.0
    for least, begin, end in zip(least_alike, starts[:-1], starts[1:], strict=True):
        if begin < end:
            nearest, closeness = neighbours_of(hits, rows[begin:end], float(least))
            there = (closeness > 0.0).astype(np.float32)
            own, chance = (each[begin:end].sum(axis=1, keepdims=True) for each in (light, noise))
            bright, variance = (mean_of_neighbours(each, nearest, there)[:, 0] for each in (own, chance**2))
            relative[begin:end] = np.sqrt(variance) / (bright + dark + _TINY)
    return relative


def _within_budget(requested: NDArray[np.int64], worth: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Limits the requested sample sets (p,) to `most` in all: every point's first extra set before any second one, and
    where these are too many, those of the greatest worth (p,)."""
    given = np.zeros_like(requested)
    order = np.argsort(-worth, kind="stable")
    for wanted in (np.minimum(requested, 1), requested - np.minimum(requested, 1)):
        in_turn = wanted[order]
        given[order] += np.clip(most - given.sum() - (np.cumsum(in_turn) - in_turn), 0, in_turn)
    return given
