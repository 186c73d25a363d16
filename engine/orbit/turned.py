"""What is reflected where bumps turn normals: each pixel in a frame of its own, by the light of the points around it.

Light times visibility stays by position, in the points' frames, and slices are looked up in the pixel's. In stills that
is done triangle by triangle. Where a window waits, a broad reflection takes larger triangles, and a highlight is looked
up from where the surface as it is without bumps would show in the mirror what the turned one shows: its place is true
then, and its shape all but that. Suns are looked up one by one in any case.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.orbit import _picture_kernels, _slice_kernels
from engine.orbit import _turned_kernels as kernels
from engine.orbit.incident import Incident, hemisphere
from engine.orbit.picture import Seen
from engine.orbit.sky import Sky
from engine.scene.description import Camera
from engine.scene.frames import object_tangents
from engine.scene.load import Scene
from engine.scene.surface_uvs import pixel_footprints
from engine.sphere.geodesic import geodesic, triangle_first_moments
from engine.threads import even_parts, on_threads

Floats = NDArray[np.float32]
Rows = NDArray[np.int64]
# A slice whose peak is so many times its mean is a highlight.
_HIGHLIGHT = 4.0
_MATT_LEVEL, _BROAD_LEVEL, _STILL_LEVEL = 3, 2, 4


@dataclass(frozen=True, eq=False)
class TurnedSamples:
    """Samples (N,) of one object: frames (N, 3, 3) as `ShadingPoints.frames`, turned, and the normals (N, 3) before."""

    which: Rows
    frames: Floats
    normals: Floats
    wo: Floats


def turned_samples(seen: Seen, which: Rows, scene: Scene, camera: Camera, i_object: int) -> TurnedSamples:
    """The frames of samples (N,) of an object under its bumps, averaged over their pixels."""
    hit, wo = seen.in_scene(which), np.ascontiguousarray(seen.samples.wo[which])
    weights, corners = seen.samples.weights[which].astype(np.float64), seen.samples.corners[which]
    before = np.einsum("nk,nki->ni", weights, seen.points.normal[corners])
    before /= np.maximum(np.linalg.norm(before, axis=1, keepdims=True), 1e-30)
    footprints = pixel_footprints(scene.seen_from(camera), hit, seen.pixel[which], seen.resolution)
    normals = scene.relief.turned(hit.triangle, hit.u, hit.v, before, wo.astype(np.float64), footprints)
    tangents = object_tangents(scene, np.full(len(which), i_object), normals)
    frames = np.stack([tangents, normals, np.cross(tangents, normals)], axis=1)
    return TurnedSamples(which, frames.astype(np.float32), before.astype(np.float32), wo)


def turned_irradiance(seen: Seen, samples: TurnedSamples, incident: Incident, sky: Sky, moves: bool) -> Floats:
    """Irradiance (N, 3) of turned surfaces; by larger triangles while something moves."""
    level = _BROAD_LEVEL if moves else _MATT_LEVEL
    normals, tables = np.ascontiguousarray(samples.frames[:, 1]), _no_tables()

    def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Floats) -> None:
        kernels.irradiance(
            start, stop, points, first, members, normals, seen.points.frames, incident.slot, incident.kept, level,
            _directions(level), out,
        )  # fmt: skip

    found = _by_points(seen, samples, fill)
    turned = _suns(seen, samples, incident, sky, tables, is_matt=True)
    return np.maximum(found + turned - _suns(seen, samples, incident, sky, tables, is_matt=True, unturned=True), 0.0)


def turned_reflection(
    seen: Seen, samples: TurnedSamples, incident: Incident, sky: Sky, tables: _slice_kernels.Tables, still: bool
) -> Floats:
    """Radiance (N, 3) that turned surfaces with gloss send to the eye."""
    lit = _suns(seen, samples, incident, sky, tables)
    if not still and _is_highlight(tables):
        mirrored = np.empty_like(samples.wo)
        kernels.mirrored_eyes(samples.wo, samples.frames, samples.normals, mirrored)

        def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Floats) -> None:
            _slice_kernels.shade_corners(
                start, stop, points, first, members, mirrored, seen.points.frames, incident.slot, incident.kept,
                tables, out,
            )  # fmt: skip
    else:
        level = _STILL_LEVEL if still else _BROAD_LEVEL

        def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Floats) -> None:
            kernels.shade_broad(
                start, stop, points, first, members, samples.wo, samples.frames, seen.points.frames, incident.slot,
                incident.kept, level, _directions(level), hemisphere().children, tables, out,
            )  # fmt: skip

    return lit + _by_points(seen, samples, fill)


_Fill = Callable[[int, int, Rows, Rows, Rows, Floats], None]


def _by_points(seen: Seen, samples: TurnedSamples, fill: _Fill) -> Floats:
    """What is found at samples' corners, (N, 3), point by point."""
    asked, first, members = _picture_kernels.by_point(samples.which, seen.samples.corners, len(seen.points))
    at_corners = np.empty((3 * len(samples.which), 3), np.float32)
    on_threads(lambda start, stop: fill(start, stop, asked, first, members, at_corners), *even_parts(len(asked)))
    weights = seen.samples.weights[samples.which]
    return np.asarray(np.einsum("nk,nki->ni", weights, at_corners.reshape(-1, 3, 3)), np.float32)


def _suns(
    seen: Seen, samples: TurnedSamples, incident: Incident, sky: Sky, tables: _slice_kernels.Tables,
    is_matt: bool = False, unturned: bool = False,
) -> Floats:  # fmt: skip
    out, met = np.zeros((len(samples.which), 3), np.float32), seen.samples

    def part(start: int, stop: int) -> None:
        kernels.suns(
            start, stop, samples.which, met.corners, met.weights, samples.wo, samples.frames, seen.points.frames,
            incident.kept.sun_bits, sky.sun_direction, sky.sun_power, hemisphere().children, tables, is_matt, unturned,
            out,
        )  # fmt: skip

    if len(sky.sun_power):
        on_threads(part, *even_parts(len(out)))
    return out


def _is_highlight(tables: _slice_kernels.Tables) -> bool:
    size = tables.places.shape[1]
    upright = _slice_kernels.unpacked(tables.values[: 3 * size]).reshape(size, 3).sum(axis=1)
    return bool(upright.max() > _HIGHLIGHT * upright.mean())


def _directions(level: int) -> Floats:
    """Of a level's triangles, as long as their mean cosines ask for, (20·4^level, 3)."""
    sphere = geodesic(level)
    moments = triangle_first_moments(sphere.vertices[sphere.triangles]) / sphere.solid_angles[:, None]
    return np.ascontiguousarray(moments, np.float32)


def _no_tables() -> _slice_kernels.Tables:
    """Where none are asked."""
    none, places = np.zeros(0, np.uint16), np.zeros((1, 0), np.int32)
    return _slice_kernels.Tables(none, none, places, places, 2, 2, 1.0, 0)
