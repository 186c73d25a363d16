"""The periodic, orthonormal Daubechies-4 transform of a curve's bands [BenArtzi07, 4.2.5, eq. 4.18].

Because the transform is orthonormal, c . T is the same number in either basis: transport rows and curve coefficients
are transformed once each, and the error of dropped coefficients is exactly their norm. The transform is one matrix
product; lifting and convolution were rejected, since J is at most a few hundred.

Coefficient 0 is the mean times sqrt(J); details follow from coarse to fine. On levels shorter than the filter it wraps
around: J = 1 is the identity and J = 2 is Haar.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError

Array = NDArray[Any]

_ROOT3 = math.sqrt(3.0)
# [BenArtzi07, tab. 4.1], d1 ... d4.
LOW_PASS = tuple(v / (4.0 * math.sqrt(2.0)) for v in (1.0 + _ROOT3, 3.0 + _ROOT3, 3.0 - _ROOT3, 1.0 - _ROOT3))
HIGH_PASS = (LOW_PASS[3], -LOW_PASS[2], LOW_PASS[1], -LOW_PASS[0])


class BandCountError(InsituError, ValueError):
    """A number of bands that is not a power of two."""

    def __init__(self, n_bands: object) -> None:
        self.n_bands = n_bands
        super().__init__(f"number of bands = {n_bands!r}, expected a power of two (1, 2, 4, ...)")

    def __reduce__(self) -> tuple[type[BandCountError], tuple[object]]:
        return BandCountError, (self.n_bands,)


def check_band_count(n_bands: int) -> int:
    """Returns the count unchanged. Raises BandCountError, which names it, unless it is an integer power of two."""
    whole = isinstance(n_bands, (int, np.integer)) and not isinstance(n_bands, bool)
    if not whole or n_bands < 1 or int(n_bands) & (int(n_bands) - 1):
        raise BandCountError(n_bands)
    return int(n_bands)


def transform_matrix(n_bands: int) -> NDArray[np.float64]:
    """S (J, J): coefficients = S @ bands, bands = S.T @ coefficients. Read-only, S S^T = 1 to 3e-15.

    Raises BandCountError unless J is a power of two.
    """
    return _transform_matrix(check_band_count(n_bands))


def forward(bands: Array, axis: int = 0) -> Array:
    """Bands to coefficients along `axis` (0 for curves (J, 3), -1 for transport rows (P, J)); preserves float32."""
    return _product(bands, axis, inverted=False)


def inverse(coefficients: Array, axis: int = 0) -> Array:
    """Coefficients to bands along `axis`; preserves float32."""
    return _product(coefficients, axis, inverted=True)


def _product(values: Array, axis: int, inverted: bool) -> Array:
    """The product with S or its transpose along `axis`."""
    values = np.asarray(values)
    matrix = transform_matrix(values.shape[axis])
    matrix = matrix.T if inverted else matrix
    if values.dtype == np.float32:
        matrix = matrix.astype(np.float32)
    return np.moveaxis(np.tensordot(matrix, values, axes=(1, axis)), 0, axis)


@lru_cache(maxsize=16)
def _transform_matrix(n_bands: int) -> NDArray[np.float64]:
    """S as the product of all levels."""
    matrix = np.eye(n_bands)
    length = n_bands
    while length > 1:
        matrix[:length] = _level_matrix(length) @ matrix[:length]
        length //= 2
    matrix.setflags(write=False)
    return matrix


def _level_matrix(length: int) -> NDArray[np.float64]:
    """One level: `length` / 2 smooth rows, then as many detail rows, each filter wrapped around."""
    level = np.zeros((length, length))
    half = length // 2
    for row in range(half):
        for tap in range(4):
            column = (2 * row + tap) % length
            level[row, column] += LOW_PASS[tap]
            level[half + row, column] += HIGH_PASS[tap]
    return level
