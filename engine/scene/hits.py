"""What the eye sees: one surface point a pixel, and how much of a silhouette pixel belongs to its neighbour.

Only objects that reflect get a shading point; emitters and the background are pictures. The points are sorted by
object, so that everything about one object is a range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from engine.scene.camera import centre_directions, pixel_directions
from engine.scene.frames import object_tangents
from engine.scene.load import Scene
from engine.scene.raycaster import Intersections, RayCaster
from engine.scene.surface_points import SurfacePoints
from engine.scene.surface_uvs import pixel_footprints

Floats = npt.NDArray[np.float32]
Integers = npt.NDArray[np.int32]

# Of a shading normal to the eye.
LEAST_COSINE = 1e-3
# Four rays a pixel on a rotated grid, in pixels from its centre.
_SUB_RAYS = ((-0.375, -0.125), (0.125, -0.375), (0.375, 0.125), (-0.125, 0.375))


@dataclass(frozen=True)
class PrimaryHits(SurfacePoints):
    """The shading points of a picture (P of them), sorted by object, then row-major. Vectors are unit, float32.

    pixel (P,): row · width + column; object_ranges (M, 2) into the points; position (P, 3) in the scene's frame and
    offset_position, lifted off the surface for shadow rays; horizon: the normal that is interpolated where smooth, on
    the face's side and the eye's; normal: the shading normal, which is that as bumps turn it (`engine.scene.relief`);
    geometric_normal: the face's, turned to the eye; front (P,): whether the eye sees the side that the winding faces;
    tangent: across the object's Y axis, the brushed direction; wo: to the eye.
    object_image (H, W) int16, −1 for the background; emission_image (H, W, 3): emitters seen from their front;
    ray_directions (H, W, 3).
    edge_pixels (E,) of which the share edge_weights (E,) shows what edge_neighbours (E,) see (anti-aliasing for the
    screen alone).
    """

    resolution: tuple[int, int]
    pixel: Integers
    object_ranges: Integers
    normal: Floats
    geometric_normal: Floats
    front: npt.NDArray[np.bool_]
    tangent: Floats
    wo: Floats
    object_image: npt.NDArray[np.int16]
    emission_image: Floats
    ray_directions: Floats
    edge_pixels: Integers
    edge_weights: Floats
    edge_neighbours: Integers

    @property
    def outward(self) -> Floats:
        """The faces' normals (P, 3) on the side that the winding faces."""
        return np.where(self.front[:, None], self.geometric_normal, -self.geometric_normal)

    def at(self, rows: Integers) -> PrimaryHits:
        """Some of the points alone, by ascending rows; images stay those of the whole picture."""
        vectors = "position", "offset_position", "horizon", "normal", "geometric_normal", "tangent", "wo"
        points = ("pixel", "front", *vectors)
        ranges = np.searchsorted(rows, self.object_ranges).astype(self.object_ranges.dtype)
        return replace(self, object_ranges=ranges, **{name: getattr(self, name)[rows] for name in points})


def trace_primary(scene: Scene, caster: RayCaster, resolution: tuple[int, int] | None = None) -> PrimaryHits:
    """Trace a ray through every pixel centre (Python's oracle renders the same); resolution = (width, height)."""
    width, height = resolution or scene.resolution
    directions = centre_directions(scene.description.camera, (width, height))
    flat = directions.reshape(-1, 3)
    found = caster.intersect(np.tile(scene.eye.astype(np.float32), (len(flat), 1)), flat)
    ids = object_ids(scene, found)
    reflects = (ids >= 0) & ~scene.emitters[ids]
    pixel = np.flatnonzero(reflects).astype(np.int32)
    pixel = pixel[np.argsort(ids[pixel], kind="stable")]
    bounds = np.searchsorted(ids[pixel], np.arange(len(scene.smooth) + 1)).astype(np.int32)
    object_image = ids.reshape(height, width)
    edges = _edge_coverage(scene, caster, object_image)
    return PrimaryHits(
        resolution=(width, height),
        pixel=pixel,
        object_ranges=np.stack([bounds[:-1], bounds[1:]], axis=1),
        front=np.einsum("pk,pk->p", scene.geometric_normals[found.triangle[pixel]], flat[pixel]) < 0.0,
        object_image=object_image.astype(np.int16),
        emission_image=emission_towards(scene, found, ids, flat).reshape(height, width, 3),
        ray_directions=directions,
        edge_pixels=edges[0],
        edge_weights=edges[1],
        edge_neighbours=edges[2],
        **shading_frames(scene, caster, found, ids, pixel, -flat[pixel], (width, height)),
    )


def object_ids(scene: Scene, found: Intersections) -> Integers:
    """The object each ray hits (R,), −1 for none."""
    return np.where(found.triangle >= 0, scene.object_of_triangle[found.triangle], -1).astype(np.int32)


def emission_towards(scene: Scene, found: Intersections, ids: Integers, directions: Floats) -> Floats:
    """Radiance (R, 3) of the emitters hit on their front, the side their winding faces."""
    facing = np.einsum("rk,rk->r", scene.geometric_normals[found.triangle], directions) < 0.0
    shines = (ids >= 0) & facing
    return np.where(shines[:, None], scene.emission[ids], np.float32(0.0)).astype(np.float32)


def shading_frames(
    scene: Scene, caster: RayCaster, found: Intersections, ids: Integers, rays: npt.NDArray[np.integer], wo: Floats,
    resolution: tuple[int, int] | None = None,
) -> dict[str, Floats]:  # fmt: skip
    """Position, normals, tangent and wo of the points (P,) that some `rays` (P,) of those found hit.

    ids (R,): `object_ids` of all; wo (P, 3): back along the rays. Named and turned as in `PrimaryHits`. resolution: of
    the picture whose pixels the rays go through, over which bumps are averaged; None for rays from anywhere.
    """
    triangle, ids = found.triangle[rays], ids[rays]
    u, v = found.u[rays].astype(np.float64), found.v[rays].astype(np.float64)
    weights = np.stack([1.0 - u - v, u, v], axis=1)
    corners = scene.triangles[triangle]
    position = np.einsum("pk,pki->pi", weights, scene.vertices[corners].astype(np.float64))
    geometric = scene.geometric_normals[triangle].astype(np.float64)
    interpolated = np.einsum("pk,pki->pi", weights, scene.normals[corners].astype(np.float64))
    length = np.linalg.norm(interpolated, axis=1, keepdims=True)
    usable = scene.smooth[ids][:, None] & (length > 1e-4)
    shading = np.where(usable, interpolated / np.where(usable, length, 1.0), geometric)
    geometric = _face(geometric, wo)
    horizon = _towards(_face(shading, geometric), wo)
    normal = _turned(scene, found, rays, horizon, wo, resolution) if scene.relief.objects else horizon
    vectors = {
        "position": position,
        "offset_position": caster.offset_origins(position, geometric),
        "horizon": horizon,
        "normal": normal,
        "geometric_normal": geometric,
        "tangent": object_tangents(scene, ids, normal),
        "wo": wo,
    }
    return {name: np.ascontiguousarray(vector, dtype=np.float32) for name, vector in vectors.items()}


def _turned(
    scene: Scene, found: Intersections, rays: npt.NDArray[np.integer], normals: npt.NDArray[np.float64], wo: Floats,
    resolution: tuple[int, int] | None,
) -> npt.NDArray[np.float64]:  # fmt: skip
    """Normals (P, 3) of hits as the scene's bumps turn them."""
    bumpy = np.flatnonzero(np.isin(scene.object_of_triangle[found.triangle[rays]], scene.relief.objects))
    at = rays[bumpy]
    hit = Intersections(*(getattr(found, name)[at] for name in ("triangle", "u", "v", "distance")))
    footprints = None if resolution is None else pixel_footprints(scene, hit, at, resolution)
    out = normals.copy()
    out[bumpy] = scene.relief.turned(hit.triangle, hit.u, hit.v, normals[bumpy], wo[bumpy], footprints)
    return out


def _face(normals: npt.NDArray[np.float64], side: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    """Normals turned to a side: the face's to the eye's, the shading normal to the face's."""
    return np.where(np.einsum("pk,pk->p", normals, side)[:, None] < 0.0, -normals, normals)


def _towards(normals: npt.NDArray[np.float64], wo: Floats) -> npt.NDArray[np.float64]:
    """Unit normals, those that lean away from the eye bent until it sees their side edge on.

    Along silhouettes an interpolated normal may point behind a face that the eye sees. Turned round by its own sign, as
    two-sided materials do that ask the shading frame alone, it would face into the body: a dark dot in the picture.
    """
    along = np.einsum("pk,pk->p", normals, wo)[:, None]
    bent = normals + np.maximum(LEAST_COSINE - along, 0.0) * wo
    return np.where(along < LEAST_COSINE, bent / np.linalg.norm(bent, axis=1, keepdims=True), normals)


def _edge_coverage(scene: Scene, caster: RayCaster, ids: Integers) -> tuple[Integers, Floats, Integers]:
    """Silhouette pixels, the share of each that a neighbour's object covers, and that neighbour.

    Four rays a pixel; of the objects other than the pixel's own the most frequent one counts, if one of the eight
    neighbours sees it at its centre.
    """
    height, width = ids.shape
    rows, columns = np.nonzero(_silhouette(ids))
    eye = np.tile(scene.eye.astype(np.float32), (len(rows), 1))
    seen = np.empty((len(rows), len(_SUB_RAYS)), np.int32)
    for k, (dx, dy) in enumerate(_SUB_RAYS):
        directions = pixel_directions(scene.description.camera, (width, height), columns + 0.5 + dx, rows + 0.5 + dy)
        seen[:, k] = object_ids(scene, caster.intersect(eye, directions))
    foreign = seen != ids[rows, columns][:, None]
    votes = np.where(foreign, (seen[:, :, None] == seen[:, None, :]).sum(axis=2), 0)
    best = votes.argmax(axis=1)
    count = np.take_along_axis(votes, best[:, None], axis=1)[:, 0]
    other = np.take_along_axis(seen, best[:, None], axis=1)[:, 0]
    neighbour = _neighbour_with(ids, rows, columns, other)
    kept = (count > 0) & (neighbour >= 0)
    pixels = (rows * width + columns).astype(np.int32)
    return pixels[kept], (count[kept] / len(_SUB_RAYS)).astype(np.float32), neighbour[kept]


def _silhouette(ids: Integers) -> npt.NDArray[np.bool_]:
    """Pixels with one of four neighbours that sees another object (H, W)."""
    edge = np.zeros(ids.shape, bool)
    across, down = ids[:, 1:] != ids[:, :-1], ids[1:] != ids[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return edge


def _neighbour_with(ids: Integers, rows: npt.NDArray, columns: npt.NDArray, other: Integers) -> Integers:
    """The first of each pixel's eight neighbours (sides before corners) that sees the object `other`, or −1."""
    height, width = ids.shape
    found = np.full(len(rows), -1, np.int32)
    for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        y, x = rows + dy, columns + dx
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        same = inside & (ids[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)] == other)
        found = np.where((found < 0) & same, y * width + x, found).astype(np.int32)
    return found
