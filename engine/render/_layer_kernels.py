"""Compiled sums over the points of a picture, see `layer_transport`."""

import numpy as np
from numba import njit

# Numbers that are summed before the next band: 256 points of three channels stay in the L1 cache.
BLOCK = 768


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def sum_bands(
    planes: np.ndarray, bands: np.ndarray, weights: np.ndarray, begin: int, end: int, out: np.ndarray
) -> None:
    """out[i] += Σ_j weights[j, i] planes[j, i] over some bands j, begin <= i < end.

    planes (J, 3P), out (3P,): points channel by channel; bands (n,): the bands j; weights (n, BLOCK): the three values
    of each, repeated. begin is a multiple of BLOCK.
    """
    for start in range(begin, end, BLOCK):
        n = min(BLOCK, end - start)
        total = out[start : start + n]
        for k in range(len(bands)):
            row, weight = planes[bands[k], start : start + n], weights[k]
            for i in range(n):
                total[i] += weight[i] * row[i]


@njit(cache=True, nogil=True, error_model="numpy")
def add_points(pixel: np.ndarray, share: np.ndarray, radiance: np.ndarray, picture: np.ndarray) -> None:
    """picture[pixel[p]] += share[p] radiance[p]; (P,), (P,), (P, 3) and (pixels, 3).

    Skips shares of 0, so that infinite radiance times 0 does not become NaN.
    """
    for p in range(len(pixel)):
        if share[p] > 0.0:
            for c in range(3):
                picture[pixel[p], c] += np.float32(share[p] * radiance[p, c])
