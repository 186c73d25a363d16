"""How many fans of rays each gather point gets: further ones where the first is noisy, and the picture shows it.

Chance in what a point reflects is told by the two halves of its first fan [Rousselle12]. With n_i fans, which are parts
of one Sobol sequence, the picture's squared error is about Σ_i s_i σ_i² n_i^(-3/2), s_i how much of the picture the
point stands for; of all n_i with one sum it is least where n_i is as (s_i σ_i²)^(2/5). A point's own halves are too few
to tell σ_i, and a fan that found little by chance would be content with it, which makes pictures darker: so the squares
of the differences are averaged over the neighbours on the same surface first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.indirect.gather import MOST_FANS, object_of_rows
from engine.indirect.smoothing import mean_of_neighbours, neighbours_of
from engine.scene.hits import PrimaryHits

_POWER = 0.4
_STEPS = 40  # of a bisection


def fans_of_points(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], noise: NDArray[np.float32],
    shown: NDArray[np.float64], mean: float,
) -> NDArray[np.int64]:  # fmt: skip
    """How many fans (p,), 1 to MOST_FANS and `mean` on average, for gather points at `rows` (p,), ascending.

    noise (p, 3): what the halves of their first fans tell; shown (p,): the sum of the squares of the weights with which
    pixels take their light; least_alike (M,): the cosine by which normals of an object may differ.
    """
    if not len(rows):
        return np.zeros(0, np.int64)
    worth = (np.maximum(shown, 0.0) * _calmed(hits, rows, least_alike, noise)) ** _POWER
    return _rounded(_shared_out(worth, mean))


def _calmed(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], noise: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Variances (p,), over all colours, as means of neighbours."""
    variance = np.zeros(len(rows))
    objects = object_of_rows(hits, rows)
    starts = np.searchsorted(objects, np.arange(len(hits.object_ranges) + 1))
    for least, begin, end in zip(least_alike, starts[:-1], starts[1:], strict=True):
        if begin < end:
            nearest, closeness = neighbours_of(hits, rows[begin:end], float(least))
            own = mean_of_neighbours(noise[begin:end] ** 2, nearest, (closeness > 0.0).astype(np.float32))
            variance[begin:end] = own.sum(axis=1)
    return variance


def _shared_out(worth: NDArray[np.float64], mean: float) -> NDArray[np.float64]:
    """Numbers (p,) as worth (p,), but from 1 to MOST_FANS, `mean` on average; even where all is worth nothing."""
    worth = worth + 1e-6 * worth.mean() + 1e-30
    low, high = 0.0, MOST_FANS / worth.min()
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        enough = np.clip(middle * worth, 1.0, MOST_FANS).mean() >= mean
        low, high = (low, middle) if enough else (middle, high)
    return np.clip(high * worth, 1.0, MOST_FANS)


def _rounded(numbers: NDArray[np.float64]) -> NDArray[np.int64]:
    """Whole numbers whose sums, from the first on, are as theirs: what one lacks the next has."""
    return np.diff(np.floor(np.cumsum(numbers) + 0.5), prepend=0.0).astype(np.int64).clip(1, MOST_FANS)
