"""The symmetries of the geodesic sphere that fix +Y: five rotations, and a reflection.

They only renumber its triangles, on every level, because the order of subdivision follows the corners. A table of
functions with a symmetry about Y themselves, such as the slices of an isotropic BRDF, therefore covers 36 degrees of
azimuth instead of 360; for other azimuths its entries are read with other numbers.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.sphere.geodesic import geodesic, locate
from engine.sphere.haar import images_of_coefficients

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
