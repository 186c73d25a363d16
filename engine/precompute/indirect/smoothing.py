"""Noise taken out of what gather points reflect, by a filter that is fixed before any curve is bent.

What a gather point reflects is a sum over its rays, and so it keeps what chance had in them. Its neighbours on the same
surface have other rays: where two of them differ by no more than their noise explains, they may as well be averaged.
How much each counts is decided once, from the two halves of the rays under the materials as they are, in the manner of
filters for path tracers that take their noise from half buffers [Rousselle12; Moon14]. From then on the filter is a
sparse matrix that light is multiplied by like any other operator, so that bands, powers of an albedo and all edits stay
linear. A place without noise keeps what it is, and so does one where the filter takes away more than noise: what it
makes of one half of the rays is held against the other half, which has other noise but the same light.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.gather import object_of_rows
from engine.scene.primary_hits import PrimaryHits

N_NEIGHBOURS, _N_GUIDE = 24, 9
# Of the picture's height: how far neighbours may be.
_FARTHEST = 1.0 / 12.0
# As the lattice has it: neighbours stand off the plane by 15° at most.
_SAME_PLANE = math.sin(math.radians(15.0))
# A difference of this share is none, noise or not.
_TOLERANCE = 0.1
# Noise relative to the light: below the first nothing is filtered, above the second all that may be.
_QUIET, _LOUD = 0.02, 0.08
# Of the mean: what is darker counts as this bright.
_DARK = 0.1
# Times its expectation: less may be chance.
_CONFIDENCE = 2.0
_TINY = 1e-20


class Smoothing(NamedTuple):
    """A sparse matrix (p, q) of means: start (p + 1,) of each row's entries, neighbour (n,) and weight (n,), rows sum
    to 1; square where it is a filter."""

    start: NDArray[np.int64]
    neighbour: NDArray[np.int32]
    weight: NDArray[np.float32]

    @property
    def n_rows(self) -> int:
        return len(self.start) - 1

    def part(self, begin: int, end: int) -> Smoothing:
        """Of the points [begin, end), which have no neighbours but themselves."""
        first, last = self.start[begin], self.start[end]
        own = self.neighbour[first:last] - np.int32(begin)
        return Smoothing(self.start[begin : end + 1] - first, own, self.weight[first:last])


def no_smoothing(n_points: int) -> Smoothing:
    """Every point stands for itself."""
    return Smoothing(
        np.arange(n_points + 1, dtype=np.int64), np.arange(n_points, dtype=np.int32), np.ones(n_points, np.float32)
    )


def mean_of_sample_sets(nth: NDArray[np.uint8]) -> Smoothing:
    """What each of p points has, by all of its fans alike; nth (q,): which fan of its point each is."""
    start = np.append(np.flatnonzero(nth == 0), len(nth))
    weight = np.repeat(1.0 / np.diff(start), np.diff(start))
    return Smoothing(start, np.arange(len(nth), dtype=np.int32), weight.astype(np.float32))


def smoothing_for(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], first: NDArray[np.float32],
    second: NDArray[np.float32],
) -> Smoothing:  # fmt: skip
    """The filter for gather points at `rows` (p,), ascending, whose halves of rays reflect first and second (p, 3).

    least_alike (M,): the cosine by which normals of an object may differ.
    """
    objects = object_of_rows(hits, rows)
    starts = np.searchsorted(objects, np.arange(len(hits.object_ranges) + 1))
    dark = _DARK * float(0.5 * (first + second).sum(axis=1).mean()) if len(rows) else 0.0
    neighbours, weights = [], []
    for least, begin, end in zip(least_alike, starts[:-1], starts[1:], strict=True):
        if end - begin < 2:
            neighbours.append(np.arange(begin, end, dtype=np.int32)[:, None])
            weights.append(np.ones((end - begin, 1), np.float32))
            continue
        own = slice(int(begin), int(end))
        nearest, closeness = neighbours_of(hits, rows[own], float(least))
        neighbours.append((nearest + begin).astype(np.int32))
        weights.append(_weights(nearest, closeness, first[own], second[own], dark))
    return _sparse(neighbours, weights)


def neighbours_of(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: float
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The nearest points (p, K) in the picture of each, itself first, and how close (p, K) in [0, 1] they are; 0 beyond
    an edge."""
    from scipy.spatial import cKDTree

    _, height = hits.resolution
    places = hits.places[rows]
    order = np.arange(1, min(N_NEIGHBOURS, len(rows)) + 1)
    distance, nearest = cKDTree(places).query(places, k=order)
    normal, position = hits.normal[rows], hits.position[rows]
    alike = np.einsum("pd,pkd->pk", normal, normal[nearest])
    step = position[nearest] - position[:, None]
    off, length = np.einsum("pd,pkd->pk", normal, step), np.linalg.norm(step, axis=2)
    one_surface = (alike >= least_alike) & (abs(off) <= _SAME_PLANE * length)
    one_surface[:, 0] = True
    reach = np.minimum(1.01 * distance[:, -1:], _FARTHEST * height)
    closeness = np.maximum(1.0 - (distance / np.maximum(reach, 1.0)) ** 2, 0.0)
    return nearest, np.asarray(np.where(one_surface, closeness, 0.0), np.float32)


def _weights(
    nearest: NDArray[np.intp], closeness: NDArray[np.float32], first: NDArray[np.float32],
    second: NDArray[np.float32], dark: float,
) -> NDArray[np.float32]:  # fmt: skip
    """How much neighbours (p, K) count, each row 1 in all; the first is the point itself."""
    there = (closeness > 0.0).astype(np.float32)
    value, variance = 0.5 * (first + second), (0.5 * (first - second)) ** 2
    variance = mean_of_neighbours(variance, nearest, there)
    # What is compared are means of a few: single values would be told apart by their noise alone.
    few = there * (np.arange(there.shape[1]) < _N_GUIDE)
    guide, doubt = mean_of_neighbours(value, nearest, few), variance.sum(axis=1) / few.sum(axis=1)
    bright = guide.sum(axis=1)
    unlike = ((guide[nearest] - guide[:, None]) ** 2).sum(axis=2)
    by_chance = doubt[nearest] + doubt[:, None]
    none = (_TOLERANCE * bright[:, None]) ** 2 / 3.0
    weight = closeness * np.exp(-np.maximum(unlike - by_chance, 0.0) / (by_chance + none + _TINY))
    noise = np.sqrt(variance.sum(axis=1)) / (bright + dark + _TINY)
    share = np.clip((noise - _QUIET) / (_LOUD - _QUIET), 0.0, 1.0)[:, None]
    weight /= weight.sum(axis=1, keepdims=True)
    share *= _filter_weight(weight, nearest, few, first, second)
    weight *= share
    weight[:, :1] += 1.0 - share
    return np.asarray(weight, np.float32)


def _filter_weight(
    weight: NDArray[np.floating], nearest: NDArray[np.intp], few: NDArray[np.float32], first: NDArray[np.float32],
    second: NDArray[np.float32],
) -> NDArray[np.floating]:  # fmt: skip
    """How much of the filter pays (p, 1): v / (v + b²), v what chance is in the mean of the halves A and B, b what the
    filter F blurs.

    F A and B have chance apart: E (F A - B)² is F's error and B's variance, which (A - B)² / 2 estimates. A mirrored
    lamp of two pixels is told by these few, and looks like noise to a comparison of means.
    """
    filtered = [np.einsum("pk,pkc->pc", weight, half[nearest]) for half in (first, second)]
    crossed = 0.5 * ((filtered[0] - second) ** 2 + (filtered[1] - first) ** 2)
    chance = 0.5 * (first - second) ** 2
    crossed, chance = (mean_of_neighbours(each, nearest, few).sum(axis=1, keepdims=True) for each in (crossed, chance))
    blurred = np.maximum(crossed - _CONFIDENCE * chance, 0.0)
    return np.asarray(0.5 * chance / (0.5 * chance + blurred + _TINY), np.float64)


def mean_of_neighbours(
    values: NDArray[np.float32], nearest: NDArray[np.intp], counts: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Means (p, m) of the neighbours' values (p, m)."""
    total = np.einsum("pk,pkc->pc", counts, values[nearest])
    return np.asarray(total / counts.sum(axis=1, keepdims=True), np.float32)


def _sparse(neighbours: list[NDArray[np.int32]], weights: list[NDArray[np.float32]]) -> Smoothing:
    """Rows of all objects as one matrix, without those that do not count."""
    kept = [each > 0.0 for each in weights]
    counts = np.concatenate([each.sum(axis=1) for each in kept])
    return Smoothing(
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.concatenate([each[mine] for each, mine in zip(neighbours, kept, strict=True)]),
        np.concatenate([each[mine] for each, mine in zip(weights, kept, strict=True)]),
    )
