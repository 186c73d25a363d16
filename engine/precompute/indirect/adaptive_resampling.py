"""How many further fans of rays gather points ask for: where the first one is noisy and the picture shows it.

Chance in what a point reflects is told by the two halves of its first fan [Rousselle12]. A point's own halves are too
few to tell it, and a fan that found little by chance would be content with that, which makes pictures darker: so
squares of differences are averaged over the neighbours on the same surface first, and so is the light that they are
held against. Nothing is ever taken away: as many rays shared out anew by noise brought built-in rooms nothing (a
stairwell 1.72 to 1.74 %, `ajar` 4.20 to 4.15 %), and a tea tray, whose gloss the first look leaves out, lost (2.58 to
2.84 %). In a room that is lit through a slit of 6 cm alone, twice the rays make 14 % of error 10 %, four times 7 %.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.gather import MAX_SAMPLE_SETS, object_of_rows
from engine.precompute.indirect.smoothing import mean_of_neighbours, neighbours_of
from engine.scene.primary_hits import PrimaryHits

# Noise relative to the light: above the first a point asks for one further fan, above the second for as many as it may.
# Of a hundred points of cornell, stairwell, storeroom and room none is above the first, of `ajar` 0.4, of teatray 5.
NOISY, VERY_NOISY = 0.1, 0.2
# Of the mean: what is darker counts as this much brighter.
_DARK = 0.25
_TINY = 1e-30


def extra_sample_sets(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], light: NDArray[np.float32],
    noise: NDArray[np.float32], shown: NDArray[np.float64], most: float,
) -> NDArray[np.int64]:  # fmt: skip
    """How many further fans (p,), 0 to MOST_FANS - 1, gather points at `rows` (p,), ascending, ask for.

    light and noise (p, 3): the mean and half the difference of the halves of their first fans; shown (p,): the sum of
    the squares of the weights with which pixels take their light; most: further fans in all, a point; least_alike (M,):
    the cosine by which normals of an object may differ.
    """
    relative = np.sqrt(np.minimum(shown, 1.0)) * relative_noise(hits, rows, least_alike, light, noise)
    asked = (relative > NOISY) + (MAX_SAMPLE_SETS - 2) * (relative > VERY_NOISY).astype(np.int64)
    return _within_budget(asked, shown * relative, int(most * len(rows)))


def relative_noise(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], light: NDArray[np.float32],
    noise: NDArray[np.float32],
) -> NDArray[np.float64]:  # fmt: skip
    """Noise over light (p,), both as means of neighbours."""
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


def _within_budget(asked: NDArray[np.int64], worth: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Of the fans (p,) that are asked for no more than `most` in all: every point's first of them before its others,
    and where these are too many, those that are worth (p,) most."""
    given = np.zeros_like(asked)
    order = np.argsort(-worth, kind="stable")
    for wanted in (np.minimum(asked, 1), asked - np.minimum(asked, 1)):
        in_turn = wanted[order]
        given[order] += np.clip(most - given.sum() - (np.cumsum(in_turn) - in_turn), 0, in_turn)
    return given
