"""Real spherical harmonics (SH) of orders 1 to 10, and zonal harmonics (ZH): those symmetric about an axis [Sloan05,
3].

A function on the sphere is a vector of n^2 coefficients, number l^2 + l + m for band l < n and -l <= m <= l, in a basis
that is orthonormal by solid angle. z is the axis, with the sign of Condon and Shortley: the linear band of a cosine
about s is proportional to (-s_y, s_z, -s_x). A rotation does not mix bands.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from engine.core.threads import even_parts, on_threads
from engine.sphere import _kernels as kernels
from engine.sphere.geodesic import geodesic
from engine.sphere.haar import level_of

Float64Array = NDArray[np.float64]

MAX_ORDER = kernels.MAX_ORDER


def basis(directions: ArrayLike, n: int) -> Float64Array:
    """The harmonics (..., n^2) of order n at unit directions (..., 3).

    Raises ValueError if n is not 1 to `MAX_ORDER`, or a direction is not of length 1.
    """
    _check_order(n)
    directions = np.asarray(directions, np.float64)
    flat = np.ascontiguousarray(directions.reshape(-1, 3)).view()
    flat.flags.writeable = False  # as some inputs are: the kernel would be compiled anew for a writable array
    lengths = np.linalg.norm(flat, axis=1)
    if not np.all(np.abs(lengths - 1.0) < 1e-3):
        raise ValueError(f"direction {flat[np.argmax(~(np.abs(lengths - 1.0) < 1e-3))]}, expected one of length 1")
    values = np.empty((len(flat), n * n))
    on_threads(lambda start, stop: kernels.basis_range(flat, n, start, stop, values), *even_parts(len(flat)))
    return values.reshape(*directions.shape[:-1], n * n)


def bands(n: int) -> NDArray[np.int64]:
    """The band l of each of n^2 coefficients."""
    _check_order(n)
    return np.repeat(np.arange(n), 2 * np.arange(n) + 1)


def order_of(coefficients: NDArray[np.floating]) -> int:
    """The order of vectors (..., n^2). Raises ValueError if there is none."""
    n = math.isqrt(coefficients.shape[-1])
    if n * n != coefficients.shape[-1]:
        raise ValueError(f"{coefficients.shape[-1]} coefficients, expected the square of an order")
    _check_order(n)
    return n


def clamped_cosine(n: int) -> Float64Array:
    """The factor (n,) of each band for light that a diffuse surface receives: pi, 2 pi / 3, pi / 4, 0, -pi / 24, ...

    [Ramamoorthi01, eq. 8]; the factors of `convolve`, whose result at the surface's normal is its irradiance.
    """
    factors = np.zeros(n)
    for l in range(n):  # noqa: E741
        if l == 1:
            factors[l] = 2.0 * math.pi / 3.0
        elif l % 2 == 0:
            ratio = math.comb(l, l // 2) / 2.0**l
            factors[l] = 2.0 * math.pi * (-1.0) ** (l // 2 - 1) / ((l + 2) * (l - 1)) * ratio
    return factors


def convolve(coefficients: NDArray[np.floating], factors: ArrayLike) -> Float64Array:
    """Vectors (..., n^2) after convolution with a kernel about an axis, given its n convolution coefficients g*
    [Sloan05, eq. 3, 4]."""
    return np.asarray(coefficients * np.asarray(factors)[bands(order_of(coefficients))])


def project(powers: NDArray[np.floating], n: int) -> Float64Array:
    """Projects light onto coefficients (n^2, ...): powers (T, ...) are radiance times solid angle on the triangles of a
    level of the geodesic sphere (`engine.light.environment.triangle_integrals`).

    A triangle's light counts at its centroid: at level 5 a harmonic of order 10 varies by 5e-4 of itself within one.
    """
    powers = np.asarray(powers, np.float64)
    return np.asarray(np.tensordot(_basis_of_triangles(level_of(len(powers)), n), powers, axes=(0, 0)))


def rotation_matrices(rotation: ArrayLike, n: int) -> list[Float64Array]:
    """For each band l < n the matrix (2l+1, 2l+1) that rotates its coefficients: those of f(R^-1 s) from those of f.

    rotation: R (3, 3). The rotation is decomposed into angles about z, x, z, x and z: a rotation about z mixes only m
    with -m, and those about x are fixed quarter turns [Sloan05, 3.4].
    """
    _check_order(n)
    alpha, beta, gamma = _angles_zyz(np.asarray(rotation, np.float64))
    matrices = []
    for l in range(n):  # noqa: E741
        quarter = _quarter_about_x(l)
        about_y = quarter @ _about_z(l, beta) @ quarter.T
        matrices.append(_about_z(l, alpha) @ about_y @ _about_z(l, gamma))
    return matrices


def rotate(coefficients: NDArray[np.floating], rotation: ArrayLike) -> Float64Array:
    """Vectors (..., n^2) of the rotated function f(R^-1 s)."""
    n = order_of(coefficients)
    parts = np.split(np.asarray(coefficients, np.float64), np.arange(1, n) ** 2, axis=-1)
    return np.concatenate([p @ m.T for p, m in zip(parts, rotation_matrices(rotation, n), strict=True)], axis=-1)


@cache
def _basis_of_triangles(level: int, n: int) -> Float64Array:
    return basis(geodesic(level).centres, n)


def _check_order(n: int) -> None:
    if not 1 <= n <= MAX_ORDER:
        raise ValueError(f"order {n}, expected 1 to {MAX_ORDER}")


def _angles_zyz(rotation: Float64Array) -> tuple[float, float, float]:
    """alpha, beta, gamma with R = Rz(alpha) Ry(beta) Rz(gamma)."""
    sine = math.hypot(rotation[0, 2], rotation[1, 2])
    beta = math.atan2(sine, rotation[2, 2])
    if sine > 1e-12:
        return (
            math.atan2(rotation[1, 2], rotation[0, 2]), beta, math.atan2(rotation[2, 1], -rotation[2, 0])
        )  # fmt: skip
    return math.atan2(rotation[1, 0], rotation[1, 1]), beta, 0.0  # a rotation about z alone, or after a half turn


def _about_z(l: int, angle: float) -> Float64Array:  # noqa: E741
    """The rotation of band l about the axis: m and -m are cosine and sine of m phi."""
    matrix = np.zeros((2 * l + 1, 2 * l + 1))
    matrix[l, l] = 1.0
    for m in range(1, l + 1):
        cosine, sine = math.cos(m * angle), math.sin(m * angle)
        matrix[l + m, l + m] = matrix[l - m, l - m] = cosine
        matrix[l + m, l - m], matrix[l - m, l + m] = -sine, sine
    return matrix


@cache
def _quarter_about_x(l: int) -> Float64Array:  # noqa: E741
    """The rotation of band l that maps z to y, exact: by quadrature that integrates products of its harmonics."""
    directions, weights = quadrature(l + 1)
    turned = np.stack([directions[:, 0], -directions[:, 2], directions[:, 1]], axis=1)  # R^-1 s
    band = slice(l * l, (l + 1) ** 2)
    return (basis(directions, l + 1)[:, band] * weights[:, None]).T @ basis(turned, l + 1)[:, band]


def quadrature(n: int) -> tuple[Float64Array, Float64Array]:
    """Directions (D, 3) and weights (D,) that integrate the product of any two harmonics of order n exactly."""
    z, of_z = np.polynomial.legendre.leggauss(n)
    phi = (np.arange(2 * n) + 0.5) * (math.pi / n)
    sine = np.sqrt(1.0 - z * z)[:, None]
    directions = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), z[:, None]), axis=-1)
    return directions.reshape(-1, 3), np.repeat(of_z * (math.pi / n), 2 * n)


_N_ANGLES = 65  # angles at which the lobe must decrease


def without_rings(bands: ArrayLike) -> Float64Array:
    """The nearest bands (n,) to those of a lobe, its integrals with the Legendre polynomials, whose lobe sum_l
    (2l+1)/(4 pi) bands_l P_l(cos theta) decreases from its axis on; the first band is unchanged.

    A lobe truncated after n bands becomes negative and rises again on its far side, so that a small bright light draws
    black and white rings. A fixed window (Hann, Lanczos) leaves 3 to 5 % of the peak below zero, and blurs broad lobes
    that need no window. Nearest is by the square integral over the sphere. Under any light, the response of such a lobe
    lies between the light's least and greatest value, times the lobe's mean.

    Solves for the least v with G v >= d [Lawson74, ch. 23], where v is the change in an orthonormal basis, and d the
    amount by which the lobe violates the conditions at some angles, and non-negativity at its far side.
    """
    given = np.asarray(bands, np.float64)
    root = np.sqrt(2.0 * np.arange(len(given)) + 1.0)
    falls = _falls(len(given))
    lacks = -(falls @ (root * given))
    change = falls[:, 1:]  # the first band is unchanged
    if len(given) == 1 or (lacks <= 0.0).all():
        return given.copy()
    equations = np.vstack([change.T, lacks])
    target = np.zeros(len(equations))
    target[-1] = 1.0
    residual = equations @ nnls(equations, target)[0] - target
    result = given.copy()
    result[1:] -= residual[:-1] / residual[-1] / root[1:]
    return result


@cache
def _falls(n: int) -> Float64Array:
    """Rows: the slope of each normalised band by the cosine, at angles between axis and far side; last, its value at
    the far side."""
    cosine, every = np.cos(np.linspace(0.0, np.pi, _N_ANGLES)), np.eye(n)
    slopes = [legendre.legval(cosine, legendre.legder(row)) for row in every]
    ends = [legendre.legval(-1.0, row) for row in every]
    return np.sqrt(2.0 * np.arange(n) + 1.0) * np.vstack([np.array(slopes).T, ends])
