"""Compiled real spherical harmonics: values and gradients, as polynomials in x, y and z.

With z as the axis and the Condon-Shortley sign, as in [Sloan05]: y_lm = sqrt(2) Q_lm(z) Re (x + iy)^m for m > 0, Im for
m < 0, and Q_l0(z) for m = 0, where Q_lm is the normalised associated Legendre function without its factor sin^m. In
this form nothing is divided by zero at the axis, and a direction of length 0 is valid. Kernels never validate:
`engine.sphere.harmonics` does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

MAX_ORDER = 10


def _recurrence() -> tuple[Float64Array, Float64Array, Float64Array]:
    """Coefficients of Q_lm = up_lm (z Q_(l-1)m - back_lm Q_(l-2)m), from Q_mm = diagonal_m; no factorial, which would
    overflow."""
    diagonal = np.empty(MAX_ORDER)
    up, back = np.zeros((MAX_ORDER, MAX_ORDER)), np.zeros((MAX_ORDER, MAX_ORDER))
    diagonal[0] = math.sqrt(0.25 / math.pi)
    for m in range(1, MAX_ORDER):
        diagonal[m] = -diagonal[m - 1] * math.sqrt((2 * m + 1) / (2 * m))
    for l in range(1, MAX_ORDER):  # noqa: E741  # the field's name
        for m in range(l):
            up[l, m] = math.sqrt((4 * l * l - 1) / (l * l - m * m))
            back[l, m] = math.sqrt(((l - 1) ** 2 - m * m) / (4 * (l - 1) ** 2 - 1)) if l > 1 else 0.0
    return diagonal, up, back


_DIAGONAL, _UP, _BACK = _recurrence()
_SQRT2 = math.sqrt(2.0)


@njit(cache=True, nogil=True, error_model="numpy")
def basis_at(
    x: float, y: float, z: float, legendre: Float64Array, values: Float64Array, gradients: Float64Array
) -> None:
    """Writes values (n^2,), number l^2 + l + m, at one position; gradients (n^2, 3) by x, y and z unless they are (0,
    3).

    legendre: (n, n + 1) working memory, 0 above its diagonal.
    """
    n = legendre.shape[0]
    # The associated Legendre functions by recurrence in l.
    for m in range(n):
        legendre[m, m] = _DIAGONAL[m]
        for l in range(m + 1, n):  # noqa: E741
            before = legendre[l - 2, m] if l > m + 1 else 0.0
            legendre[l, m] = _UP[l, m] * (z * legendre[l - 1, m] - _BACK[l, m] * before)
    wants_gradients = gradients.shape[0] > 0
    cosine, sine, cosine_before, sine_before = 1.0, 0.0, 0.0, 0.0  # of m phi, times sin^m theta
    # Multiply by Re and Im of (x + iy)^m.
    for m in range(n):
        scale = _SQRT2 if m else 1.0
        for l in range(m, n):  # noqa: E741
            q, centre = scale * legendre[l, m], l * l + l
            values[centre + m] = q * cosine
            if m:
                values[centre - m] = q * sine
            if wants_gradients:
                # dQ_lm / dz: the derivative of a Legendre function is the next one in m.
                slope = -scale * math.sqrt((l - m) * (l + m + 1.0)) * legendre[l, m + 1]
                gradients[centre + m, 0] = q * m * cosine_before
                gradients[centre + m, 1] = -q * m * sine_before
                gradients[centre + m, 2] = slope * cosine
                if m:
                    gradients[centre - m, 0] = q * m * sine_before
                    gradients[centre - m, 1] = q * m * cosine_before
                    gradients[centre - m, 2] = slope * sine
        # (x + iy)^(m + 1).
        cosine_before, sine_before = cosine, sine
        cosine, sine = cosine * x - sine * y, sine * x + cosine * y


@njit(cache=True, nogil=True, error_model="numpy")
def basis_range(directions: Float64Array, n: int, start: int, stop: int, values: Float64Array) -> None:
    """Fills values[start:stop] (D, n^2)."""
    legendre, none = np.zeros((n, n + 1)), np.empty((0, 3))
    for i in range(start, stop):
        basis_at(directions[i, 0], directions[i, 1], directions[i, 2], legendre, values[i], none)
