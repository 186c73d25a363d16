"""The points of a scene whose meshes bend: where transfer is known, how they move, and the triangles between them.

The points are Orbit's: a mesh's vertices, and more where the mesh is coarse, so that a floor of two triangles shows the
shadows on it. Open meshes, and meshes whose backs light reaches, have points on their backs as well. Pose by pose, only
what moved since the last one is updated.

The axes of detail are along texture coordinates, at the corners of an object's triangles in their current pose. A
vertex has two sets, for triangles with mirrored and with unmirrored coordinates, so that each side of a seam has its
own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from engine.core.frames import local_frames, orthonormal
from engine.realtime.core.lit_sides import lit_sides
from engine.realtime.core.raster import RasterTriangles
from engine.realtime.core.shading_points import ShadingPoints, shading_points, with_backs
from engine.realtime.zonal_harmonics.pose import Motion, Pose, Poses, check_extent, deform, transformed
from engine.realtime.zonal_harmonics.posed_scene import (
    animate_vertices,
    animation_offset,
    deformers,
    moment_of,
    resting_box,
    transform_of,
)
from engine.realtime.zonal_harmonics.transfer import TransferPoints
from engine.scene.raycaster import Intersections, RayCaster, SurfacePoints
from engine.scene.scene_loader import Scene
from engine.scene.scene_placement import MAX_EXTENT
from engine.scene.surface_uvs import corner_uvs, uvs_at

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]

_SAME_PLACE = 1e-6  # of the scene's size
_MOST_CASTERS = 3
_FACING = 0.05  # of an object's size: penalty on distance for opposite normals


class BendingPoints:
    """S points and the T triangles between them.

    places (V, 3): current positions of everything that is drawn, first the points, then the corners of emitters; frames
    (S, 3, 3): current rows tangent, bitangent, normal; rest_places, rest_frames_of_drawn: at rest. surface: the
    triangles; source (T,) and within (T, 3, 2): see `ShadingPoints`.
    """

    def __init__(self, scene: Scene, points: ShadingPoints) -> None:
        n = len(points)
        emits = np.flatnonzero(points.triangles[:, 0, 0] < 0)
        corners = points.triangles[:, 0].copy()
        corners[emits] = n + np.arange(3 * len(emits)).reshape(-1, 3)
        self._points = points
        i_object = scene.object_of_triangle[points.source]
        emitter_corners = points.corners[emits].reshape(-1, 3)
        self._rest = np.concatenate([points.position.astype(np.float64), emitter_corners])
        self._i_object = np.concatenate([points.i_object, np.repeat(i_object[emits], 3)])
        self._rest_frames = local_frames(points.tangent, points.normal)
        self.surface = RasterTriangles(corners, points.triangles, i_object.astype(np.int32))
        self.source, self.within = points.source, points.within
        self._scene = scene
        self._at = _anchors(self.surface, points, len(self._rest))
        self.places = self._rest.astype(np.float32)
        self.frames = self._rest_frames.astype(np.float32)
        self.rest_frames_of_drawn, self.rest_places = self.frames.copy(), self.places.copy()
        self._casters: dict[tuple[int, ...], RayCaster] = {}
        self._geometry: dict[int, Pose] = {}

    def __len__(self) -> int:
        return len(self._points)

    @property
    def owners(self) -> Int32Array:
        """The object (S,) of each point."""
        return self._points.i_object

    def points_of(self, i_object: int) -> NDArray[np.int64]:
        """Indices of the points of an object."""
        return np.flatnonzero(self._points.i_object == i_object)

    def rest_geometry(self, i_object: int) -> Pose:
        """The geometry that is drawn of an object, as in the scene's file; corners of emitters have no axes."""
        if i_object not in self._geometry:
            mine = np.flatnonzero(self._i_object == i_object)
            frames = np.tile(np.eye(3), (len(mine), 1, 1))
            is_point = mine < len(self)
            frames[is_point] = self._rest_frames[mine[is_point]]
            self._geometry[i_object] = Pose(self._rest[mine], frames)
        return self._geometry[i_object]

    def move_with_mesh(self, i_object: int, resting: Pose, rest: Pose, moved: Pose) -> Pose:
        """Move what `rest_geometry` returned along with the object's mesh, from rest to a pose: each vertex follows the
        triangle that it lies on."""
        mine = np.flatnonzero(self._i_object == i_object)
        source, (u, v) = self._at[0][mine], self._at[1][mine].T
        vertices = self._scene.triangles[source] - self._scene.vertex_ranges[i_object, 0]
        shares = np.stack([1.0 - u - v, u, v], axis=1)
        places = np.einsum("nk,nki->ni", shares, (moved.positions - rest.positions)[vertices])
        turns = np.einsum("vka,vkb->vab", rest.frames, moved.frames)  # rotations of row vectors
        rotated = resting.frames @ np.einsum("nk,nkab->nab", shares, turns[vertices])
        return Pose(resting.positions + places, orthonormal(rotated, resting.frames))

    def uvs(self, i_object: int) -> Float64Array:
        """Texture coordinates (P, 2 K) of an object's points; of a point with several, one of them."""
        mine = self.points_of(i_object)
        return uvs_at(self._scene, self._at[0][mine], *self._at[1][mine].T)

    def middles(self, i_object: int) -> tuple[Intersections, Float64Array, Float64Array]:
        """Positions of the centres of an object's triangles on the scene's, their texture coordinates (T, 2 K), and the
        side of the square of texture that each triangle covers, in each set (T, K)."""
        own = np.flatnonzero(self.surface.i_object == i_object)
        u, v = self.within[own].mean(axis=1).T
        uvs = self.corner_uvs(self._scene, own)
        edges = (uvs[:, 1:] - uvs[:, :1]).reshape(len(own), 2, uvs.shape[2] // 2, 2).swapaxes(1, 2)
        sides = np.sqrt(0.5 * np.abs(np.linalg.det(edges)))
        return Intersections(self.source[own], u, v, np.zeros(len(own), np.float32)), uvs.mean(axis=1), sides

    def means_around(self, i_object: int, values: Float64Array) -> Float64Array:
        """Average the triangles' values (T,) around each point of an object, weighted by area: (P,)."""
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
        """Texture coordinates (N, 3, 2 K) of the corners of triangles (N,)."""
        return self.between(triangle, corner_uvs(scene, self.source[triangle]))

    def between(self, triangle: NDArray[np.integer], values: NDArray[np.floating]) -> Float64Array:
        """Interpolate values (N, 3, k) at corners of the scene's triangles at those of triangles (N,)."""
        u, v = np.moveaxis(self.within[triangle].astype(np.float64), 2, 0)
        return np.einsum("npk,nki->npi", np.stack([1.0 - u - v, u, v], axis=2), values)

    def corners_at_rest(self, triangle: NDArray[np.integer]) -> Float64Array:
        """Positions at rest (N, 3, 3) of the corners of triangles (N,)."""
        return self._points.corners[triangle]

    def set_pose(self, i_object: int, pose: Pose) -> None:
        """Draw an object in a pose of its `rest_geometry` from now on."""
        mine = np.flatnonzero(self._i_object == i_object)
        self.places[mine] = pose.positions
        is_point = mine < len(self)
        self.frames[mine[is_point]] = pose.frames[is_point]

    def mesh(self, i_object: int, casters: tuple[int, ...]) -> TransferPoints:
        """An object's points at rest, and which of them are corners of the triangles of `caster`."""
        mine, points = self.points_of(i_object), self._points
        numbers = np.full(len(points) + 1, -1, np.int32)
        numbers[mine] = np.arange(len(mine))
        surface = SurfacePoints(points.position[mine], points.normal[mine], points.lifted[mine])
        return TransferPoints(surface, self._rest_frames[mine], numbers[points.triangles[self._of(casters), 0]])

    @cached_property
    def objects(self) -> frozenset[int]:
        """The objects that are shown, lamps among them."""
        return frozenset(np.unique(self.surface.i_object).tolist())

    def caster(self, casters: tuple[int, ...]) -> RayCaster:
        """Ray caster against all triangles of some objects at rest; the last few are cached: objects at rest share one,
        and moving lamps another."""
        if casters not in self._casters:
            found = self.caster_of(self._of(casters), self._points.corners[self._of(casters)])
            self._casters = dict([*self._casters.items()][1 - _MOST_CASTERS :]) | {casters: found}
        return self._casters[casters]

    def mean_opacity(self, triangle: NDArray[np.integer]) -> Float64Array:
        """The mean opacity (N,) of triangles (N,)."""
        cutouts = self._scene.cutouts.of_parts(self.source[triangle], self.within[triangle])
        return cutouts.mean_opacity(np.arange(len(triangle)))

    def caster_of(self, which: NDArray[np.bool_], corners: NDArray[np.floating]) -> RayCaster:
        """Ray caster against some of the triangles, `which` (T,), with these corners (t, 3, 3)."""
        cutouts = self._scene.cutouts.of_parts(self.source[which], self.within[which])
        return RayCaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), cutouts=cutouts)

    def _of(self, objects: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which triangles (T,) belong to these objects."""
        return np.isin(self.surface.i_object, objects)

    def has_same_points(self, other: BendingPoints, i_object: int) -> bool:
        """Whether an object has the same points here and in another set of the scene's points."""
        mine, its = self.points_of(i_object), other.points_of(i_object)
        return len(mine) == len(its) and np.array_equal(self._rest[mine], other._rest[its])

    def nearest_of(self, other: BendingPoints) -> NDArray[np.int64]:
        """For each point the nearest point (S,) of another set, of the same object and with a similar normal."""
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
        """Everything that an object's transfer depends on, except materials."""
        mine = self.points_of(i_object)
        holes = np.frombuffer(self._scene.cutouts.digest.encode(), np.uint8)
        arrays = self._points.lifted[mine], self._rest_frames[mine], self._points.corners[self._of(casters)]
        return (*arrays, holes) if len(holes) else arrays


def bending_points(
    scene: Scene, caster: RayCaster, n_points: int, even: NDArray[np.bool_] | None = None
) -> BendingPoints:
    """Make the points, about n_points in addition to the meshes' vertices; caster: intersects the scene's triangles;
    even: see `shading_points`."""
    points = shading_points(scene, caster, n_points, even, is_whole=True)
    # Rays start above the points themselves, where lobes are fitted, and not beside them as Orbit's do.
    points = replace(points, lifted=caster.offset_origins(points.position, points.normal))
    return BendingPoints(scene, with_backs(points, _is_open(scene) | lit_sides(scene, caster).reached[:, 1]))


def _anchors(surface: RasterTriangles, points: ShadingPoints, count: int) -> tuple[NDArray[np.int64], Float64Array]:
    """The scene's triangle (N,) on which each of `count` points lies, and u and v (N, 2) there."""
    source, within = np.zeros(count, np.int64), np.zeros((count, 2))
    for numbers in (surface.corners, surface.sides[:, 0], surface.sides[:, 1]):
        for k in range(3):
            is_point = numbers[:, k] >= 0
            source[numbers[is_point, k]] = points.source[is_point]
            within[numbers[is_point, k]] = points.within[is_point, k]
    return source, within


def _is_open(scene: Scene) -> NDArray[np.bool_]:
    """Which objects (M,) have edges with only one triangle, so that their backs can be seen."""
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


class PosedPoints:
    """The points of a scene, pose by pose."""

    def __init__(self, scene: Scene, points: BendingPoints) -> None:
        self._scene, self._points = scene, points
        self._poses: dict[int, tuple[object, Pose]] = {}
        self._shifts: dict[int, NDArray[np.float64]] = {}
        self._axes: dict[int, SurfaceAxes] = {}
        self._axes_now: dict[int, tuple[object, Float32Array]] = {}

    def at(self, poses: Poses) -> tuple[Float32Array, Float32Array]:
        """Positions (V, 3) of everything that is drawn, and axes (S, 3, 3) of points. Raises InsituError if an object
        would extend beyond the largest allowed scene."""
        scene = self._scene
        rows = {scene.object_index(name): row for name, row in poses if name in scene.object_names}
        for i in range(len(scene.smooth)):
            row = rows.get(i, ())
            if i not in self._poses or self._poses[i][0] != row:
                self._poses[i] = row, self._pose(i, row)
                self._points.set_pose(i, self._poses[i][1])
        return self._points.places, self._points.frames

    def animation_offsets(self, poses: Poses) -> dict[str, tuple[float, float, float]]:
        """Translations (x, y, z) by animations of the objects in these poses, by name; unknown names are ignored,
        because a document may have an object before the scene is opened with it."""
        self.at(poses)
        names = [name for name, _ in poses if name in self._scene.object_names]
        shifts = {name: self._shifts[self._scene.object_index(name)] for name in names}
        return {name: (float(x), float(y), float(z)) for name, (x, y, z) in shifts.items() if x or y or z}

    def axes_of(self, i: int) -> tuple[Int32Array, Float32Array]:
        """Indices of the axes along texture coordinates at the corners of an object's triangles, and the current axes,
        see `SurfaceAxes`."""
        if i not in self._axes:
            self._axes[i] = SurfaceAxes(self._scene, self._points, i)
        pose, own = self._poses[i][1], self._axes[i]
        if i not in self._axes_now or self._axes_now[i][0] is not pose:
            self._axes_now[i] = pose, own.now()
        return own.numbers, self._axes_now[i][1]

    def _pose(self, i: int, row: Motion) -> Pose:
        """Compute the pose of everything that is drawn of an object."""
        carried = resting = self._points.rest_geometry(i)
        self._shifts[i] = np.zeros(3)
        if not len(resting.positions):  # it is hidden
            return resting
        if moment_of(self._scene, i, row) is not None:
            rest, moment = animate_vertices(self._scene, i, row)
            carried, self._shifts[i] = (
                self._points.move_with_mesh(i, resting, rest, moment),
                animation_offset(rest, moment),
            )
        pose = deform(carried, deformers(row), resting.box + self._shifts[i])
        if (transform := transform_of(row)) is not None:
            pose = transformed(pose, transform, resting_box(self._scene, i).mean(axis=0))
        check_extent(self._scene.object_names[i], pose.positions, MAX_EXTENT)
        return pose


class SurfaceAxes:
    """Axes of one object's triangles. numbers (T, 3): indices of the corners' axes, of all triangles, -1 for other
    objects."""

    def __init__(self, scene: Scene, points: BendingPoints, i_object: int) -> None:
        surface, self._points = points.surface, points
        mine = np.flatnonzero(surface.i_object == i_object)
        self._own, corners = np.unique(surface.corners[mine], return_inverse=True)
        self._corners = corners.reshape(-1, 3).astype(np.int32)
        self._uvs = points.corner_uvs(scene, mine)[..., :2]
        self.numbers = np.full((len(surface.corners), 3), -1, np.int32)
        self.numbers[mine] = numbers_of(self._corners, self._uvs)

    def now(self) -> NDArray[np.float32]:
        """The current axes (A, 3, 3), rows: along u, along v, outwards."""
        places, frames = (each[self._own] for each in (self._points.places, self._points.frames))
        return uv_axes(places, self._corners, self._uvs, frames).astype(np.float32)


def uv_axes(positions: ArrayLike, triangles: Int32Array, uvs: ArrayLike, frames: ArrayLike) -> Float64Array:
    """Axes (2 V, 3, 3), rows: along u, along v, normal; vertex k has the axes 2 k, and 2 k + 1, left-handed, for
    triangles with mirrored coordinates.

    positions (V, 3) and frames (V, 3, 3): current vertices; uvs (T, 3, 2). A corner's u is the mean over the triangles
    of its vertex with the same handedness; where coordinates are degenerate, the vertex's tangent.
    """
    positions, uvs, frames = (np.asarray(each, np.float64) for each in (positions, uvs, frames))
    corners = positions[triangles]
    edges, steps = corners[:, 1:] - corners[:, :1], uvs[:, 1:] - uvs[:, :1]
    along = edges[:, 0] * steps[:, 1, 1, None] - edges[:, 1] * steps[:, 0, 1, None]
    along *= np.where(_is_mirrored(uvs), -1.0, 1.0)[:, None]
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    weight = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1, keepdims=True)
    along = np.where(lengths > 0.0, along / np.where(lengths > 0.0, lengths, 1.0), 0.0) * weight
    total = np.zeros((2 * len(positions), 3))
    for corner in numbers_of(triangles, uvs).T:
        for axis in range(3):
            total[:, axis] += np.bincount(corner, along[:, axis], len(total))
    at = np.repeat(frames, 2, axis=0)
    found = orthonormal(np.stack([total, at[:, 1], at[:, 2]], axis=1), at)
    found[1::2, 1] *= -1.0
    return found


def numbers_of(triangles: Int32Array, uvs: ArrayLike) -> Int32Array:
    """Indices into `uv_axes` of the triangles' corners (T, 3)."""
    return 2 * triangles + _is_mirrored(np.asarray(uvs, np.float64))[:, None].astype(np.int32)


def _is_mirrored(uvs: Float64Array) -> NDArray[np.bool_]:
    """Which triangles (T,) have coordinates (T, 3, 2) of opposite orientation."""
    steps = uvs[:, 1:] - uvs[:, :1]
    return np.asarray(steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0] < 0.0)
