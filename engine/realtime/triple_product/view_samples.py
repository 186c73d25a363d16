"""Samples what a picture shows from any camera: the shading points around each pixel and, at rest, several rays at
edges."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_plane
from engine.core.frames import local_frames
from engine.core.threads import even_parts, on_threads
from engine.light.environment import Environment
from engine.realtime.triple_product import _picture_kernels as kernels
from engine.realtime.triple_product._footprint_kernels import Charts
from engine.realtime.triple_product.corner_visibility import CornerVisibility
from engine.realtime.triple_product.shading_points import ShadingPoints
from engine.scene.description import CameraDescription
from engine.scene.edges import Surface, edge_pixels, ray_offsets, turn_of
from engine.scene.primary_hits import object_tangents
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Rows = NDArray[np.int64]
_RAYS = 16384  # at a time
_FEW_EDGE_RAYS = 4  # a pixel; with so few, only silhouettes count as edges


class PointMesh:
    """The surface between shading points, ready for rays from any camera."""

    def __init__(self, scene: Scene, points: ShadingPoints, caster: RayCaster | None = None) -> None:
        """caster: intersects the triangles between the points; made here if None."""
        self._scene, self._points = scene, points
        self._last: tuple[tuple[object, ...], ViewSamples] | None = None
        self._caster = caster or points.caster()
        self._charts: dict[int, Charts] = {}
        self.visibility = CornerVisibility(points, self._caster)
        self._surface = kernels.PointTriangles(
            points.shown, np.ascontiguousarray(scene.geometric_normals[points.source]),
            scene.object_of_triangle[points.source], scene.emission,
        )  # fmt: skip

    def of(self, points: ShadingPoints) -> PointMesh:
        """The same surface with other points on its sides."""
        other = PointMesh(self._scene, points, self._caster)
        other._charts = self._charts
        return other

    def sample_view(
        self, camera: CameraDescription, resolution: tuple[int, int], n_edge_rays: int = 0, in_sight: bool = False
    ) -> ViewSamples:
        """Sample a picture of resolution (width, height) with one ray through each pixel's centre and, to antialias
        edges, with 4, 8 or 16 rays through pixels there. More than 4 rays also cover creases and borders of an object.
        in_sight: interpolate only points that are visible from the sample. The last result is cached, because the
        camera rests while a material or the light changes."""
        requested = camera, resolution, n_edge_rays, in_sight
        if self._last is None or self._last[0] != requested:
            self._last = requested, self._sample_view(*requested)
        return self._last[1]

    def _sample_view(
        self, camera: CameraDescription, resolution: tuple[int, int], n_edge_rays: int, in_sight: bool
    ) -> ViewSamples:
        width, height = resolution
        pixel, share = np.arange(width * height), np.ones(width * height, np.float32)
        samples, found = self._trace(camera, resolution, np.empty((0, 2)), len(pixel))
        if n_edge_rays:
            edges = np.zeros((height, width), bool)
            if n_edge_rays > _FEW_EDGE_RAYS:
                edges[:] = self._edges(samples, found, resolution).reshape(height, width)
            else:
                kernels.silhouettes(samples.i_object.reshape(height, width), edges)
            inner, outer = np.flatnonzero(~edges), np.flatnonzero(edges)
            places = np.stack([outer % width, outer // width], axis=1)[:, None] + (0.5 + ray_offsets(n_edge_rays))
            more, found_more = self._trace(camera, resolution, places.reshape(-1, 2), n_edge_rays * len(outer))
            samples = kernels.Samples(*(np.concatenate([a[inner], b]) for a, b in zip(samples, more, strict=True)))
            found = tuple(np.concatenate([a[inner], b]) for a, b in zip(found, found_more, strict=True))
            pixel = np.concatenate([inner, np.repeat(outer, n_edge_rays)])
            share = np.concatenate([share[inner], np.full(n_edge_rays * len(outer), 1.0 / n_edge_rays, np.float32)])
        if in_sight:
            self.visibility.fix_corners(samples, found[0])
        i_object = samples.i_object
        reflects = samples.corners[:, 0] >= 0
        order, bounds = kernels.by_object(i_object, reflects, len(self._scene.smooth))
        eye = np.subtract(camera.position, self._scene.origin).astype(np.float32)
        axes = camera_plane(camera, resolution)
        what = samples, pixel, share, order, bounds, found, self._points, self._charts
        return ViewSamples((width, height), eye, axes, *what)

    def _edges(
        self, samples: kernels.Samples, found: tuple[NDArray, ...], resolution: tuple[int, int]
    ) -> NDArray[np.bool_]:  # fmt: skip
        """Find pixels (R,) at edges as Placement defines them: also where one object breaks off or bends."""
        reflects = np.flatnonzero(samples.corners[:, 0] >= 0)
        ids = np.where(samples.corners[:, 0] >= 0, samples.i_object, -1)
        position, normal = np.zeros((2, len(ids), 3), np.float32)
        corners, weights = samples.corners[reflects], samples.weights[reflects]
        between = np.einsum("rk,rki->ri", weights, self._points.normal[corners])
        normal[reflects] = between / np.maximum(np.linalg.norm(between, axis=1, keepdims=True), 1e-30)
        position[reflects] = np.einsum("rk,rki->ri", weights, self._points.corners[found[0][reflects]])
        surface = Surface(ids.astype(np.int32), position, normal)
        return edge_pixels(samples.i_object, surface, turn_of(_FEW_EDGE_RAYS), resolution)

    def set_emission(self, scene: Scene) -> None:
        """Update the objects' emission."""
        self._scene, self._surface, self._last = scene, self._surface._replace(emission=scene.emission), None

    def trace(self, origins: Float32Array, directions: Float32Array) -> tuple[kernels.Samples, Float32Array]:
        """Trace a few rays (R, 3) from anywhere: return their samples and distances (R,)."""
        out, hits = _room(len(origins)), self._caster.intersect(origins, directions)
        kernels.resolve(0, hits.triangle, hits.u, hits.v, directions, self._surface, out)
        self.visibility.fix_corners(out, hits.triangle)
        return out, hits.distance

    def _trace(
        self, camera: CameraDescription, resolution: tuple[int, int], places: NDArray[np.float64], n: int
    ) -> tuple[kernels.Samples, tuple[NDArray, ...]]:
        """Trace n rays: return samples, triangle, u and v."""
        axes, eye = (
            camera_plane(camera, resolution),
            np.subtract(camera.position, self._scene.origin).astype(np.float32),
        )
        directions = np.empty((n, 3), np.float32)
        out = _room(n)
        found = np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.float32)

        def part(start: int) -> None:
            stop = min(start + _RAYS, n)
            kernels.fill_rays(start, stop, places, resolution[0], axes, directions)
            own = directions[start:stop]
            hits = self._caster.intersect(np.broadcast_to(eye, own.shape), own)
            kernels.resolve(start, hits.triangle, hits.u, hits.v, own, self._surface, out)
            for mine, theirs in zip(found, (hits.triangle, hits.u, hits.v), strict=True):
                mine[start:stop] = theirs

        on_threads(part, range(0, n, _RAYS))
        return out, found


@dataclass(frozen=True, eq=False)
class ViewSamples:
    """Samples (R,) of a picture: resolution (width, height), camera_position (3,), axes (3, 3) of its plane, the
    samples, their pixel (R,) and share of it (R,). order (N,): reflecting samples by object, with ranges bounds (M +
    1,); found: triangle, u, v on the triangles between points; footprints, sampled, leans: caches of `view_maps` and
    `perturbed_normals`; charts: how objects' triangles lie on images, shared by all pictures."""

    resolution: tuple[int, int]
    camera_position: Float32Array
    axes: NDArray[np.float64]
    samples: kernels.Samples
    pixel: Rows
    share: Float32Array
    order: Rows
    bounds: Rows
    found: tuple[NDArray, ...]
    points: ShadingPoints
    charts: dict[int, Charts]
    footprints: dict[int, tuple[NDArray[np.float64], ...]] = field(default_factory=dict)
    sampled: dict[object, Float32Array] = field(default_factory=dict)
    leans: dict[object, Float32Array] = field(default_factory=dict)

    @cached_property
    def shares(self) -> Float32Array:
        """Barycentric weights (R, 3) of samples in their triangle; `weights` differs where some corners are not
        visible."""
        _, u, v = self.found
        return np.stack([1.0 - u - v, u, v], axis=1)

    def places(self, which: Rows) -> Float32Array:
        """Positions (N, 3) of samples (N,)."""
        corners = self.points.corners[self.found[0][which]]
        return np.asarray(np.einsum("nk,nki->ni", self.shares[which], corners), np.float32)

    def of(self, i_object: int) -> Rows:
        """The samples that see an object."""
        return self.order[self.bounds[i_object] : self.bounds[i_object + 1]]

    def from_behind(self, least: float = 0.0) -> tuple[int, ...]:
        """Objects that are seen where they have no points, in more than a share `least` of the picture."""
        n_samples = np.bincount(self.samples.i_object[self.samples.behind])
        return tuple(np.flatnonzero(n_samples > least * len(self.samples.behind)).tolist())

    def visible_points(self) -> NDArray[np.bool_]:
        """Which shading points (S,) are corners of samples."""
        seen = np.zeros(len(self.points), bool)
        kernels.mark(0, len(self.pixel), self.samples.corners, seen)
        return seen

    def normals(self, which: Rows) -> Float32Array:
        """Normals (N, 3) of samples (N,), unit, interpolated between the points."""
        corners, weights = self.samples.corners[which], self.samples.weights[which]
        between = np.einsum("nk,nki->ni", weights, self.points.normal[corners])
        length = np.linalg.norm(between, axis=1, keepdims=True)
        return np.asarray(between / np.maximum(length, 1e-30), np.float32)

    def frames(
        self, which: Rows, scene: Scene, i_object: int, normals: Float32Array | None = None
    ) -> NDArray[np.float64]:
        """Frames (N, 3, 3) of samples (N,) of an object: rows tangent, bitangent, normal; normals (N, 3): used instead
        of the interpolated ones."""
        own = (self.normals(which) if normals is None else normals).astype(np.float64)
        return local_frames(object_tangents(scene, np.full(len(which), i_object), own), own)

    def in_scene(self, which: Rows) -> Intersections:
        """Hits of samples (N,) on the scene's own triangles, without distances."""
        triangle = self.found[0][which]
        u, v = np.einsum("nk,nki->in", self.shares[which], self.points.within[triangle])
        return Intersections(self.points.source[triangle], u, v, np.zeros(len(u), np.float32))


def interpolate(
    seen: ViewSamples, which: Rows, values: Float32Array, factor: Float32Array, radiance: Float32Array
) -> None:
    """Interpolate values (S, 3) of shading points at samples (N,) and add them, times factor (N or 1, 3), to
    `radiance`."""
    samples = seen.samples

    def part(start: int, stop: int) -> None:
        kernels.add_between(start, stop, which, samples.corners, samples.weights, values, factor, radiance)

    on_threads(part, *even_parts(len(which)))


def add_values(which: Rows, values: Float32Array, factor: Float32Array, radiance: Float32Array) -> None:
    """Add values (N, 3) of samples (N,), times factor (N or 1, 3), to `radiance`."""

    def part(start: int, stop: int) -> None:
        kernels.add_at(start, stop, which, values, factor, radiance)

    on_threads(part, *even_parts(len(which)))


def assemble_picture(
    seen: ViewSamples, radiance: Float32Array, environment: Environment | None, rotation: float, scale: float = 1.0
) -> Float32Array:
    """Assemble the picture (H, W, 3) from the samples' reflected radiance (R, 3), which is overwritten, their emission,
    and the sky behind."""
    radiance += seen.samples.emitted
    if environment is not None:
        image, turn = environment.radiance, math.radians(rotation % 360.0)

        def part(start: int, stop: int) -> None:
            samples = seen.samples
            kernels.add_background(start, stop, samples.i_object, samples.wo, image, turn, scale, radiance)

        on_threads(part, *even_parts(len(radiance)))
    width, height = seen.resolution
    if len(radiance) == width * height:
        return radiance.reshape(height, width, 3)
    whole = np.stack([np.bincount(seen.pixel, radiance[:, i] * seen.share, width * height) for i in range(3)], axis=1)
    return whole.astype(np.float32).reshape(height, width, 3)


def _room(n: int) -> kernels.Samples:
    """Allocate n samples."""
    return kernels.Samples(
        np.empty((n, 3), np.int32), np.zeros((n, 3), np.float32), np.empty((n, 3), np.float32),
        np.empty((n, 3), np.float32), np.empty(n, np.int32), np.empty(n, bool),
    )  # fmt: skip
