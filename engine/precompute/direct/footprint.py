"""Interpolates between computed samples while only a lattice of the picture is computed.

Each point uses the four samples of its own object that are nearest in the picture and in the direction of the normal,
so that a coarse picture is smooth on a surface and never bleeds over a silhouette or a sharp edge.
"""

import numpy as np

from engine.precompute.direct import _footprint_kernels as kernels
from engine.scene.primary_hits import PrimaryHits

N_SAMPLES = 4
# A change of the normal by one radian counts as this many lattice steps.
NORMAL_WEIGHT = 4.0


def lattice_rows(hits: PrimaryHits, stride: int) -> np.ndarray:
    """Rows of `hits` at the centres of every `stride`-th pixel, ascending, (S,) int32; at least one for every visible
    object. For stride 1 all rows, including those beside pixel centres."""
    width, _ = hits.resolution
    if stride == 1:
        return np.arange(len(hits.pixel), dtype=np.int32)
    on_lattice = (hits.pixel // width % stride == 0) & (hits.pixel % width % stride == 0) & hits.is_centred
    for begin, end in hits.object_ranges:
        if end > begin and not on_lattice[begin:end].any():
            on_lattice[(begin + end) // 2] = True
    return np.flatnonzero(on_lattice).astype(np.int32)


def footprint(hits: PrimaryHits, samples: np.ndarray, stride: int) -> tuple[np.ndarray, np.ndarray]:
    """Four samples of the own object for each point, and their weights: ((P, 4) int32, (P, 4) float32 summing to 1).

    samples (S,) are rows of `hits`; the indices returned count within the samples of the point's own object.
    """
    n_points, (width, height) = len(hits.pixel), hits.resolution
    chosen, distance = np.empty((n_points, N_SAMPLES), np.int32), np.empty((n_points, N_SAMPLES))
    nodes = np.full((-(-height // stride), -(-width // stride)), -1, np.int32)
    y, x = np.divmod(hits.pixel[samples], width)
    on_lattice = np.flatnonzero((y % stride == 0) & (x % stride == 0) & hits.is_centred[samples]).astype(np.int32)
    nodes[y[on_lattice] // stride, x[on_lattice] // stride] = on_lattice
    for begin, end in hits.object_ranges:
        first, last = np.searchsorted(samples, (begin, end))
        kernels.nearest_samples(
            begin, end, hits.pixel, hits.normal, width, stride, NORMAL_WEIGHT, samples, first, last - first, nodes,
            chosen, distance,
        )  # fmt: skip
    weights = np.maximum(1.0 - distance / 1.5, 0.0) ** 2 + 1e-6 / (1e-3 + distance)
    weights /= weights.sum(axis=1, keepdims=True)
    return chosen, weights.astype(np.float32)
