"""Rays against a scene some of whose objects were moved since its BVH was built.

Building a BVH of everything for each step of a drag takes longer than the step. So the BVH stays, and rays pass the
triangles of the objects that have gone (`RestCaster`); each of these has a BVH of its own, at the place where it was,
and rays are taken there by the inverse of its movement (`MovedCaster`). Nothing is built while an object moves, and a
ray that comes near no object that moved gets the answer of the scene's BVH, bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from engine.scene.raycaster import Cutouts, Float32Array, Intersections, RayCaster

Float64Array = npt.NDArray[np.float64]

_STEP = 16.0 * float(np.finfo(np.float32).eps)  # see `engine.scene.raycaster`
_MOST_PASSED = 64  # triangles of an object that has gone, one behind the other


@dataclass(frozen=True, eq=False)
class MovedPart:
    """An object that may be moved: the numbers of its triangles (T,) in the scene, and the BVH of these alone; sphere
    (4,): the centre and the radius of one around it. Both are of the place where the scene's BVH has it."""

    numbers: npt.NDArray[np.int32]
    caster: RayCaster
    sphere: Float64Array

    def moved_sphere(self, matrix: Float64Array) -> Float64Array:
        """A sphere around it (4,) after an affine movement (4, 4)."""
        centre = matrix[:3, :3] @ self.sphere[:3] + matrix[:3, 3]
        return np.append(centre, self.sphere[3] * np.linalg.norm(matrix[:3, :3], 2))


class TrianglesCutouts:
    """The cutouts of some of the triangles."""

    def __init__(self, cutouts: Cutouts, numbers: npt.NDArray[np.integer]) -> None:
        self._cutouts, self._numbers = cutouts, numbers
        self.passable, self.blends = cutouts.passable[numbers], cutouts.blends

    def opacity_at(self, triangle: npt.NDArray[np.integer], u: npt.NDArray, v: npt.NDArray) -> npt.NDArray:
        return self._cutouts.opacity_at(self._numbers[triangle], u, v)


def movable_part(
    vertices: npt.NDArray, triangles: npt.NDArray[np.integer], numbers: npt.NDArray[np.integer],
    cutouts: Cutouts | None = None,
) -> MovedPart:  # fmt: skip
    """The part that some triangles (T,) of a scene are: vertices (V, 3), triangles (N, 3)."""
    own = triangles[numbers]
    used = vertices[np.unique(own)].astype(np.float64)
    centre = 0.5 * (used.min(axis=0) + used.max(axis=0))
    radius = float(np.linalg.norm(used - centre, axis=1).max())
    caster = RayCaster(vertices, own, cutouts=None if cutouts is None else TrianglesCutouts(cutouts, numbers))
    return MovedPart(np.asarray(numbers, np.int32), caster, np.append(centre, radius))


class RestCaster(RayCaster):
    """Rays against all triangles of a BVH but those of some parts."""

    def __init__(self, base: RayCaster, n_triangles: int, gone: Mapping[int, MovedPart]) -> None:
        """base: the BVH, of so many triangles."""
        self._base, self._gone = base, np.zeros(n_triangles, bool)
        self._offset, self._cutouts = base.offset, base.cutouts
        for part in gone.values():
            self._gone[part.numbers] = True
        self._spheres = np.array([part.sphere for part in gone.values()]).reshape(-1, 4)

    def occluded(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, distance: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.bool_]:
        origins, directions = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        blocked = self._base.occluded(origins, directions, distance)
        rows = np.flatnonzero(blocked)
        rows = rows[_meets(self._spheres, origins[rows], directions[rows])]
        if len(rows):
            found = self._passing(
                self._base.intersect(origins[rows], directions[rows]), origins[rows], directions[rows]
            )
            limit = np.inf if distance is None else np.asarray(distance, np.float32)[rows]
            blocked[rows] = (found.triangle >= 0) & (found.distance < limit)
        return blocked

    def intersect(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, chances: Float32Array | None = None
    ) -> Intersections:
        origins, directions = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        return self._passing(self._base.intersect(origins, directions, chances), origins, directions, chances)

    def _passing(
        self, found: Intersections, origins: Float32Array, directions: Float32Array, chances: Float32Array | None = None
    ) -> Intersections:
        """Let rays that have hit what is gone go on behind it."""
        rows, passed = np.flatnonzero(found.triangle >= 0), np.zeros(len(origins))
        lengths = np.linalg.norm(directions.astype(np.float64), axis=1)
        for _ in range(_MOST_PASSED):
            rows = rows[self._gone[found.triangle[rows]]]
            if not len(rows):
                break
            passed[rows] = found.distance[rows] * (1.0 + _STEP) + self._offset / lengths[rows]
            start = (origins[rows] + passed[rows, None] * directions[rows]).astype(np.float32)
            nearer = self._base.intersect(start, directions[rows], None if chances is None else chances[rows])
            found.triangle[rows], found.u[rows], found.v[rows] = nearer.triangle, nearer.u, nearer.v
            found.distance[rows] = passed[rows] + nearer.distance
            rows = rows[nearer.triangle >= 0]
        else:
            found.triangle[rows], found.distance[rows] = -1, np.inf
        return found


class MovedCaster(RayCaster):
    """Rays against the rest of a scene, and parts of it where they were moved to."""

    def __init__(self, rest: RestCaster, parts: Mapping[int, MovedPart], matrices: Mapping[int, Float64Array]) -> None:
        """matrices (4, 4): the movement of each part."""
        self.rest, self._parts = rest, dict(parts)
        self._offset, self._cutouts = rest.offset, rest.cutouts
        self._inverse = {i: np.linalg.inv(matrices[i]).astype(np.float32) for i in parts}
        self._spheres = {i: part.moved_sphere(matrices[i])[None] for i, part in parts.items()}

    @property
    def spheres(self) -> Float64Array:
        """Spheres (K, 4) around the parts, where they are: centre and radius."""
        return self.spheres_of(self._spheres)

    def spheres_of(self, parts: Iterable[int]) -> Float64Array:
        """Those of some parts (K, 4)."""
        return np.concatenate([np.zeros((0, 4)), *(self._spheres[i] for i in parts if i in self._spheres)])

    def occluded(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, distance: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.bool_]:
        origins, directions = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        return self.rest.occluded(origins, directions, distance) | self.parts_block(origins, directions, distance)

    def parts_block(
        self, origins: Float32Array, directions: Float32Array, distance: npt.ArrayLike | None = None,
        except_part: int = -1,
    ) -> npt.NDArray[np.bool_]:  # fmt: skip
        """Whether one of the parts alone blocks rays (R,), see `RayCaster.occluded`; except_part: one that does not."""
        blocked = np.zeros(len(origins), bool)
        for i, part in self._parts.items():
            if i == except_part:
                continue
            if len(self._parts) == 1:  # these rays are meant for it
                return part.caster.occluded(*self._in_place(i, origins, directions), distance)
            rows = np.flatnonzero(~blocked)
            rows = rows[_meets(self._spheres[i], origins[rows], directions[rows])]
            limit = None if distance is None else np.asarray(distance, np.float32)[rows]
            blocked[rows] = part.caster.occluded(*self._in_place(i, origins[rows], directions[rows]), limit)
        return blocked

    def intersect(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, chances: Float32Array | None = None
    ) -> Intersections:
        origins, directions = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        found = self.rest.intersect(origins, directions, chances)
        for i, part in self._parts.items():
            rows = np.flatnonzero(_meets(self._spheres[i], origins, directions))
            if not len(rows):
                continue
            own = None if chances is None else chances[rows]
            hits = part.caster.intersect(*self._in_place(i, origins[rows], directions[rows]), own)
            # A movement keeps the lengths along a ray in units of its direction.
            nearer = np.flatnonzero((hits.triangle >= 0) & (hits.distance < found.distance[rows]))
            at = rows[nearer]
            found.triangle[at], found.distance[at] = part.numbers[hits.triangle[nearer]], hits.distance[nearer]
            found.u[at], found.v[at] = hits.u[nearer], hits.v[nearer]
        return found

    def _in_place(self, i: int, origins: Float32Array, directions: Float32Array) -> tuple[Float32Array, Float32Array]:
        """Rays as they are to a part at the place of its BVH."""
        inverse = self._inverse[i]
        return origins @ inverse[:3, :3].T + inverse[:3, 3], directions @ inverse[:3, :3].T


def _meets(spheres: Float64Array, origins: Float32Array, directions: Float32Array) -> npt.NDArray[np.bool_]:
    """Which rays (R,) meet one of some spheres (K, 4)."""
    found = np.zeros(len(origins), bool)
    squared = np.einsum("rk,rk->r", directions, directions)
    for x, y, z, radius in spheres.astype(np.float32):
        towards = np.array([x, y, z], np.float32) - origins
        along = np.einsum("rk,rk->r", towards, directions)
        distance = np.einsum("rk,rk->r", towards, towards)
        # The ray's line passes the centre at a distance whose square is |c|² − (c·d)² / |d|².
        reach = np.float32(radius * radius * 1.001)
        found |= (distance <= reach) | (along > 0.0) & (distance * squared - along * along <= reach * squared)
    return found
