"""Spherical Haar wavelets on the geodesic sphere [Ma06, 3.1].

A triangle of level l has three wavelets. Wavelet i is +1 on the children i and 3 (the centre) and −1 on the two others,
so that the product of all three is +1, and a symmetry of the sphere that maps triangles to triangles maps wavelets to
wavelets without a change of sign.

**Measure.** The basis is orthogonal if the four children of a triangle are equal, which they are not on the sphere
(areas of one level differ by a factor of up to 1.3). Here they are equal by definition: triangles of level l have the
measure 4^−l. The true solid angles are part of one of the factors, the light, as the power L ΔΩ of each triangle. Σ
over triangles of power × visibility × BRDF is then the integral over the true sphere, constant light is exact, and the
sums below require no areas.

**Symmetries.** Five rotations and a reflection fix +Y. They only renumber the triangles, on every level, because the
order of subdivision follows the corners. A table of functions with a symmetry about Y themselves, such as the slices of
an isotropic BRDF, therefore covers 36 degrees of azimuth instead of 360; for other azimuths its entries are read with
other numbers.

Coefficients are means and differences, not normalised [Ma06]: number t < 20 is the mean over triangle t of level 0;
number 20·4^l + 3 t + i is wavelet i of triangle t of level l. The first 20·4^L are therefore those of level L.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from engine.sphere.geodesic import MAX_LEVEL, geodesic, locate

Array = NDArray[Any]
Int32Array = NDArray[np.int32]
Rule = Literal["size", "energy", "top"]

N_ROOTS = 20
# Rows: the mean and the three wavelets over the children; its own inverse up to the factor 4.
_SIGNS = np.array([[1, 1, 1, 1], [1, -1, -1, 1], [-1, 1, -1, 1], [-1, -1, 1, 1]], np.float64)


def level_of(n_values: int) -> int:
    """The level with n_values triangles. Raises ValueError where there is none up to `MAX_LEVEL`."""
    for level in range(MAX_LEVEL + 1):
        if n_values == N_ROOTS * 4**level:
            return level
    raise ValueError(f"{n_values} values, expected 20, 80, 320, 1280, ... of one level")


def forward(values: Array) -> Array:
    """Values on the triangles of a level (20·4^L, ...) to as many coefficients; preserves float32."""
    level, means = level_of(len(values)), np.asarray(values)
    signs = (_SIGNS / 4.0).astype(means.dtype)
    coefficients = np.empty_like(means)
    for coarse in reversed(range(level)):
        n = N_ROOTS * 4**coarse
        split = np.einsum("ab,tb...->ta...", signs, means.reshape(n, 4, *means.shape[1:]))
        coefficients[n : 4 * n] = split[:, 1:].reshape(3 * n, *means.shape[1:])
        means = split[:, 0]
    coefficients[:N_ROOTS] = means
    return coefficients


def inverse(coefficients: Array) -> Array:
    """Coefficients (20·4^L, ...) to the values on the triangles of their level."""
    level, coefficients = level_of(len(coefficients)), np.asarray(coefficients)
    signs = _SIGNS.astype(coefficients.dtype)
    values, rest = coefficients[:N_ROOTS], coefficients.shape[1:]
    for coarse in range(level):
        n = N_ROOTS * 4**coarse
        split = np.concatenate([values[:, None], coefficients[n : 4 * n].reshape(n, 3, *rest)], axis=1)
        values = np.einsum("ab,ta...->tb...", signs, split).reshape(4 * n, *rest)
    return values


def levels_of_coefficients(level: int) -> Int32Array:
    """The level of the triangle that carries each coefficient (20·4^level,): 0 for the means."""
    levels = np.zeros(N_ROOTS * 4**level, np.int32)
    for coarse in range(1, level):
        levels[N_ROOTS * 4**coarse :] += 1
    return levels


def images_of_coefficients(images: list[Int32Array]) -> Int32Array:
    """The number to which a symmetry maps each coefficient (20·4^L,).

    images: for each level from 0 to L the triangles to which it maps the triangles (`images_of_triangles`).
    """
    found = [images[0]]
    for finer in images[1:]:
        corners = finer.reshape(-1, 4)[:, :3]  # corner children map to corner children
        found.append((len(corners) + 3 * (corners // 4) + corners % 4).ravel())
    return np.concatenate(found).astype(np.int32)


def select_coefficients(coefficients: Array, n: int, rule: Rule = "size") -> NDArray[np.bool_]:
    """Selects n of the coefficients (C, ...) as a mask (C,): always the 20 means, then the largest differences.

    rule: "size", |c| times the triangle's measure; "energy", |c|² times the measure; "top", the coarsest. The largest
    colour channel counts. Equal coefficients retain their order. For n below 20 all means are selected nevertheless.
    """
    n_all = len(coefficients)
    keep = np.zeros(n_all, bool)
    if rule == "top":
        keep[: max(n, N_ROOTS)] = True
        return keep
    size = np.abs(coefficients).reshape(n_all, -1).max(axis=1).astype(np.float64)
    fall = 1.0 if rule == "size" else 0.5
    size *= 4.0 ** (-fall * levels_of_coefficients(level_of(n_all)))
    size[:N_ROOTS] = np.inf
    keep[np.argsort(-size, kind="stable")[: max(n, N_ROOTS)]] = True
    return keep


N_TURNS = 5
N_SYMMETRIES = 2 * N_TURNS
SECTOR = np.pi / N_TURNS  # of azimuth, from which the symmetries reach all others


def symmetry(number: int) -> NDArray[np.float64]:
    """Matrix (3, 3), direction ↦ M direction: a rotation by 72 degrees times `number` (0 to 9) mod 5, from +Z to +X.

    From 5 on x is reflected first; a corner of the icosahedron's upper ring lies in that plane, at −Z.
    """
    angle = 2.0 * np.pi * (number % N_TURNS) / N_TURNS
    turn = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
    return turn * [-1.0, 1.0, 1.0] if number >= N_TURNS else turn


@lru_cache(maxsize=8)
def images_of_triangles(level: int) -> NDArray[np.int32]:
    """(10, 20·4^level): the triangle to which each symmetry maps each triangle. Read-only."""
    centres = geodesic(level).centres
    return _readonly(np.stack([locate(centres @ symmetry(number).T, level) for number in range(N_SYMMETRIES)]))


@lru_cache(maxsize=2)
def images_of_wavelets(level: int) -> NDArray[np.int32]:
    """(10, 20·4^level): the number to which each symmetry maps each coefficient of `haar`. Read-only."""
    of_level = [images_of_triangles(coarser) for coarser in range(level + 1)]
    return _readonly(
        np.stack([images_of_coefficients([i[number] for i in of_level]) for number in range(N_SYMMETRIES)])
    )


def _readonly(array: NDArray[np.int32]) -> NDArray[np.int32]:
    array.flags.writeable = False
    return array
