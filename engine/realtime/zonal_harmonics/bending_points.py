"""The points of a scene whose meshes bend: where transfer is known, how they move, and the triangles between them.

They are those of Orbit: a mesh's vertices, and more of them where it is coarse, so that a floor of two triangles
shows what stands on it. Meshes that are open, or whose backs light reaches, have points on their backs, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from engine.realtime.triple_product.lit_faces import lit_sides
from engine.realtime.triple_product.shading_points import ShadingPoints, shading_points, with_backs
from engine.realtime.zonal_harmonics.pose import Pose, orthonormal
from engine.realtime.zonal_harmonics.raster import RasterTriangles
from engine.realtime.zonal_harmonics.transfer import TransferPoints
from engine.scene.local_frames import local_frames
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_points import SurfacePoints
from engine.scene.surface_uvs import corner_uvs, uvs_at

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]

_SAME_PLACE = 1e-6  # of the scene's size
_FACING = 0.05  # of an object's size, that what faces another way is farther off


class BendingPoints:
    """S points and the T triangles between them.

    places (V, 3): where what is drawn is now, the points before the corners of emitters; frames (S, 3, 3): rows
    tangent, bitangent, normal, now. surface: the triangles; source (T,) and within (T, 3, 2): see `ShadingPoints`.
    """

    def __init__(self, scene: Scene, points: ShadingPoints) -> None:
        n = len(points)
        shines = np.flatnonzero(points.triangles[:, 0, 0] < 0)
        corners = points.triangles[:, 0].copy()
        corners[shines] = n + np.arange(3 * len(shines)).reshape(-1, 3)
        self._points = points
        i_object = scene.object_of_triangle[points.source]
        lamps = points.corners[shines].reshape(-1, 3)
        self._rest = np.concatenate([points.position.astype(np.float64), lamps])
        self._i_object = np.concatenate([points.i_object, np.repeat(i_object[shines], 3)])
        self._rest_frames = local_frames(points.tangent, points.normal)
        self.surface = RasterTriangles(corners, points.triangles, i_object.astype(np.int32))
        self.source, self.within = points.source, points.within
        self._scene = scene
        self._at = _anchors(self.surface, points, len(self._rest))
        self.places = self._rest.astype(np.float32)
        self.frames = self._rest_frames.astype(np.float32)
        self.rest_frames_of_drawn = self.frames.copy()
        self._caster: tuple[tuple[int, ...], RayCaster] | None = None

    def __len__(self) -> int:
        return len(self._points)

    @property
    def owners(self) -> Int32Array:
        """The object (S,) of each point."""
        return self._points.i_object

    def points_of(self, i_object: int) -> NDArray[np.int64]:
        """The points of an object."""
        return np.flatnonzero(self._points.i_object == i_object)

    def rest_geometry(self, i_object: int) -> Pose:
        """All that is drawn of an object, as the scene's file has it; of an emitter's corners the axes are none."""
        mine = np.flatnonzero(self._i_object == i_object)
        frames = np.tile(np.eye(3), (len(mine), 1, 1))
        is_point = mine < len(self)
        frames[is_point] = self._rest_frames[mine[is_point]]
        return Pose(self._rest[mine], frames)

    def move_with_mesh(self, i_object: int, resting: Pose, rest: Pose, moved: Pose) -> Pose:
        """What `rest_geometry` gave when the vertices of the object's mesh go from rest to a pose: each goes as the
        triangle does that it lies on."""
        mine = np.flatnonzero(self._i_object == i_object)
        source, (u, v) = self._at[0][mine], self._at[1][mine].T
        vertices = self._scene.triangles[source] - self._scene.vertex_ranges[i_object, 0]
        shares = np.stack([1.0 - u - v, u, v], axis=1)
        places = np.einsum("nk,nki->ni", shares, (moved.positions - rest.positions)[vertices])
        turns = np.einsum("vka,vkb->vab", rest.frames, moved.frames)  # of row vectors
        turned = resting.frames @ np.einsum("nk,nkab->nab", shares, turns[vertices])
        return Pose(resting.positions + places, orthonormal(turned, resting.frames))

    def uvs(self, i_object: int) -> Float64Array:
        """Texture coordinates (P, 2) of an object's points; of one that has several, any of them."""
        mine = self.points_of(i_object)
        return uvs_at(self._scene, self._at[0][mine], *self._at[1][mine].T)

    def middles(self, i_object: int) -> tuple[Intersections, Float64Array, Float64Array]:
        """Where the middles of an object's triangles lie on the scene's, their texture coordinates (T, 2), and how wide
        a square of the texture each of the triangles covers (T,)."""
        own = np.flatnonzero(self.surface.i_object == i_object)
        u, v = self.within[own].mean(axis=1).T
        uvs = self.corner_uvs(self._scene, own)
        sides = np.sqrt(0.5 * np.abs(np.linalg.det(uvs[:, 1:] - uvs[:, :1])))
        return Intersections(self.source[own], u, v, np.zeros(len(own), np.float32)), uvs.mean(axis=1), sides

    def means_around(self, i_object: int, values: Float64Array) -> Float64Array:
        """By area the means (P,) around an object's points of what its triangles (T,) have."""
        own = np.flatnonzero(self.surface.i_object == i_object)
        a, b, c = np.moveaxis(self._points.corners[own].astype(np.float64), 1, 0)
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        sides = self.surface.sides[own]
        is_point = sides >= 0

        def summed(each: Float64Array) -> Float64Array:
            shares = np.broadcast_to(each[:, None, None], sides.shape)[is_point]
            return np.asarray(np.bincount(sides[is_point], shares, len(self))[self.points_of(i_object)], np.float64)

        return np.asarray(summed(values * areas) / np.maximum(summed(areas), 1e-300))

    def corner_uvs(self, scene: Scene, triangle: NDArray[np.integer]) -> Float64Array:
        """Texture coordinates (N, 3, 2) of the corners of triangles (N,)."""
        u, v = np.moveaxis(self.within[triangle].astype(np.float64), 2, 0)
        shares = np.stack([1.0 - u - v, u, v], axis=2)
        return np.einsum("npk,nki->npi", shares, corner_uvs(scene, self.source[triangle]))

    def corners_at_rest(self, triangle: NDArray[np.integer]) -> Float64Array:
        """Where the corners of triangles (N,) are at rest (N, 3, 3)."""
        return self._points.corners[triangle]

    def set_pose(self, i_object: int, pose: Pose) -> None:
        """Draw an object in a pose of what `rest_geometry` gave from now on."""
        mine = np.flatnonzero(self._i_object == i_object)
        self.places[mine] = pose.positions
        is_point = mine < len(self)
        self.frames[mine[is_point]] = pose.frames[is_point]

    def mesh(self, i_object: int, casters: tuple[int, ...]) -> TransferPoints:
        """An object's points at rest, and which corners of the triangles of `caster` they are."""
        mine, points = self.points_of(i_object), self._points
        numbers = np.full(len(points) + 1, -1, np.int32)
        numbers[mine] = np.arange(len(mine))
        surface = SurfacePoints(points.position[mine], points.normal[mine], points.lifted[mine])
        return TransferPoints(surface, self._rest_frames[mine], numbers[points.triangles[self._of(casters), 0]])

    def caster(self, casters: tuple[int, ...]) -> RayCaster:
        """Rays against all triangles of some objects at rest; the last is kept, for objects that rest share one."""
        if self._caster is None or self._caster[0] != casters:
            corners = self._points.corners[self._of(casters)]
            caster = RayCaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
            self._caster = casters, caster
        return self._caster[1]

    def _of(self, objects: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which triangles (T,) are theirs."""
        return np.isin(self.surface.i_object, objects)

    def has_same_points(self, other: BendingPoints, i_object: int) -> bool:
        """Whether an object has the same points among these as among others of the scene."""
        mine, its = self.points_of(i_object), other.points_of(i_object)
        return len(mine) == len(its) and np.array_equal(self._rest[mine], other._rest[its])

    def nearest_of(self, other: BendingPoints) -> NDArray[np.int64]:
        """For each point the nearest (S,) among others of the scene, of the same object and facing the same way."""
        found = np.zeros(len(self), np.int64)
        for i in np.unique(self._points.i_object):
            mine, its = self.points_of(i), other.points_of(i)
            if self.has_same_points(other, i):
                found[mine] = its
                continue
            reach = _FACING * float(np.ptp(self._rest[mine], axis=0).max(initial=0.0))
            here, there = (
                np.hstack([each._rest[own], reach * each._rest_frames[own, 2]])
                for each, own in ((self, mine), (other, its))
            )
            found[mine] = its[cKDTree(there).query(here)[1]]
        return found

    def geometry(self, i_object: int, casters: tuple[int, ...]) -> tuple[NDArray[np.generic], ...]:
        """All that an object's transfer hangs on, but for materials."""
        mine = self.points_of(i_object)
        return (self._points.lifted[mine], self._rest_frames[mine], self._points.corners[self._of(casters)])


def bending_points(
    scene: Scene, caster: RayCaster, n_points: int, even: NDArray[np.bool_] | None = None
) -> BendingPoints:
    """About n_points besides the meshes' own vertices; caster: of the scene's triangles; even: see `shading_points`."""
    points = shading_points(scene, caster, n_points, even, is_whole=True)
    # Rays go out above the points themselves: beside them, as Orbit's do, they may begin within a coarse mesh.
    points = replace(points, lifted=caster.offset_origins(points.position, points.normal))
    return BendingPoints(scene, with_backs(points, _is_open(scene) | lit_sides(scene, caster).reached[:, 1]))


def _anchors(surface: RasterTriangles, points: ShadingPoints, count: int) -> tuple[NDArray[np.int64], Float64Array]:
    """The scene's triangle (N,) that each of so many points lies on, and u and v (N, 2) there."""
    source, within = np.zeros(count, np.int64), np.zeros((count, 2))
    for numbers in (surface.corners, surface.sides[:, 0], surface.sides[:, 1]):
        for k in range(3):
            is_point = numbers[:, k] >= 0
            source[numbers[is_point, k]] = points.source[is_point]
            within[numbers[is_point, k]] = points.within[is_point, k]
    return source, within


def _is_open(scene: Scene) -> NDArray[np.bool_]:
    """Which objects (M,) have edges with a triangle on one side alone, so that their backs can be seen."""
    size = float(np.abs(scene.vertices).max(initial=0.0)) or 1.0
    keys = np.round(scene.vertices / (size * _SAME_PLACE)).astype(np.int64)
    _, welded = np.unique(keys, axis=0, return_inverse=True)
    corners = welded.ravel()[scene.triangles]
    edges = np.sort(np.concatenate([corners[:, (0, 1)], corners[:, (1, 2)], corners[:, (2, 0)]]), axis=1)
    ids = np.tile(scene.object_of_triangle, 3)
    solid = edges[:, 0] != edges[:, 1]
    rows, counts = np.unique(np.column_stack([ids, edges])[solid], axis=0, return_counts=True)
    open_ = np.zeros(len(scene.smooth), bool)
    open_[rows[counts == 1, 0]] = True
    return open_
