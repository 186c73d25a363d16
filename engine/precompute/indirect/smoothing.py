"""The noise in the reflected light of gather points: a linear filter that removes it and does not depend on edits, and
extra sample sets where it is strong.

The light of a gather point is a sum over its rays and contains their noise. Neighbours on the same surface have other
rays: where two of them differ by no more than their noise explains, they may be averaged. The filter weights are
computed once, from the two halves of the rays under the current materials, like filters for path tracers that estimate
noise from half buffers [Rousselle12; Moon14]. From then on the filter is a sparse matrix like any other operator, so
that bands, powers of an albedo and all edits remain linear. A point without noise is not filtered, and neither is one
where the filter removes more than noise: the filtered first half of the rays is compared with the second half, which
has the same light and independent noise.

Adaptive resampling: points that are noisy and visible in the picture get extra sample sets. One point's halves are too
few for a reliable estimate, and a set that found little light by chance would look converged, which darkens pictures.
Squared differences are therefore averaged over neighbours on the same surface first, and so is the light they are
compared with. Samples are only added: redistributing the same number of rays by noise gained nothing in built-in rooms
(a stairwell 1.72 to 1.74 %, `ajar` 4.20 to 4.15 %) and lost on a tea tray (2.58 to 2.84 %), whose gloss the first pass
omits. A still asks for less noise in gloss: with 0.4 of it and four times the photons the reference tea tray is 1.48 %
off for 1.65, in 1.4 to 2 times the processor time. In a room lit only through a slit of 6 cm, twice the rays reduce an
error of 14 % to 10 %, four times to 7 %.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.direction_patterns import MAX_EDITED_SETS, MAX_SAMPLE_SETS
from engine.precompute.indirect.gather import object_of_rows
from engine.scene.primary_hits import PrimaryHits

N_NEIGHBOURS, _N_GUIDE = 24, 9
# Search radius for neighbours, relative to the picture's height.
_FARTHEST = 1.0 / 12.0
# As in the lattice: neighbours lie at most 15° off the plane.
_SAME_PLANE = math.sin(math.radians(15.0))
# Largest change of the normal between a gather point and a pixel that uses it: a glossy reflection changes with the
# normal.
DIFFUSE_TURN, GLOSSY_TURN = math.cos(math.radians(25.0)), math.cos(math.radians(4.0))
# Relative differences up to this count as none, whatever the noise.
_TOLERANCE = 0.1
# Noise relative to the light: below the first value there is no filtering, above the second full filtering.
_QUIET, _LOUD = 0.02, 0.08
# Fraction of the mean added to the light, so that dark points count less.
_DARK = 0.1
# Blur counts only beyond this multiple of its expectation; less may be noise.
_CONFIDENCE = 2.0
_TINY = 1e-20
# Noise relative to the light: above the first a point gets one extra sample set, above the second the most. Of a
# hundred points of cornell, stairwell, storeroom and room none exceeds the first, of `ajar` 0.4, of teatray 5.
NOISY, VERY_NOISY = 0.1, 0.2
# Fraction of the mean that is added to the light there, and what keeps it from 0.
_DARK_SAMPLES, _TINY_LIGHT = 0.25, 1e-30


class Smoothing(NamedTuple):
    """A sparse matrix (p, q) of means: start (p + 1,) of each row's entries, neighbour (n,) and weight (n,); rows sum
    to 1. A filter is square."""

    start: NDArray[np.int64]
    neighbour: NDArray[np.int32]
    weight: NDArray[np.float32]

    @property
    def n_rows(self) -> int:
        return len(self.start) - 1

    def part(self, begin: int, end: int) -> Smoothing:
        """The block of the points [begin, end), which have neighbours only among themselves."""
        first, last = self.start[begin], self.start[end]
        own = self.neighbour[first:last] - np.int32(begin)
        return Smoothing(self.start[begin : end + 1] - first, own, self.weight[first:last])


def no_smoothing(n_points: int) -> Smoothing:
    """The identity: every point has weight 1 for itself."""
    return Smoothing(
        np.arange(n_points + 1, dtype=np.int64), np.arange(n_points, dtype=np.int32), np.ones(n_points, np.float32)
    )


def mean_of_sample_sets(nth: NDArray[np.uint8]) -> Smoothing:
    """The mean of each of p points over its sample sets; nth (q,): the number of each set at its point."""
    start = np.append(np.flatnonzero(nth == 0), len(nth))
    weight = np.repeat(1.0 / np.diff(start), np.diff(start))
    return Smoothing(start, np.arange(len(nth), dtype=np.int32), weight.astype(np.float32))


def smoothing_for(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], first: NDArray[np.float32],
    second: NDArray[np.float32],
) -> Smoothing:  # fmt: skip
    """The filter for gather points at `rows` (p,), ascending, with radiance first and second (p, 3) of the halves of
    their rays.

    least_alike (M,): the least cosine between the normals of neighbours on an object.
    """
    objects = object_of_rows(hits, rows)
    starts = np.searchsorted(objects, np.arange(len(hits.object_ranges) + 1))
    dark = _DARK * float(0.5 * (first + second).sum(axis=1).mean()) if len(rows) else 0.0
    # A start without rows, for a scene without objects.
    neighbours, weights = [np.zeros((0, 1), np.int32)], [np.zeros((0, 1), np.float32)]
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


def least_alike(glossy: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The least cosine (M,) between normals within an object; glossy (M,): objects whose reflection changes with the
    normal."""
    return np.asarray(np.where(glossy, GLOSSY_TURN, DIFFUSE_TURN), np.float32)


def neighbours_of(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: float
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The nearest points (p, K) of each point in the picture, itself first, and their closeness (p, K) in [0, 1], 0
    beyond an edge."""
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
    """Weights of the neighbours (p, K), each row summing to 1; the first is the point itself."""
    there = (closeness > 0.0).astype(np.float32)
    # Value: the mean of the halves; variance: their squared difference, averaged over neighbours.
    value, variance = 0.5 * (first + second), (0.5 * (first - second)) ** 2
    variance = mean_of_neighbours(variance, nearest, there)
    # Compare means over a few neighbours: single values would differ by their noise alone.
    few = there * (np.arange(there.shape[1]) < _N_GUIDE)
    guide, doubt = mean_of_neighbours(value, nearest, few), variance.sum(axis=1) / few.sum(axis=1)
    bright = guide.sum(axis=1)
    # Squared difference of the guides, less its expectation under noise.
    unlike = ((guide[nearest] - guide[:, None]) ** 2).sum(axis=2)
    by_chance = doubt[nearest] + doubt[:, None]
    none = (_TOLERANCE * bright[:, None]) ** 2 / 3.0
    weight = closeness * np.exp(-np.maximum(unlike - by_chance, 0.0) / (by_chance + none + _TINY))
    # Filter strength by relative noise, then by what the filter blurs.
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
    """The share of the filter (p, 1) that reduces the error: v / (v + b²), where v is the variance of the mean of the
    halves A and B, and b the bias of the filter F.

    F A and B have independent noise: E (F A - B)² is F's squared error plus B's variance, and (A - B)² / 2 estimates
    the latter. This protects a mirrored lamp of two pixels, which a comparison of means takes for noise.
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
    """The rows of all objects as one matrix, without zero weights."""
    is_used = [each > 0.0 for each in weights]
    counts = np.concatenate([each.sum(axis=1) for each in is_used])
    return Smoothing(
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.concatenate([each[mine] for each, mine in zip(neighbours, is_used, strict=True)]),
        np.concatenate([each[mine] for each, mine in zip(weights, is_used, strict=True)]),
    )


def extra_sample_sets(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], light: NDArray[np.float32],
    noise: NDArray[np.float32], shown: NDArray[np.float64], most: float, scale: float = 1.0,
) -> NDArray[np.int64]:  # fmt: skip
    """The number of extra sample sets (p,), 0 to MAX_SAMPLE_SETS - 1, of gather points at `rows` (p,), ascending.

    light and noise (p, 3): the mean and half the difference of the halves of their first sets; shown (p,): the sum of
    squared weights with which pixels use their light; most: extra sets in all, per point; least_alike (M,): the least
    cosine between the normals of neighbours on an object; scale: of the noise that requires extra sets.
    """
    relative = np.sqrt(np.minimum(shown, 1.0)) * relative_noise(hits, rows, least_alike, light, noise)
    requested = (relative > scale * NOISY).astype(np.int64)
    requested += (MAX_SAMPLE_SETS - 2) * (relative > scale * VERY_NOISY)
    return _within_budget(requested, shown * relative, int(most * len(rows)))


def further_sample_sets(
    noise: NDArray[np.floating], shown: NDArray[np.float64], n_sets: NDArray[np.integer], most: int
) -> NDArray[np.int64]:
    """The number of sample sets (p,) to add, `most` in all, to gather points that have n_sets (p,): as many again where
    the noise that the picture shows, relative to the light (p,), requires extra sets, up to MAX_EDITED_SETS. shown
    (p,): see `extra_sample_sets`."""
    requested = np.where(noise > NOISY, np.minimum(n_sets, np.maximum(MAX_EDITED_SETS - n_sets, 0)), 0)
    return _within_budget(requested, np.sqrt(shown) * noise, most)


def relative_noise(
    hits: PrimaryHits, rows: NDArray[np.int32], least_alike: NDArray[np.float32], light: NDArray[np.float32],
    noise: NDArray[np.float32],
) -> NDArray[np.float64]:  # fmt: skip
    """Noise over light (p,), both averaged over neighbours."""
    relative = np.zeros(len(rows))
    objects = object_of_rows(hits, rows)
    starts = np.searchsorted(objects, np.arange(len(hits.object_ranges) + 1))
    dark = _DARK_SAMPLES * float(light.mean(axis=0).sum()) if len(rows) else 0.0
    for least, begin, end in zip(least_alike, starts[:-1], starts[1:], strict=True):
        if begin < end:
            nearest, closeness = neighbours_of(hits, rows[begin:end], float(least))
            there = (closeness > 0.0).astype(np.float32)
            own, chance = (each[begin:end].sum(axis=1, keepdims=True) for each in (light, noise))
            bright, variance = (mean_of_neighbours(each, nearest, there)[:, 0] for each in (own, chance**2))
            relative[begin:end] = np.sqrt(variance) / (bright + dark + _TINY_LIGHT)
    return relative


def _within_budget(requested: NDArray[np.int64], worth: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Limits the requested sample sets (p,) to `most` in all: every point's first extra set before any second one, and
    where these are too many, those of the greatest worth (p,)."""
    given = np.zeros_like(requested)
    order = np.argsort(-worth, kind="stable")
    for some in (np.minimum(requested, 1), requested - np.minimum(requested, 1)):
        in_turn = some[order]
        given[order] += np.clip(most - given.sum() - (np.cumsum(in_turn) - in_turn), 0, in_turn)
    return given
