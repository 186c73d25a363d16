"""The distant light as Orbit looks it up: a direction's radiance, averaged over a disc as large as a triangle.

Every shading point has a frame of its own, so its triangles lie across those of the environment. Light tables for some
frames with others interpolated between them [Ma06, 3.2] put 6 % of error on a teapot under a sunny sky, with frames as
many as the paper's, as each shows a sun of its own; a look-up for each triangle costs about as much as reading such
tables. Averages over discs would spread a sun over several triangles, so the brightest directions are kept apart and
each put whole into the triangle that holds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from engine.light.environment import LUMINANCE, Environment, triangle_integrals
from engine.sphere.geodesic import geodesic

MAP_SIDE = 256
MOST_SUNS = 128
_FINE = 6  # level of the triangles that are averaged
# A direction is a sun if it holds so many times the mean power of the triangles beside it would have.
_SUN = 4.0

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Sky:
    """map (256, 256, 4) float32: radiance by octahedral direction, without the suns (the fourth is empty).

    sun_direction (N, 3) and sun_power (N, 3) float32: radiance times solid angle of the brightest directions.
    """

    map: Floats
    sun_direction: Floats
    sun_power: Floats

    @property
    def sunless(self) -> Sky:
        """The sky without its suns."""
        return Sky(self.map, self.sun_direction[:0], self.sun_power[:0])


def make_sky(environment: Environment | None, rotation: float) -> Sky:
    """The sky of an environment turned by `rotation` degrees; black without one."""
    n = geodesic(_FINE).n_triangles
    powers = np.zeros((n, 3)) if environment is None else triangle_integrals(environment, rotation, _FINE)
    suns = _suns(powers)
    rest = powers.copy()
    rest[suns] = 0.0
    averaged = np.zeros((MAP_SIDE, MAP_SIDE, 4), np.float32)
    averaged[..., :3] = (_averaging() @ rest).reshape(MAP_SIDE, MAP_SIDE, 3)
    directions = geodesic(_FINE).centres[suns]
    return Sky(averaged, directions.astype(np.float32), powers[suns].astype(np.float32))


def _suns(powers: NDArray[np.float64]) -> NDArray[np.intp]:
    """The triangles far brighter than the mean, at most MOST_SUNS of them."""
    luminance = powers @ LUMINANCE
    candidates = np.argsort(-luminance, kind="stable")[:MOST_SUNS]
    return np.sort(candidates[luminance[candidates] > _SUN * luminance.mean()])


@lru_cache(maxsize=1)
def _averaging() -> sparse.csr_matrix:
    """(texels, triangles): power of the fine triangles to mean radiance around each texel, falling off to twice the
    radius of a disc as large as a triangle: as wide as that, as what is small has to reach about one triangle's middle,
    wherever it lies between them."""
    fine = geodesic(_FINE)
    radius = 2.0 * np.sqrt(4.0 / (20 * 4**4))
    texels = texel_directions(MAP_SIDE)
    near = cKDTree(fine.centres).query_ball_point(texels, radius)
    counts = np.array([len(found) for found in near])
    columns, rows = np.concatenate(near).astype(np.int64), np.repeat(np.arange(len(near)), counts)
    squared = ((texels[rows] - fine.centres[columns]) ** 2).sum(axis=1) / radius**2
    weights = (1.0 - squared) ** 2
    total = np.bincount(rows, fine.solid_angles[columns] * weights, len(near))
    return sparse.csr_matrix((weights / total[rows], (rows, columns)), shape=(len(near), fine.n_triangles))


def texel_directions(side: int) -> NDArray[np.float64]:
    """Unit directions (side², 3) of an octahedral map's texels: |x| + |y| + |z| = 1 unfolded on a square, +Y inside."""
    v, u = np.divmod(np.arange(side * side), side)
    x, z = (u + 0.5) / side * 2.0 - 1.0, (v + 0.5) / side * 2.0 - 1.0
    y = 1.0 - np.abs(x) - np.abs(z)
    fold = np.maximum(-y, 0.0)
    x, z = x - np.copysign(fold, x), z - np.copysign(fold, z)
    directions = np.stack([x, y, z], axis=1)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
