"""The records nearest to hits that have none, where a cache takes no further records.

Sample sets that are added to light that was found must not change its records: the light between them is known, it is
the same for all materials, and beside polished metal the table is full. Few rays of such sets end where no ray has
before. They take the nearest record of their object that faces the same way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect._cache_kernels import NO_KEY, NO_RECORD
from engine.scene.surface_uvs import positions_at

if TYPE_CHECKING:
    from engine.precompute.indirect._cache_kernels import CacheTable
    from engine.scene.raycaster import Intersections
    from engine.scene.scene_loader import Scene

# How far a record may lie for one that faces away by a right angle, in sizes of a cell.
_TURN = 8.0


class NearestRecords:
    """Finds the record of an object that is nearest in position and normal."""

    def __init__(self, scene: Scene, table: CacheTable, size: float) -> None:
        """table: cut to its records; size: of a cell, in metres."""
        from scipy.spatial import cKDTree  # imported late: most scenes are opened without it

        self._scene, self._turn = scene, np.float32(_TURN * size / 2.0**0.5)
        triangle, u, v, side = (array[:, 0] for array in (table.triangle, table.u, table.v, table.side))
        places = self._places(triangle, u, v, (side & 1) == 1)
        self._of_object = {
            int(o): (own := np.flatnonzero(table.objects == o), cKDTree(places[own])) for o in np.unique(table.objects)
        }

    def fill(
        self, records: NDArray[np.uint16], keys: NDArray[np.uint64], found: Intersections,
        directions: NDArray[np.float32],
    ) -> None:  # fmt: skip
        """Writes the nearest record to records (R,) of rays that have none, but a key (R,): they end on a surface that
        reflects. directions (R, 3): of the rays. Those that end on an object without records keep none."""
        missing = np.flatnonzero((records == NO_RECORD) & (keys != NO_KEY))
        triangle = found.triangle[missing]
        from_behind = np.einsum("ni,ni->n", self._scene.geometric_normals[triangle], directions[missing]) > 0.0
        places = self._places(triangle, found.u[missing], found.v[missing], from_behind)
        objects = self._scene.object_of_triangle[triangle]
        for o in np.unique(objects):
            if int(o) in self._of_object:
                mine, (own, tree) = objects == o, self._of_object[int(o)]
                records[missing[mine]] = own[tree.query(places[mine])[1]]

    def _places(
        self, triangle: NDArray[np.integer], u: NDArray[np.float32], v: NDArray[np.float32], flipped: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """Positions and normals (n, 6) to be compared."""
        normal = np.where(flipped, -self._turn, self._turn)[:, None] * self._scene.geometric_normals[triangle]
        return np.concatenate([positions_at(self._scene, triangle, u, v), normal], axis=1).astype(np.float32)
