"""Primary hits: one surface point for each pixel, and several where objects meet (`engine.scene.edges`).

Only objects that reflect get shading points; emitters and the background are images. The points are sorted by object,
so that an object's data is a range.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.core.camera import centre_directions, pixel_directions
from engine.core.generators import run_to_end
from engine.light.cones import cone_shares
from engine.material.layer import FRAMES, Frame
from engine.scene.cutouts import covered_in_part, pixel_chances
from engine.scene.edges import Surface, edge_pixels, group_samples, ray_offsets, turn_of
from engine.scene.picture_frame import Lamps
from engine.scene.raycaster import Intersections, RayCaster, SurfacePoints
from engine.scene.scene_loader import Scene
from engine.scene.shading_frames import shading_frames, turned_to

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]


@dataclass(frozen=True)
class PrimaryHits(SurfacePoints):
    """The shading points of a picture (P of them), sorted by object, then row-major. Vectors are unit, float32.

    pixel (P,): row · width + column; offset (P, 2): columns and rows from its centre where the ray passes, 0 except at
    edges; share (P,): of its pixel that a point represents; object_ranges (M, 2) into the points; position (P, 3) in
    the scene's frame and offset_position, lifted off the surface for shadow rays; horizon: the normal, interpolated on
    smooth objects, on the face's and the camera's side; normal: the shading normal, which is the horizon perturbed by
    bumps (`engine.scene.bump_normals`); coat_normal, coat_tangent: those of the coat's frame, None where no object has
    bumps in either frame; coat_rays: the objects whose rays of indirect light are distributed there; geometric_normal:
    the face's, on the camera's side; front (P,): whether the camera sees the side that the winding faces; tangent: the
    brushed direction (`engine.scene.tangents`); wo: to the camera. Of pixels: object_image (H, W) int16: the object at
    their centres, −1 for the background; open_image (H, W): the share that shows the background; emission_image (H, W,
    3): emitters seen from their front, by their shares, see `lamps`; ray_directions (H, W, 3) through the centres.
    """

    resolution: tuple[int, int]
    pixel: Int32Array
    offset: Float32Array
    share: Float32Array
    object_ranges: Int32Array
    normal: Float32Array
    geometric_normal: Float32Array
    front: npt.NDArray[np.bool_]
    tangent: Float32Array
    wo: Float32Array
    object_image: npt.NDArray[np.int16]
    open_image: Float32Array
    emission_image: Float32Array
    lamps: Lamps
    ray_directions: Float32Array
    coat_normal: Float32Array | None = None
    coat_tangent: Float32Array | None = None
    coat_rays: tuple[int, ...] = ()

    def in_frame(self, frame: Frame) -> PrimaryHits:
        """The points with the shading frames of layers of this frame."""
        if frame == "base" or self.coat_normal is None or self.coat_tangent is None:
            return self
        return replace(self, normal=self.coat_normal, tangent=self.coat_tangent)

    @cached_property
    def ray_frames(self) -> tuple[Float32Array, Float32Array]:
        """Tangents and normals (P, 3) of the frames in which rays of indirect light are distributed: the coat's where
        that is smooth: it is the sharper one, and all that the surface sees is above it. Above a coat that leans by 27
        degrees a matt base would lose an eighth of its light."""
        if self.coat_normal is None or self.coat_tangent is None or not self.coat_rays:
            return self.tangent, self.normal
        there = np.isin(self.objects, self.coat_rays)[:, None]
        return np.where(there, self.coat_tangent, self.tangent), np.where(there, self.coat_normal, self.normal)

    def view_angles(self, rows: npt.NDArray[np.integer]) -> Float64Array:
        """Angles (2, p) of some rows between wo and the normals of the frames, `engine.material.layer.FRAMES`."""
        cosines = [
            np.einsum("pc,pc->p", self.in_frame(frame).normal[rows], self.wo[rows], dtype=np.float64)
            for frame in FRAMES
        ]
        return np.asarray(np.arccos(np.clip(cosines, 0.0, 1.0)))

    @property
    def outward(self) -> Float32Array:
        """The faces' normals (P, 3) on the side that the winding faces."""
        return np.where(self.front[:, None], self.geometric_normal, -self.geometric_normal)

    @cached_property
    def objects(self) -> Int32Array:
        """The object of each point (P,)."""
        counts = self.object_ranges[:, 1] - self.object_ranges[:, 0]
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts)

    @property
    def places(self) -> Float64Array:
        """Positions in the picture (P, 2) of the rays to the points: columns and rows from its upper left corner."""
        return _places(self.pixel, self.offset, self.resolution[0])

    @cached_property
    def is_centred(self) -> npt.NDArray[np.bool_]:
        """Which points (P,) are at their pixels' centres."""
        return np.asarray(~self.offset.any(axis=1))

    @cached_property
    def row_image(self) -> Int32Array:
        """The row of the point at each pixel's centre (H, W), −1 for none."""
        width, height = self.resolution
        rows = np.flatnonzero(self.is_centred)
        image = np.full((height, width), -1, np.int32)
        image.ravel()[self.pixel[rows]] = rows
        return image

    def at(self, rows: Int32Array) -> PrimaryHits:
        """Select points by ascending rows; images stay those of the whole picture."""
        vectors = "position", "offset_position", "horizon", "normal", "geometric_normal", "tangent", "wo"
        of_coat = () if self.coat_normal is None else ("coat_normal", "coat_tangent")
        points = ("pixel", "offset", "share", "front", *vectors, *of_coat)
        ranges = np.searchsorted(rows, self.object_ranges).astype(self.object_ranges.dtype)
        return replace(self, object_ranges=ranges, **{name: getattr(self, name)[rows] for name in points})


class _Rays(NamedTuple):
    """Hits of rays (R,) through pixels; offset (R, 2) from the pixel's centre, directions (R, 3)."""

    pixel: Int32Array
    offset: Float32Array
    directions: Float32Array
    found: Intersections
    ids: Int32Array

    def reflecting(self, scene: Scene) -> npt.NDArray[np.intp]:
        """Which of them hit reflecting objects."""
        met = np.flatnonzero(self.ids >= 0)
        return met[scene.reflecting[self.ids[met]]]

    def lamps(self, scene: Scene, share: float, of: npt.NDArray[np.integer], size: tuple[int, int]) -> Lamps:
        """What the rays `of` see shining, each ray representing this share of its pixel of a picture of that size."""
        of = of[self.ids[of] >= 0]
        facing = np.einsum("rk,rk->r", scene.geometric_normals[self.found.triangle[of]], self.directions[of]) < 0.0
        mine = of[facing & scene.shining[self.ids[of]]]
        places = _places(self.pixel[mine], self.offset[mine], size[0])
        factors = scene.emission_textures.over_pixels(self.found.of(mine), places, size)
        n_objects = max(len(scene.emission), 1)
        pairs, group = np.unique(self.pixel[mine].astype(np.int64) * n_objects + self.ids[mine], return_inverse=True)
        shares = cone_shares(scene.cones[self.ids[mine]], self.directions[mine])
        sent = np.bincount(group.ravel(), shares, len(pairs))
        sums = np.stack([np.bincount(group.ravel(), shares * each, len(pairs)) for each in factors.T], axis=1)
        factor = np.divide(sums, sent[:, None], out=np.zeros(sums.shape), where=sent[:, None] > 0.0)
        pixel, ids = (each.astype(np.int32) for each in np.divmod(pairs, n_objects))
        return Lamps(pixel, ids, (share * sent).astype(np.float32), factor.astype(np.float32), scene.emission[ids])


# Arrays of points by their names in `PrimaryHits`, with `ids` of the objects they are on.
_Points = dict[str, npt.NDArray]


def trace_primary(
    scene: Scene, caster: RayCaster, resolution: tuple[int, int] | None = None, n_edge_rays: int = 0
) -> PrimaryHits:
    """Trace a ray through every pixel centre (the Python twin renders the same), and through pixels at edges
    n_edge_rays more, 0 or a number of `ray_offsets`; resolution = (width, height)."""
    return run_to_end(trace_primary_steps(scene, caster, resolution, n_edge_rays))


def trace_primary_steps(
    scene: Scene, caster: RayCaster, resolution: tuple[int, int] | None = None, n_edge_rays: int = 0
) -> Generator[None, None, PrimaryHits]:
    """The same in steps."""
    size = width, height = resolution or scene.resolution
    directions = centre_directions(scene.description.camera, size)
    every = np.arange(width * height, dtype=np.int32)
    centres = _trace_pixels(
        scene, caster, every, np.zeros((len(every), 2), np.float32), directions.reshape(-1, 3), width
    )
    yield
    points = _points(scene, caster, centres, centres.reflecting(scene), size)
    yield
    background = (centres.ids < 0).astype(np.float32)
    inner, lamps = every, []
    if n_edge_rays:
        met = _surface(points, len(every))
        edge = edge_pixels(centres.ids, met, turn_of(n_edge_rays), size)
        edge |= covered_in_part(scene, caster, centres.directions)
        yield
        around = _trace_edge_pixels(scene, caster, every[edge], n_edge_rays, size)
        yield
        points = _with_edges(scene, caster, points, met, around, every[edge], size)
        yield
        background[edge] = (around.ids < 0).reshape(-1, n_edge_rays).mean(axis=1)
        inner = every[~edge]
        lamps.append(around.lamps(scene, 1.0 / n_edge_rays, np.arange(len(around.ids)), size))
    lamps.append(centres.lamps(scene, 1.0, inner, size))
    emitting = Lamps(*(np.concatenate(parts) for parts in zip(*lamps, strict=True)))
    ids = points.pop("ids")
    order = np.lexsort((points["offset"].any(axis=1), points["pixel"], ids))  # a pixel's centre first
    bounds = np.searchsorted(ids[order], np.arange(len(scene.smooth) + 1)).astype(np.int32)
    return PrimaryHits(
        resolution=size,
        object_ranges=np.stack([bounds[:-1], bounds[1:]], axis=1),
        object_image=centres.ids.reshape(height, width).astype(np.int16),
        open_image=background.reshape(height, width),
        emission_image=emission_picture(emitting, size),
        lamps=emitting,
        ray_directions=directions,
        coat_rays=tuple(i for i, each in enumerate(scene.description.objects) if each.has_smooth_coat),
        **{name: np.ascontiguousarray(array[order]) for name, array in points.items()},
    )


def centre_surfaces(scene: Scene, caster: RayCaster, hits: PrimaryHits) -> tuple[Float64Array, Float64Array]:
    """Position and normal (H, W, 3) of the surfaces at the pixels' centres, of emitters as well; 0 for the background.
    Points that reflect have their shading normals, others those of their faces."""
    width, height = hits.resolution
    position, normal = np.zeros((2, height * width, 3))
    rows = hits.row_image.ravel()
    shaded = np.flatnonzero(rows >= 0)
    position[shaded], normal[shaded] = hits.position[rows[shaded]], hits.normal[rows[shaded]]
    others = np.flatnonzero((hits.object_image.ravel() >= 0) & (rows < 0)).astype(np.int32)
    directions = hits.ray_directions.reshape(-1, 3)[others]
    rays = _trace_pixels(scene, caster, others, np.zeros((len(others), 2), np.float32), directions, width)
    met = np.flatnonzero(rays.ids >= 0)
    position[others[met]] = scene.camera_position + rays.found.distance[met, None].astype(np.float64) * directions[met]
    faces = scene.geometric_normals[rays.found.triangle[met]]
    towards = np.einsum("rk,rk->r", faces, directions[met])[:, None] < 0.0
    normal[others[met]] = np.where(towards, faces, -faces)
    return position.reshape(height, width, 3), normal.reshape(height, width, 3)


def emission_picture(lamps: Lamps, size: tuple[int, int]) -> Float32Array:
    """The picture (H, W, 3) of emitters."""
    image = np.zeros((size[0] * size[1], 3), np.float32)
    np.add.at(image, lamps.pixel, lamps.seen)
    return image.reshape(size[1], size[0], 3)


def _trace_pixels(
    scene: Scene, caster: RayCaster, pixel: Int32Array, offset: Float32Array, directions: Float32Array, width: int
) -> _Rays:
    origins = np.tile(scene.camera_position.astype(np.float32), (len(directions), 1))
    found = caster.intersect(origins, directions, pixel_chances(_places(pixel, offset, width), width))
    return _Rays(pixel, offset, directions, found, object_ids(scene, found))


def _trace_edge_pixels(
    scene: Scene, caster: RayCaster, pixels: Int32Array, n_rays: int, size: tuple[int, int]
) -> _Rays:
    """Trace n rays through each of the pixels (F,), one pixel after another."""
    pixel, offset = np.repeat(pixels, n_rays), np.tile(ray_offsets(n_rays), (len(pixels), 1))
    columns, lines = _places(pixel, offset, size[0]).T
    directions = pixel_directions(scene.description.camera, size, columns, lines)
    return _trace_pixels(scene, caster, pixel, offset, directions, size[0])


def _points(
    scene: Scene, caster: RayCaster, rays: _Rays, of: npt.NDArray[np.integer], size: tuple[int, int]
) -> _Points:
    """The points that some of the rays hit, each with its whole pixel as share."""
    towards, places = rays.directions[of], _places(rays.pixel[of], rays.offset[of], size[0])
    return {
        "ids": rays.ids[of],
        "pixel": rays.pixel[of],
        "offset": rays.offset[of],
        "share": np.ones(len(of), np.float32),
        "front": np.einsum("pk,pk->p", scene.geometric_normals[rays.found.triangle[of]], towards) < 0.0,
        **shading_frames(scene, caster, rays.found, rays.ids, of, -towards, (places, size)),
    }


def _places(pixel: Int32Array, offset: Float32Array, width: int) -> Float64Array:
    lines, columns = np.divmod(pixel, width)
    return np.asarray(np.stack([columns, lines], axis=1) + 0.5 + offset, np.float64)


def _with_edges(
    scene: Scene, caster: RayCaster, centred: _Points, met: Surface, around: _Rays, pixels: Int32Array,
    size: tuple[int, int],
) -> _Points:  # fmt: skip
    """Combine the points at the centres and, of the rays around those of edge pixels (F,), the group leaders, with
    their shares of the pixel. met: hits of all pixel centres."""
    if not len(pixels):
        return centred
    n_rays = len(around.ids) // len(pixels)
    beside = _surface_around(scene, around)
    samples = Surface(
        *(np.concatenate([a[pixels, None], b.reshape(-1, n_rays, *b.shape[1:])], axis=1)
          for a, b in zip(met, beside, strict=True))
    )  # fmt: skip
    groups = group_samples(samples, around.offset[:n_rays], turn_of(n_rays), len(centred["pixel"]))
    leads = np.flatnonzero(groups.leader[:, 1:] == np.arange(1, n_rays + 1))
    whole = np.ones(len(met.ids), np.float32)
    whole[pixels] = groups.share[:, 0]
    more = _points(scene, caster, around, leads, size)
    joined = {name: np.concatenate([array, more[name]]) for name, array in centred.items()}
    return joined | {"share": np.concatenate([whole[centred["pixel"]], groups.share[:, 1:].ravel()[leads]])}


def _surface(points: _Points, n_pixels: int) -> Surface:
    """The hits of all pixel centres."""
    ids, position, normal = np.full(n_pixels, -1, np.int32), *np.zeros((2, n_pixels, 3), np.float32)
    places = points["pixel"]
    ids[places], position[places], normal[places] = points["ids"], points["position"], points["horizon"]
    return Surface(ids, position, normal)


def _surface_around(scene: Scene, rays: _Rays) -> Surface:
    """Hits of rays in just enough detail to group them: few become points."""
    n = len(rays.ids)
    ids, position, normal = np.full(n, -1, np.int32), *np.zeros((2, n, 3), np.float32)
    of = rays.reflecting(scene)
    triangle, u, v = (each[of] for each in (rays.found.triangle, rays.found.u, rays.found.v))
    corners, weights = scene.triangles[triangle], np.stack([1.0 - u - v, u, v], axis=1)
    between = np.einsum("pk,pki->pi", weights, scene.normals[corners])
    length = np.linalg.norm(between, axis=1, keepdims=True)
    usable = scene.smooth[rays.ids[of]][:, None] & (length > 1e-4)
    shading = np.where(usable, between / np.where(usable, length, 1.0), scene.geometric_normals[triangle])
    ids[of], normal[of] = rays.ids[of], turned_to(shading, -rays.directions[of])
    position[of] = np.einsum("pk,pki->pi", weights, scene.vertices[corners])
    return Surface(ids, position, normal)


def object_ids(scene: Scene, found: Intersections) -> Int32Array:
    """The object each ray hits (R,), −1 for none."""
    objects = np.full(len(found.triangle), -1, np.int32)
    met = found.triangle >= 0
    objects[met] = scene.object_of_triangle[found.triangle[met]]
    return objects


def emission_towards(scene: Scene, found: Intersections, ids: Int32Array, directions: Float32Array) -> Float32Array:
    """Radiance (R, 3) of the emitters hit on their front, the side their winding faces."""
    met = np.flatnonzero(ids >= 0)
    facing = np.einsum("rk,rk->r", scene.geometric_normals[found.triangle[met]], directions[met]) < 0.0
    emits = met[facing & scene.emitters[ids[met]]]
    hit, radiance = found.of(emits), np.zeros((len(ids), 3), np.float32)
    sent = scene.emission[ids[emits]] * cone_shares(scene.cones[ids[emits]], directions[emits])[:, None]
    radiance[emits] = sent * scene.emission_textures.at(hit.triangle, hit.u, hit.v)
    return radiance
