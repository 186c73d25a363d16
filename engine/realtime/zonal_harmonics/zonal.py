"""Transfer as a few zonal lobes for each point, which rotate with the surface [Sloan05, 3 and 4.1].

A lobe is a function that is symmetric about an axis s*: its harmonics are y_lm(s*) g*_l [Sloan05, eq. 6]. Rotation
rotates the axis and leaves the n coefficients g* unchanged, where rotation of harmonics costs n^3. The constant part of
a transfer vector and, with three lobes or more, its linear part are stored exactly; lobes are fitted to the remainder.
The transfer of a thin membrane needs no fit: it is a single lobe in closed form [Sloan05, 4.2].
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _zonal_kernels as kernels
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import bands, basis, clamped_cosine, order_of

Float64Array = NDArray[np.float64]

MAX_LOBES = 6
N_RESTARTS = 4
ENOUGH = 0.02  # relative error of a point below which there is no restart
_EXACT_LINEAR = 3  # as many axes span all linear functions
_SCAN_LEVEL = 2
_BLOCK = 256  # points; pictures can be drawn between blocks: a tenth of a second on two cores


@dataclass(frozen=True, eq=False)
class Zonal:
    """Functions on the sphere at P points, of order n: the exact part of bands 0 and 1, and N lobes.

    low (P, 4): the exact harmonics. axes (P, N, 3), unit. coefficients (P, N, n): g*, 0 in the exact bands. errors
    (P,): length of the residual of the vectors that they were fitted to.
    """

    low: Float64Array
    axes: Float64Array
    coefficients: Float64Array
    errors: Float64Array

    def harmonics(self) -> Float64Array:
        """The vectors (P, n^2) that the lobes approximate [Sloan05, eq. 11]."""
        n = self.coefficients.shape[2]
        of_lobes = np.einsum("pik,pik->pk", basis(self.axes, n), self.coefficients[:, :, bands(n)])
        of_lobes[:, : min(4, n * n)] += self.low[:, : min(4, n * n)]
        return of_lobes

    @property
    def relative_errors(self) -> Float64Array:
        """(P,): errors relative to the length of the fitted vectors; the residual is orthogonal to the lobes."""
        length = np.linalg.norm(self.harmonics(), axis=1)
        return np.asarray(self.errors / np.maximum(np.hypot(length, self.errors), 1e-30))

    def rotate(self, rotations: ArrayLike) -> Zonal:
        """Rotate all points, by one rotation (3, 3) or one each (P, 3, 3) [Sloan05, eq. 10]."""
        turns = np.broadcast_to(np.asarray(rotations, np.float64), (len(self.axes), 3, 3))
        # The linear band is a vector: its coefficients for m = -1, 0, 1 correspond to -y, z and -x.
        vectors = self.low[:, [3, 1, 2]] * (-1.0, -1.0, 1.0)
        low = self.low.copy()
        low[:, [3, 1, 2]] = np.einsum("pab,pb->pa", turns, vectors) * (-1.0, -1.0, 1.0)
        return Zonal(low, np.einsum("pab,pib->pia", turns, self.axes), self.coefficients, self.errors)


def fit(vectors: ArrayLike, n_lobes: int, n_restarts: int = N_RESTARTS) -> Generator[float, None, Zonal]:
    """Fit N lobes to each of the vectors (P, n^2): each greedily to the residual of those before, then all jointly,
    with restarts from random axes where the error is large; the result does not depend on the number of cores. Yields
    the share that is done.

    Raises ValueError unless there are 1 to `MAX_LOBES` lobes and all vectors are finite.
    """
    targets = np.ascontiguousarray(vectors, np.float64)
    n, n_points = order_of(targets), len(targets)
    if not 1 <= n_lobes <= MAX_LOBES:
        raise ValueError(f"{n_lobes} lobes, expected 1 to {MAX_LOBES}")
    if not np.isfinite(targets).all():
        raise ValueError("transfer vectors with infinite coefficients, expected finite ones")
    first = min(n, 2 if n_lobes >= _EXACT_LINEAR else 1)
    low = np.zeros((n_points, 4))
    low[:, : first * first] = targets[:, : first * first]
    axes, coefficients = np.empty((n_points, n_lobes, 3)), np.empty((n_points, n_lobes, n))
    errors = np.empty(n_points)
    scan = _scan()
    scanned = basis(scan, n)
    for start in range(0, n_points, _BLOCK):
        count = min(_BLOCK, n_points - start)

        def part(low: int, high: int, start: int = start) -> None:
            kernels.fit_range(
                targets, first, n_restarts, ENOUGH, scan, scanned, start + low, start + high, axes, coefficients, errors
            )

        on_threads(part, *even_parts(count))
        yield (start + count) / n_points
    return Zonal(low, axes, coefficients, errors)


def fit_linear_lobe(vectors: ArrayLike) -> Zonal:
    """Fit one lobe to each of the vectors (P, n^2) about the direction of its linear band, in closed form [Sloan05, eq.
    18]: almost as accurate as the best lobe, in a hundredth of the time. The constant band is stored exactly."""
    targets = np.asarray(vectors, np.float64)
    n = order_of(targets)
    linear = targets[:, [3, 1, 2]] * (-1.0, -1.0, 1.0) if n > 1 else np.zeros((len(targets), 3))
    lengths = np.linalg.norm(linear, axis=1, keepdims=True)
    axes = np.where(lengths > 0.0, linear / np.where(lengths > 0.0, lengths, 1.0), (0.0, 0.0, 1.0))
    values = basis(axes, n)
    of_bands = np.add.reduceat(values * targets, np.arange(n) ** 2, axis=1)
    coefficients = of_bands * (4.0 * np.pi / (2.0 * np.arange(n) + 1.0))
    coefficients[:, 0] = 0.0
    left = targets - values * coefficients[:, bands(n)]
    low = np.zeros((len(targets), 4))
    low[:, 0], left[:, 0] = targets[:, 0], 0.0
    return Zonal(low, axes[:, None], coefficients[:, None], np.linalg.norm(left, axis=1))


@cache
def _scan() -> Float64Array:
    """Directions over half the sphere: the other half gives the same lobes."""
    vertices = geodesic(_SCAN_LEVEL).vertices
    return np.ascontiguousarray(vertices[vertices @ (0.01, 0.02, 1.0) > 0.0])


def unshadowed_lobes(normals: ArrayLike, n: int) -> Zonal:
    """Lobes of order n for points that see all that is above normals (P, 3), as an irradiance map shades them
    [Sloan05, 6]."""
    normals = np.asarray(normals, np.float64).reshape(-1, 3)
    upright = membrane(np.zeros(len(normals)), n)
    # Bands 0 and 1 are stored exactly, because they are interpolated between points.
    low, coefficients = upright.low.copy(), upright.coefficients.copy()
    low[:, 1:] = coefficients[:, 0, 1:2] * basis(normals, 2)[:, 1:]
    coefficients[:, 0, 1] = 0.0
    return replace(upright, low=low, axes=normals[:, None], coefficients=coefficients)


def membrane(translucency: ArrayLike, n: int, reflected: float = 1.0) -> Zonal:
    """Lobes of order n for points of translucency alpha (P,) in [0, 1], in their own axes [Sloan05, eqs. 22 and 23].

    Light from above counts by its cosine, times the share that is reflected; light from below by alpha times its
    cosine.
    """
    alpha = np.asarray(translucency, np.float64).reshape(-1, 1)
    if not ((alpha >= 0.0) & (alpha <= 1.0)).all():
        raise ValueError("translucency, expected 0 to 1")
    of_above = clamped_cosine(n) / np.pi  # irradiance to the radiance of a white Lambertian surface
    of_below = of_above * (-1.0) ** np.arange(n)
    coefficients = reflected * of_above + alpha * of_below
    low = np.zeros((len(alpha), 4))
    low[:, 0] = coefficients[:, 0] * basis([0.0, 0.0, 1.0], 1)[0]
    coefficients[:, 0] = 0.0
    axes = np.tile([0.0, 0.0, 1.0], (len(alpha), 1, 1))
    return Zonal(low, axes, coefficients[:, None], np.zeros(len(alpha)))
