"""The only wrapper of Embree: every ray of the project passes here.

The library underneath checks nothing (shapes, bounds, NaN), changes distances in place and ignores geometry added after
the first query; so the arrays are validated here, the BVH is built once, in the constructor, and batches are divided
over threads (the library releases the interpreter lock while it traces). Internally, the scene is moved to the origin
and scaled by a power of two unless it is about there already: this is exact, and preserves single precision from dust
to mountains. A scene of ordinary place and size is left alone, and its rays pass without a copy.

Triangles that rays may pass (`Cutouts`) have a BVH of their own: a ray that meets one where it is not there goes on
behind it. So scenes without any are traced as if there were none, and in others a shadow ray that a solid triangle
blocks asks for nothing more. The library calls no function of ours for each hit, which would be the other way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from engine.core.threads import has_own_threads, n_threads

Float32Array = npt.NDArray[np.float32]

_CHUNK = 32768
_FARTHEST = np.float32(1e37)
_EPSILON = float(np.finfo(np.float32).eps)
# The error of a hit is a few ulp of the coordinates: with an offset of 4 ε, a curved handle shadowed itself by 4 %.
_OFFSET = 32.0 * _EPSILON
# Behind a triangle that it passes a ray goes on after this share of the distance so far, besides the offset.
_STEP = 16.0 * _EPSILON
LAST_CHANCE = np.nextafter(np.float32(1.0), np.float32(0.0))


@dataclass(frozen=True)
class Intersections:
    """First hits of R rays: triangle (R,) int32, −1 for a miss; barycentric u, v; distance (inf for a miss).

    The point is (1 − u − v) A + u B + v C for the triangle's corners A, B, C.
    """

    triangle: npt.NDArray[np.int32]
    u: Float32Array
    v: Float32Array
    distance: Float32Array

    def of(self, rays: npt.NDArray[np.integer]) -> Intersections:
        """Select some of them."""
        return Intersections(self.triangle[rays], self.u[rays], self.v[rays], self.distance[rays])


class Cutouts(Protocol):
    """Which triangles (T,) rays may pass, and by what share: `opacity_at` gives it for points of some of them (N,), by
    their barycentric coordinates, from 0, where all rays pass, to 1, where none does; `blends`: whether any is between.
    """

    @property
    def passable(self) -> npt.NDArray[np.bool_]: ...

    @property
    def blends(self) -> bool: ...

    def opacity_at(self, triangle: npt.NDArray[np.integer], u: npt.NDArray, v: npt.NDArray) -> npt.NDArray: ...


class _Bvh:
    """Some of the triangles, in the library's form."""

    def __init__(self, vertices: Float32Array, faces: npt.NDArray[np.int32]) -> None:
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, vertices, faces)
        self.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32), query="OCCLUDED")  # builds it

    def run(self, *rays: Any, **how: Any) -> Any:
        """The library's query; it writes into distances."""
        return self._scene.run(*rays, **how)


class RayCaster:
    """Ray queries against triangles that never change. Safe to use from several threads."""

    def __init__(
        self, vertices: npt.ArrayLike, triangles: npt.ArrayLike, threads: int | None = None,
        cutouts: Cutouts | None = None,
    ) -> None:  # fmt: skip
        """vertices (V, 3) finite, triangles (T, 3) indices, T ≥ 0; threads: 0 or None for all cores; cutouts: where
        rays pass, None for nowhere.

        Raises ValueError for arrays of another shape, with indices out of range or with numbers that are not finite.
        """
        world = _checked_vertices(vertices)
        faces = _checked_triangles(triangles, len(world))
        used = world[np.unique(faces)]
        self._centre, self._scale = _normalization(used)
        local = np.ascontiguousarray((world - self._centre) * self._scale, dtype=np.float32)
        self._identity = self._scale == 1.0 and not self._centre.any()
        largest = float(np.abs((used - self._centre) * self._scale).max(initial=0.0))
        self._offset = _OFFSET * (largest + float(np.abs(self._centre).max()) * self._scale) / self._scale
        self._n_threads = threads or n_threads()
        # Persistent threads, a second pool for threads for which `has_own_threads`; they start on first use.
        self._pools = {is_apart: ThreadPoolExecutor(self._n_threads, "rays") for is_apart in (False, True)}
        self._cutouts = cutouts if cutouts is not None and cutouts.passable.any() else None
        # Numbers of the triangles that rays may pass, and of all others.
        passable = np.zeros(len(faces), bool) if self._cutouts is None else self._cutouts.passable
        self._passable, self._others = (np.flatnonzero(which).astype(np.int32) for which in (passable, ~passable))
        self._solid = _Bvh(local, faces[self._others]) if len(self._others) else None
        self._holed = _Bvh(local, faces[self._passable]) if len(self._passable) else None

    @property
    def cutouts(self) -> Cutouts | None:
        """Where rays pass through the triangles; None for nowhere."""
        return self._cutouts

    @property
    def blends(self) -> bool:
        """Whether some rays pass a surface at random, so that those around a ray say nothing of it."""
        return self._cutouts is not None and self._cutouts.blends

    @property
    def offset(self) -> float:
        """Distance by which `offset_origins` lifts a point, in metres: 32 ε max|p| over the scene."""
        return self._offset

    def occluded(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, distance: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.bool_]:
        """Whether anything intersects each ray (R,) nearer than `distance` (R,) in lengths of its direction.

        origins, directions (R, 3); contiguous float32 arrays are used without a copy. distance > 0, or None for no
        limit.
        """
        origins, directions, limits = _checked_rays(origins, directions, distance)
        blocked = np.zeros(len(origins), bool)

        def trace(part: slice) -> None:
            rays = self._local(origins, directions, part)
            reach = self._limits(limits, part)
            if self._solid is not None:
                np.greater_equal(self._solid.run(*rays, reach, "OCCLUDED"), 0, out=blocked[part])
            if self._holed is not None:
                rows = np.flatnonzero(~blocked[part])
                reach = self._limits(limits, part)
                chances = self._chances(origins[part][rows], directions[part][rows])
                limit = None if reach is None else reach[rows]
                found = self._first_there(rays[0][rows], rays[1][rows], limit, chances)
                blocked[part][rows] = found.triangle >= 0

        self._split(len(origins), trace)
        return blocked

    def intersect(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, chances: Float32Array | None = None
    ) -> Intersections:
        """The first hit of each ray: origins, directions (R, 3); distances in lengths of the direction. chances (R,):
        numbers in [0, 1), less than the opacity of the surfaces that a ray meets; None: a hash of each ray."""
        origins, directions, _ = _checked_rays(origins, directions, None)
        n = len(origins)
        hits = Intersections(
            np.full(n, -1, np.int32), np.zeros(n, np.float32), np.zeros(n, np.float32), np.full(n, np.inf, np.float32)
        )

        def trace(part: slice) -> None:
            rays = self._local(origins, directions, part)
            if self._solid is not None:
                found = self._solid.run(*rays, output=True)
                hits.triangle[part], hits.u[part], hits.v[part] = found["primID"], found["u"], found["v"]
                np.divide(found["tfar"], self._scale, out=hits.distance[part], where=found["primID"] >= 0)
            if self._holed is not None:
                met = hits.triangle[part] >= 0
                hits.triangle[part][met] = self._others[hits.triangle[part][met]]
                own = self._chances(origins[part], directions[part]) if chances is None else chances[part]
                nearer = self._first_there(*rays, self._limits(hits.distance, part), own)
                rows = np.flatnonzero(nearer.triangle >= 0)
                for name, values in vars(nearer).items():
                    getattr(hits, name)[part][rows] = values[rows]

        self._split(n, trace)
        return hits

    def _first_there(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array | None,
        chances: Float32Array,
    ) -> Intersections:  # fmt: skip
        """The first hits of rays (R,) on triangles that they may pass, where the opacity exceeds their chances; rays
        and limits in the BVH's frame.

        A ray that passes an opacity a has a chance c ≥ a; (c − a) / (1 − a) is uniform again. So a ray passes several
        surfaces if c is at least 1 − Π (1 − a), and evenly spread chances pass them in equally even parts.
        """
        assert self._holed is not None and self._cutouts is not None
        n = len(origins)
        hits = Intersections(
            np.full(n, -1, np.int32), np.zeros(n, np.float32), np.zeros(n, np.float32), np.full(n, np.inf, np.float32)
        )
        reach = np.full(n, _FARTHEST) if limits is None else limits
        lengths = np.linalg.norm(directions, axis=1)
        rows, passed = np.arange(n), np.zeros(n, np.float32)  # rays on their way, and how far each is
        left = chances.astype(np.float32)  # a copy
        while len(rows):
            start = origins[rows] + passed[rows, None] * directions[rows]
            found = self._holed.run(start, directions[rows], reach[rows] - passed[rows], output=True)
            met = np.flatnonzero(found["primID"] >= 0)
            rows, u, v = rows[met], found["u"][met], found["v"][met]
            triangle, distance = self._passable[found["primID"][met]], passed[rows] + found["tfar"][met]
            opacity = self._cutouts.opacity_at(triangle, u, v)
            there = opacity > left[rows]
            at = rows[there]
            hits.triangle[at], hits.u[at], hits.v[at] = triangle[there], u[there], v[there]
            hits.distance[at] = distance[there] / self._scale
            # The others go on behind it, as far as they may.
            rows, distance, opacity = rows[~there], distance[~there], opacity[~there]
            left[rows] = np.minimum((left[rows] - opacity) / (1.0 - opacity), LAST_CHANCE)
            passed[rows] = distance * (1.0 + _STEP) + self._offset * self._scale / lengths[rows]
            rows = rows[passed[rows] < reach[rows]]
        return hits

    def _chances(self, origins: Float32Array, directions: Float32Array) -> Float32Array:
        """The chances of rays (R,); where none count, zeros."""
        return _hashed(origins, directions) if self.blends else np.zeros(len(origins), np.float32)

    def offset_origins(self, points: npt.NDArray, geometric_normals: npt.NDArray) -> Float32Array:
        """Lift points (P, 3) off their surface along its normal (P, 3), far enough for a ray not to hit it again.

        The lift is 32 ε max|p| with ε = 2⁻²³ and the maximum over the scene: it follows the scene's size.
        """
        return (np.asarray(points, np.float64) + self._offset * np.asarray(geometric_normals)).astype(np.float32)

    def _local(self, origins: Float32Array, directions: Float32Array, part: slice) -> tuple[Float32Array, Float32Array]:
        """A slice of the rays in the BVH's frame: origins are moved and scaled, so distances scale too."""
        if self._identity:
            return origins[part], directions[part]
        moved = (origins[part] - self._centre) * self._scale
        return moved.astype(np.float32), directions[part]

    def _limits(self, limits: Float32Array | None, part: slice) -> Float32Array | None:
        """A private copy of a slice of the distances (the library writes into it)."""
        if limits is None:
            return None
        return np.minimum(limits[part].astype(np.float64) * self._scale, _FARTHEST).astype(np.float32)

    def _split(self, n_rays: int, trace: Callable[[slice], None]) -> None:
        """Trace all rays in chunks, over the threads if there are enough of them."""
        parts = [slice(start, min(start + _CHUNK, n_rays)) for start in range(0, n_rays, _CHUNK)]
        if self._n_threads == 1 or len(parts) < 2:
            for part in parts:
                trace(part)
        else:
            list(self._pools[has_own_threads()].map(trace, parts))


def _hashed(origins: Float32Array, directions: Float32Array) -> Float32Array:
    """Numbers (R,) in [0, 1) that depend on all bits of rays (R, 3)."""
    mixed = np.zeros(len(origins), np.uint32)
    for column in (*origins.T, *directions.T):
        mixed = (mixed ^ np.ascontiguousarray(column).view(np.uint32)) * np.uint32(0x9E3779B1)
        mixed ^= mixed >> np.uint32(15)
    return (mixed >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def _normalization(points: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], float]:
    """Centre and power-of-two scale that bring the points to about [−1, 1]³; zero and 1 if they nearly are there, or if
    there are none."""
    if not len(points):
        return np.zeros(3), 1.0
    low, high = points.min(axis=0), points.max(axis=0)
    half = float((high - low).max()) / 2
    centre = (low + high) / 2
    if np.abs(centre).max() <= 4 * half:
        centre = np.zeros(3)
    radius = float(np.abs(points - centre).max())
    exponent = math.frexp(radius)[1] if radius > 0 else 0
    return centre, 1.0 if -10 <= exponent <= 10 else math.ldexp(1.0, -exponent)


def _checked_vertices(vertices: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """(V, 3) finite float64."""
    array = np.asarray(vertices, np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise ValueError(f"vertices of shape {array.shape}: expected (V, 3) finite numbers")
    return array


def _checked_triangles(triangles: npt.ArrayLike, n_vertices: int) -> npt.NDArray[np.int32]:
    """(T, 3) contiguous int32 within range."""
    array = np.asarray(triangles)
    if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"triangles of shape {array.shape} and type {array.dtype}: expected (T, 3) integers")
    if not len(array):
        return np.zeros((0, 3), np.int32)
    if array.min() < 0 or array.max() >= n_vertices:
        raise ValueError(f"triangle index {array.min()} to {array.max()}: expected 0 to {n_vertices - 1}")
    return np.ascontiguousarray(array, dtype=np.int32)


def _checked_rays(
    origins: npt.ArrayLike, directions: npt.ArrayLike, distance: npt.ArrayLike | None
) -> tuple[Float32Array, Float32Array, Float32Array | None]:
    """Contiguous, writable float32 arrays of matching shapes with only finite numbers."""
    starts, along = _as_floats(origins), _as_floats(directions)
    if starts.ndim != 2 or starts.shape[1] != 3 or starts.shape != along.shape:
        raise ValueError(f"origins {starts.shape} and directions {along.shape}: expected two of (R, 3)")
    if not (_all_finite(starts) and _all_finite(along)):
        raise ValueError("rays: expected finite origins and directions")
    if distance is None:
        return starts, along, None
    limits = np.asarray(distance, np.float32)
    if limits.shape != starts.shape[:1]:
        raise ValueError(f"distance {limits.shape}: expected ({len(starts)},)")
    if not (limits > 0).all():
        raise ValueError("distance: expected numbers > 0")
    return starts, along, limits


def _as_floats(array: npt.ArrayLike) -> Float32Array:
    """The array itself if it is contiguous, writable float32, else a copy that is."""
    floats = np.ascontiguousarray(array, dtype=np.float32)
    return floats if floats.flags.writeable else floats.copy()


def _all_finite(array: Float32Array) -> bool:
    """Whether all numbers are finite; a finite sum proves it in one pass without a temporary."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(array.sum())) or bool(np.isfinite(array).all())


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """P points. position (P, 3) in the scene's frame, metres; horizon (P, 3): the unit normal that defines the
    hemisphere above; offset_position (P, 3): lifted off the surface, for shadow rays."""

    position: Float32Array
    horizon: Float32Array
    offset_position: Float32Array


def surface_points(caster: RayCaster, position: npt.ArrayLike, normal: npt.ArrayLike) -> SurfacePoints:
    """Points (P, 3) of a surface with unit normals (P, 3): vertices of a mesh, or texels."""
    position, normal = (np.ascontiguousarray(each, np.float32) for each in (position, normal))
    lifted = caster.offset_origins(position.astype(np.float64), normal.astype(np.float64))
    return SurfacePoints(position, normal, np.ascontiguousarray(lifted, np.float32))
