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
from engine.orbit.seen_maps import MOVING_PROBES, footprints_of
from engine.orbit.sky import Sky
from engine.scene.frames import object_tangents
from engine.scene.load import Scene
from engine.sphere.geodesic import geodesic, triangle_first_moments
from engine.threads import even_parts, on_threads

Floats = NDArray[np.float32]
Rows = NDArray[np.int64]
# A slice whose peak is so many times its mean is a highlight.
_HIGHLIGHT = 4.0
_MATT_LEVEL, _BROAD_LEVEL, _STILL_LEVEL = 2, 2, 4


@dataclass(frozen=True, eq=False)
class TurnedSamples:
    """Samples (N,) of one object: frames (N, 3, 3) as `ShadingPoints.frames`, turned, and the normals (N, 3) before."""

    which: Rows
    frames: Floats
    normals: Floats
    wo: Floats


def turned_samples(seen: Seen, which: Rows, scene: Scene, i_object: int) -> TurnedSamples:
    """The frames of samples (N,) of an object under its bumps, averaged over their pixels."""
    footprints, samples = footprints_of(seen, which, scene, i_object), seen.samples
    frames, before = np.empty((len(which), 3, 3), np.float32), np.empty((len(which), 3), np.float32)

    def part(start: int, stop: int) -> None:
        some = which[start:stop]
        hit, wo = seen.in_scene(some), samples.wo[some].astype(np.float64)
        weights, corners = samples.weights[some].astype(np.float64), samples.corners[some]
        own = np.einsum("nk,nki->ni", weights, seen.points.normal[corners])
        own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-30)
        uv, across, down = (each[start:stop] for each in footprints)
        normals = scene.relief.turned(hit.triangle, hit.u, hit.v, own, wo, (uv, across, down))
        tangents = object_tangents(scene, np.full(len(some), i_object), normals)
        frames[start:stop] = np.stack([tangents, normals, np.cross(tangents, normals)], axis=1)
        before[start:stop] = own

    on_threads(part, *even_parts(len(which)))
    return TurnedSamples(which, frames, before, np.ascontiguousarray(samples.wo[which]))


def leaning_irradiance(seen: Seen, which: Rows, incident: Incident, scene: Scene, i_object: int) -> Floats:
    """Irradiance (N, 3) of samples (N,) of an object under its bumps, while something moves: by the three sums that
    points keep of all their light."""
    out = np.empty((len(which), 3), np.float32)
    footprints, samples = footprints_of(seen, which, scene, i_object), seen.samples

    def part(start: int, stop: int) -> None:
        some = which[start:stop]
        hit, wo = seen.in_scene(some), samples.wo[some]
        normals = np.einsum("nk,nki->ni", samples.weights[some], seen.points.normal[samples.corners[some]])
        uv, across, down = (each[start:stop] for each in footprints)
        leans = scene.relief.leans(i_object, hit.triangle, hit.u, hit.v, normals, wo, (uv, across, down), MOVING_PROBES)
        kernels.leaning_irradiance(
            0, len(some), some, samples.corners, samples.weights, leans.astype(np.float32), seen.points.frames,
            incident.slot, incident.kept, out[start:stop],
        )  # fmt: skip

    on_threads(part, *even_parts(len(which)))
    return out


def turned_irradiance(seen: Seen, samples: TurnedSamples, incident: Incident, sky: Sky) -> Floats:
    """Irradiance (N, 3) of turned surfaces at rest."""
    normals, met = np.ascontiguousarray(samples.frames[:, 1]), seen.samples

    def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Floats) -> None:
        kernels.irradiance(
            start, stop, points, first, members, normals, seen.points.frames, incident.slot, incident.kept, _MATT_LEVEL,
            _directions(_MATT_LEVEL), out,
        )  # fmt: skip

    found, of_suns = _by_points(seen, samples, fill), np.empty((len(samples.which), 3), np.float32)

    def add_suns(start: int, stop: int) -> None:
        kernels.sun_irradiance(
            start, stop, samples.which, met.corners, met.weights, samples.frames, seen.points.frames,
            incident.kept.sun_bits, sky.sun_direction, sky.sun_power, of_suns,
        )  # fmt: skip

    on_threads(add_suns, *even_parts(len(of_suns)))
    return np.maximum(found + of_suns, 0.0)


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
    seen: Seen, samples: TurnedSamples, incident: Incident, sky: Sky, tables: _slice_kernels.Tables
) -> Floats:  # fmt: skip
    out, met = np.zeros((len(samples.which), 3), np.float32), seen.samples

    def part(start: int, stop: int) -> None:
        kernels.suns(
            start, stop, samples.which, met.corners, met.weights, samples.wo, samples.frames, incident.kept.sun_bits,
            sky.sun_direction, sky.sun_power, hemisphere().children, tables, out,
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
