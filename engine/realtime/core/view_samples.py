"""Samples what a picture shows from any camera: the shading points around each pixel and, at rest, several rays at
edges; and the factors of maps there, filtered over each pixel as in Placement.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_plane
from engine.core.frames import local_frames
from engine.core.threads import even_parts, on_threads
from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.realtime.core import _sample_kernels as kernels
from engine.realtime.core._sample_kernels import Charts, Samples
from engine.realtime.core.corner_visibility import CornerVisibility
from engine.realtime.core.picture_parts import with_part
from engine.realtime.core.raster import find_triangles
from engine.realtime.core.shading_points import ShadingPoints
from engine.realtime.core.terms import map_factor
from engine.scene.bump_normals import gradients
from engine.scene.cutouts import covered_in_part, pixel_chances
from engine.scene.description import CameraDescription
from engine.scene.edges import Surface, edge_pixels, group_samples, ray_offsets, turn_of
from engine.scene.map_sampler import mean_over_pixels
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import Footprints, corner_uvs
from engine.texture.pyramid import Pyramid

Float32Array = NDArray[np.float32]
Rows = NDArray[np.int64]
_RAYS_AT_ONCE = 16384
_TRIANGLES_A_PIXEL = 4  # from which on a ray through each pixel is faster than drawing all triangles
_FEW_EDGE_RAYS = 4  # a pixel; with so few, only silhouettes count as edges


class PointMesh:
    """The surface between shading points, ready for rays from any camera."""

    def __init__(self, scene: Scene, points: ShadingPoints, caster: RayCaster | None = None) -> None:
        """caster: intersects the triangles between the points; made here if None."""
        self._scene, self._points = scene, points
        self._last: tuple[tuple[object, ...], ViewSamples] | None = None
        self._caster = caster or points.caster(scene)
        self._charts: dict[int, list[Charts]] = {}
        corners = np.arange(3 * len(points.corners), dtype=np.int32).reshape(-1, 3)
        self._raster = corners, np.ones((len(corners), 2), bool), points.corners.reshape(-1, 3).astype(np.float32)
        self.visibility = CornerVisibility(points, self._caster)
        self._surface = kernels.PointTriangles(
            points.shown, np.ascontiguousarray(scene.geometric_normals[points.source]),
            scene.object_of_triangle[points.source], scene.emission, scene.cones,
        )  # fmt: skip

    @property
    def caster(self) -> RayCaster:
        """Intersects the triangles between the points."""
        return self._caster

    def of(self, points: ShadingPoints) -> PointMesh:
        """The same surface with other points on its sides."""
        other = PointMesh(self._scene, points, self._caster)
        other._charts, other._raster = self._charts, self._raster
        return other

    def moved(self, scene: Scene, points: ShadingPoints, caster: RayCaster, objects: Collection[int]) -> PointMesh:
        """The same surface with some objects, by index, elsewhere; caster: intersects its triangles there."""
        other = PointMesh(scene, points, caster)
        other._charts = {i: charts for i, charts in self._charts.items() if i not in objects}
        return other

    def sample_view(
        self, camera: CameraDescription, resolution: tuple[int, int], n_edge_rays: int = 0, in_sight: bool = False,
        is_grouped: bool = False,
    ) -> ViewSamples:  # fmt: skip
        """Sample a picture of resolution (width, height) with one ray through each pixel's centre and, to antialias
        edges, with 4, 8 or 16 rays through pixels there. is_grouped: rays that meet one surface share a sample, as in
        Placement; edges are then silhouettes, as they are with 4 rays, while more rays also cover creases and borders
        of an object. in_sight: interpolate only points that are visible from the sample. The last result is cached,
        because the camera rests while a material or the light changes."""
        requested = camera, resolution, n_edge_rays, in_sight, is_grouped
        if self._last is None or self._last[0] != requested:
            self._last = requested, self._sample_view(*requested)
        return self._last[1]

    def _sample_view(
        self, camera: CameraDescription, resolution: tuple[int, int], n_edge_rays: int, in_sight: bool, is_grouped: bool
    ) -> ViewSamples:
        width, height = resolution
        pixel, share = np.arange(width * height), np.ones(width * height, np.float32)
        samples, found = self._trace(camera, resolution, np.empty((0, 2)), len(pixel))
        if n_edge_rays:
            edges = np.zeros((height, width), bool)
            if n_edge_rays > _FEW_EDGE_RAYS and not is_grouped:
                seen = self._surface_of(samples, found)
                edges[:] = edge_pixels(samples.i_object, seen, turn_of(_FEW_EDGE_RAYS), resolution).reshape(edges.shape)
            else:
                kernels.silhouettes(samples.i_object.reshape(height, width), edges)
            edges |= covered_in_part(self._scene.from_camera(camera), self._caster, -samples.wo).reshape(edges.shape)
            inner, outer = np.flatnonzero(~edges), np.flatnonzero(edges)
            places = np.stack([outer % width, outer // width], axis=1)[:, None] + (0.5 + ray_offsets(n_edge_rays))
            more, found_more = self._trace(camera, resolution, places.reshape(-1, 2), n_edge_rays * len(outer))
            used = np.arange(n_edge_rays * len(outer))
            shares = np.full(len(used), 1.0 / n_edge_rays, np.float32)
            if is_grouped:
                used, shares = self._group(more, found_more, n_edge_rays, len(pixel))
            samples = Samples(*(np.concatenate([a[inner], b[used]]) for a, b in zip(samples, more, strict=True)))
            found = tuple(np.concatenate([a[inner], b[used]]) for a, b in zip(found, found_more, strict=True))
            pixel = np.concatenate([inner, np.repeat(outer, n_edge_rays)[used]])
            share = np.concatenate([share[inner], shares])
        if in_sight:
            self.visibility.fix_corners(samples, found[0])
        i_object = samples.i_object
        reflects = samples.corners[:, 0] >= 0
        order, bounds = kernels.by_object(i_object, reflects, len(self._scene.smooth))
        camera_position = np.subtract(camera.position, self._scene.origin).astype(np.float32)
        axes = camera_plane(camera, resolution)
        what = samples, pixel, share, order, bounds, found, self._points, self._charts
        view = ViewSamples((width, height), camera_position, axes, *what)
        self._add_textures(view)
        return view

    def _add_textures(self, seen: ViewSamples) -> None:
        """Multiply the emission of samples by its textures."""
        emitted, textures = seen.samples.emitted, self._scene.emission_textures
        for i in textures.tinted:
            which = np.flatnonzero((seen.samples.i_object == i) & emitted.any(axis=1))
            footprints = _footprints(seen, which, self._scene, i)
            emitted[which] *= textures.over(i, seen.in_scene(which), footprints)

    def _group(
        self, samples: Samples, found: tuple[NDArray, ...], n_rays: int, n_pixels: int
    ) -> tuple[Rows, Float32Array]:
        """Choose, of the n_rays through each of some pixels, those that represent a surface, and those that meet
        nothing that reflects; also return their shares of the pixel."""
        met = self._surface_of(samples, found)
        shape = len(met.ids) // n_rays, 1 + n_rays
        ids, position, normal = np.full(shape, -1, np.int32), *np.zeros((2, *shape, 3), np.float32)
        for whole, rays in zip((ids, position, normal), met, strict=True):
            whole[:, 1:] = rays.reshape(-1, n_rays, *rays.shape[1:])  # the first, for the centre, meets nothing
        groups = group_samples(Surface(ids, position, normal), ray_offsets(n_rays), turn_of(n_rays), n_pixels)
        leads = groups.leader[:, 1:] == np.arange(1, n_rays + 1)
        alone = groups.leader[:, 1:] < 0
        used, share = np.flatnonzero(leads | alone), np.where(alone, np.float32(1.0 / n_rays), groups.share[:, 1:])
        return used, np.asarray(share.ravel()[used], np.float32)

    def _surface_of(self, samples: Samples, found: tuple[NDArray, ...]) -> Surface:
        """What samples (R,) meet that reflects, in world space."""
        reflects = np.flatnonzero(samples.corners[:, 0] >= 0)
        ids = np.where(samples.corners[:, 0] >= 0, samples.i_object, -1)
        position, normal = np.zeros((2, len(ids), 3), np.float32)
        corners, weights = samples.corners[reflects], samples.weights[reflects]
        between = np.einsum("rk,rki->ri", weights, self._points.normal[corners])
        normal[reflects] = between / np.maximum(np.linalg.norm(between, axis=1, keepdims=True), 1e-30)
        position[reflects] = np.einsum("rk,rki->ri", weights, self._points.corners[found[0][reflects]])
        return Surface(ids.astype(np.int32), position, normal)

    def set_emission(self, scene: Scene) -> None:
        """Update the objects' emission."""
        self._scene, self._surface, self._last = scene, self._surface._replace(emission=scene.emission), None

    def trace(self, origins: Float32Array, directions: Float32Array) -> tuple[Samples, Float32Array]:
        """Trace a few rays (R, 3) from anywhere: return their samples and distances (R,)."""
        out, hits = _empty_samples(len(origins)), self._caster.intersect(origins, directions)
        kernels.resolve(0, hits.triangle, hits.u, hits.v, directions, self._surface, out)
        self.visibility.fix_corners(out, hits.triangle)
        return out, hits.distance

    def _trace(
        self, camera: CameraDescription, resolution: tuple[int, int], places: NDArray[np.float64], n: int
    ) -> tuple[Samples, tuple[NDArray, ...]]:
        """Trace n rays, through all pixels' centres without places: return samples, triangle, u and v. The triangles
        are rasterized where there are not too many for that."""
        axes, camera_position = (
            camera_plane(camera, resolution),
            np.subtract(camera.position, self._scene.origin).astype(np.float32),
        )
        directions = np.empty((n, 3), np.float32)
        out = _empty_samples(n)
        triangle, (u, v) = np.empty(n, np.int32), np.empty((2, n), np.float32)
        corners, is_shown, vertices = self._raster
        has_holes = self._scene.cutouts.passable.any()
        is_drawn = not len(places) and len(corners) <= _TRIANGLES_A_PIXEL * n and not has_holes
        if is_drawn:
            origin = camera_position.astype(np.float64)
            drawn = find_triangles(corners, is_shown, vertices, camera, origin, resolution)
            triangle, u, v = drawn[0].ravel(), drawn[1].ravel(), drawn[2].ravel()

        def part(start: int) -> None:
            stop = min(start + _RAYS_AT_ONCE, n)
            kernels.fill_rays(start, stop, places, resolution[0], axes, directions)
            own = directions[start:stop]
            if not is_drawn:
                chances = (
                    pixel_chances(_places(start, stop, places, resolution[0]), resolution[0]) if has_holes else None
                )
                hits = self._caster.intersect(np.broadcast_to(camera_position, own.shape), own, chances)
                triangle[start:stop], u[start:stop], v[start:stop] = hits.triangle, hits.u, hits.v
            kernels.resolve(start, triangle[start:stop], u[start:stop], v[start:stop], own, self._surface, out)

        on_threads(part, range(0, n, _RAYS_AT_ONCE))
        return out, (triangle, u, v)


@dataclass(frozen=True, eq=False)
class ViewSamples:
    """Samples (R,) of a picture: resolution (width, height), camera_position (3,), axes (3, 3) of its plane, the
    samples, their pixel (R,) and share of it (R,). order (N,): reflecting samples by object, with ranges bounds (M +
    1,); found: triangle, u, v on the triangles between points; footprints, sampled, normal_offsets: caches of texture
    coordinates, images and bumps; charts: how objects' triangles lie on images, shared by all pictures."""

    resolution: tuple[int, int]
    camera_position: Float32Array
    axes: NDArray[np.float64]
    samples: Samples
    pixel: Rows
    share: Float32Array
    order: Rows
    bounds: Rows
    found: tuple[NDArray, ...]
    points: ShadingPoints
    charts: dict[int, list[Charts]]
    footprints: dict[int, tuple[NDArray[np.float64], ...]] = field(default_factory=dict)
    sampled: dict[object, Float32Array] = field(default_factory=dict)
    normal_offsets: dict[object, Float32Array] = field(default_factory=dict)

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
        out = np.empty((len(which), 3), np.float32)
        kernels.normals_between(
            0, len(which), which, self.samples.corners, self.samples.weights, self.points.normal, out
        )
        return out

    def frames(
        self, which: Rows, scene: Scene, i_object: int, normals: Float32Array | None = None
    ) -> NDArray[np.float64]:
        """Frames (N, 3, 3) of samples (N,) of an object: rows tangent, bitangent, normal; normals (N, 3): used instead
        of the interpolated ones."""
        own = (self.normals(which) if normals is None else normals).astype(np.float64)
        ids, found = np.full(len(which), i_object), self.in_scene(which)
        return local_frames(scene.tangent_rotations.tangents(ids, own, found), own)

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
    seen: ViewSamples, radiance: Float32Array, environment: Environment | None, rotation: float, scale: float = 1.0,
    transparent: bool = False, apart: Collection[int] = (),
) -> Float32Array:  # fmt: skip
    """Assemble the picture (H, W, 3) from the samples' reflected radiance (R, 3), which is overwritten, their emission,
    and the sky behind. transparent: without the sky, and with a fourth channel: alpha, the share of each pixel that
    something covers. apart: objects, by index, whose own part of such a picture follows it, (H, W, 8)."""
    radiance += seen.samples.emitted
    if environment is not None and not (transparent or apart):
        image, turn = environment.radiance, math.radians(rotation % 360.0)

        def part(start: int, stop: int) -> None:
            samples = seen.samples
            kernels.add_background(start, stop, samples.i_object, samples.wo, image, turn, scale, radiance)

        on_threads(part, *even_parts(len(radiance)))
    (width, height), values = seen.resolution, radiance
    if transparent or apart:
        i_object = seen.samples.i_object
        values = np.concatenate([radiance, (i_object >= 0)[:, None]], axis=1, dtype=np.float32)
        values = with_part(values, np.isin(i_object, list(apart))) if apart else values
    if (seen.share == 1.0).all():
        return values.reshape(height, width, -1)
    whole = np.stack([np.bincount(seen.pixel, each * seen.share, width * height) for each in values.T], axis=1)
    return whole.astype(np.float32).reshape(height, width, -1)


def _places(start: int, stop: int, places: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Where some rays pass a picture (N, 2): at places (R, 2), or, without, at its pixels' centres."""
    rays = np.arange(start, stop)
    return np.asarray(places[rays] if len(places) else np.stack([rays % width, rays // width], axis=1) + 0.5)


def _empty_samples(n: int) -> Samples:
    """Allocate n samples."""
    return Samples(
        np.empty((n, 3), np.int32), np.zeros((n, 3), np.float32), np.empty((n, 3), np.float32),
        np.empty((n, 3), np.float32), np.empty(n, np.int32), np.empty(n, bool),
    )  # fmt: skip


def factors(
    seen: ViewSamples, which: Rows, scene: Scene, i_object: int, layers: Sequence[Layer], quality: str
) -> dict[int, Float32Array]:
    """Factors of an object's visible layers that have maps, by the layer's number: (N, 3) at samples (N,).

    At rest they are the means over pixels that Placement has; in moving pictures, fewer look-ups cover an oblique
    pixel, each in one level of the image pyramid. Layers and pictures of one camera share what was sampled of an image.
    """
    is_quick, sampled = quality == "moving", seen.sampled

    def sample(image: Pyramid, scale: tuple[float, float]) -> Float32Array:
        key = i_object, image, scale
        if key not in sampled:
            footprints = footprints_of(seen, which, scene, i_object)
            sampled[key] = mean_over_pixels(image, footprints, scale, is_quick)
        return sampled[key]

    visible = [layer for layer in layers if layer.visible]
    return {
        k: np.asarray(map_factor(scene, layer.maps, len(which), sample, lambda: seen.in_scene(which)), np.float32)
        for k, layer in enumerate(visible)
        if not layer.maps.is_plain
    }


def footprints_of(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> Footprints:
    """Texture coordinates of an object's samples, and their differences over a pixel to the left and upwards, (N, 2
    K) in K sets; cached."""
    if i_object not in seen.footprints:
        seen.footprints[i_object] = _footprints(seen, which, scene, i_object)
    uv, left, up = seen.footprints[i_object]
    return uv, left, up


def _footprints(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> tuple[NDArray[np.float64], ...]:
    if i_object not in seen.charts:
        seen.charts[i_object] = _charts(scene, i_object)
    of_sets = [_footprints_in_set(seen, which, charts) for charts in seen.charts[i_object]]
    return of_sets[0] if len(of_sets) == 1 else tuple(map(np.hstack, zip(*of_sets, strict=True)))


def _footprints_in_set(seen: ViewSamples, which: Rows, charts: Charts) -> tuple[NDArray[np.float64], ...]:
    out = tuple(np.empty((3, len(which), 2)))
    samples, camera_position = seen.samples, seen.camera_position.astype(np.float64)
    what = which, seen.found[0], seen.points.source, samples.wo, seen.share, charts

    def part(start: int, stop: int) -> None:
        kernels.footprints(start, stop, *what, camera_position, seen.axes, *out)

    on_threads(part, *even_parts(len(which)))
    return out


def _charts(scene: Scene, i_object: int) -> list[Charts]:
    """How an object's triangles lie on its images, for each set of texture coordinates."""
    own = np.arange(*scene.triangle_ranges[i_object])
    corners = scene.vertices[scene.triangles[own]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corner, uvs = np.ascontiguousarray(corners[:, 0]), corner_uvs(scene, own)[:, 0]
    return [
        Charts(corner, np.ascontiguousarray(uvs[:, 2 * k : 2 * k + 2]), normals, gradients(scene, own, k), int(own[0]))
        for k in range(uvs.shape[1] // 2)
    ]
