"""Reflection where bumps perturb normals: each pixel has its own frame, and uses the light of the points around it.

Light times visibility stays in the points' frames, and slices are looked up in the pixel's frame. Stills do this
triangle by triangle. Where a window waits, a broad reflection uses larger triangles, and a highlight is looked up along
the outgoing direction for which the unperturbed surface has the same mirror direction: its position is then exact, and
its shape nearly so. Peaks are always looked up one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import sphere_frames
from engine.core.threads import even_parts, on_threads
from engine.realtime.core.terms import MOVING_PROBES
from engine.realtime.triple_product import _footprint_kernels as footprint_kernels
from engine.realtime.triple_product import _perturbed_kernels as kernels
from engine.realtime.triple_product import _picture_kernels, _slice_kernels
from engine.realtime.triple_product.incident import Incident, hemisphere
from engine.realtime.triple_product.point_reflection import mirror_directions, peak_lights_of, reflect_at_corners
from engine.realtime.triple_product.sky_map import SkyMap, make_sky
from engine.realtime.triple_product.view_maps import footprints_of
from engine.realtime.triple_product.view_samples import ViewSamples
from engine.scene.primary_hits import object_tangents
from engine.scene.scene_loader import Scene
from engine.sphere.geodesic import geodesic, triangle_first_moments

Float32Array = NDArray[np.float32]
Rows = NDArray[np.int64]
Float64Array = NDArray[np.float64]
# A slice whose peak is this many times its mean is a highlight.
_HIGHLIGHT = 4.0
# Coefficients of a relocated highlight: more show detail that is wrong there (*rings*: 96 give an error of 3.7 %, 320
# of 4.8 %).
N_MIRRORED = 96
_DIFFUSE_LEVEL, _BROAD_LEVEL, _STILL_LEVEL = 2, 2, 4


@dataclass(frozen=True, eq=False)
class PerturbedSamples:
    """Samples (N,) of one object, and their perturbed frames (N, 3, 3), as `ShadingPoints.frames`."""

    which: Rows
    frames: Float32Array
    wo: Float32Array


def perturb_samples(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> PerturbedSamples:
    """Frames of samples (N,) of an object under its bumps, averaged over the pixels."""
    footprints, samples = footprints_of(seen, which, scene, i_object), seen.samples
    frames = np.empty((len(which), 3, 3), np.float32)

    def part(start: int, stop: int) -> None:
        some = which[start:stop]
        wo = samples.wo[some].astype(np.float64)
        triangle, u, v, own = _places(seen, some)
        uv, across, down = (each[start:stop] for each in footprints)
        normals = scene.bump_normals.perturb(triangle, u, v, own, wo, (uv, across, down))
        tangents = object_tangents(scene, np.full(len(some), i_object), normals)
        frames[start:stop] = sphere_frames(tangents, normals)

    on_threads(part, *even_parts(len(which)))
    return PerturbedSamples(which, frames, np.ascontiguousarray(samples.wo[which]))


def quick_irradiance(seen: ViewSamples, which: Rows, incident: Incident, scene: Scene, i_object: int) -> Float32Array:
    """Irradiance (N, 3) of samples (N,) of an object under its bumps, for moving pictures: by the three moments of
    light that points store."""
    out, leans = np.empty((len(which), 3), np.float32), _quick_normal_offsets(seen, which, scene, i_object)

    def part(start: int, stop: int) -> None:
        kernels.quick_irradiance(
            start, stop, which, seen.samples.corners, seen.samples.weights, leans, seen.points.frames, incident.slot,
            incident.stored, out,
        )  # fmt: skip

    on_threads(part, *even_parts(len(which)))
    return out


def _quick_normal_offsets(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> Float32Array:
    """Offsets of the normals (N, 3) by bumps, with a rough estimate of a pixel's footprint; cached."""
    key = i_object, scene.description.objects[i_object].bumps
    if key not in seen.leans:
        leans, footprints = np.empty((len(which), 3), np.float32), footprints_of(seen, which, scene, i_object)

        def part(start: int, stop: int) -> None:
            some = which[start:stop]
            uv, across, down = (each[start:stop] for each in footprints)
            leans[start:stop] = scene.bump_normals.normal_offsets(
                i_object, *_places(seen, some), seen.samples.wo[some], (uv, across, down), MOVING_PROBES, is_quick=True
            )

        on_threads(part, *even_parts(len(which)))
        seen.leans[key] = leans
    return seen.leans[key]


def _places(seen: ViewSamples, which: Rows) -> tuple[Rows, Float64Array, Float64Array, Float64Array]:
    """Triangle, u and v of samples (N,) in the scene, and their interpolated normals (N, 3)."""
    n, samples, points = len(which), seen.samples, seen.points
    out = np.empty(n, np.int64), np.empty(n), np.empty(n), np.empty((n, 3))
    footprint_kernels.places(
        0, n, which, seen.found[0], samples.corners, seen.shares, points.normal, points.within, points.source, *out
    )
    return out


def perturbed_irradiance(seen: ViewSamples, samples: PerturbedSamples, incident: Incident, sky: SkyMap) -> Float32Array:
    """Irradiance (N, 3) of perturbed surfaces at rest."""
    normals, met = np.ascontiguousarray(samples.frames[:, 1]), seen.samples

    def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Float32Array) -> None:
        kernels.irradiance(
            start, stop, points, first, members, normals, seen.points.frames, incident.slot, incident.stored,
            _DIFFUSE_LEVEL,
            _directions(_DIFFUSE_LEVEL), out,
        )  # fmt: skip

    found, of_peaks = _by_points(seen, samples, fill), np.empty((len(samples.which), 3), np.float32)

    def add_peaks(start: int, stop: int) -> None:
        kernels.peak_irradiance(
            start, stop, samples.which, met.corners, met.weights, samples.frames, seen.points.frames,
            incident.stored.peak_bits, *_in_rows(sky), _of_bytes(), of_peaks,
        )  # fmt: skip

    on_threads(add_peaks, *even_parts(len(of_peaks)))
    return np.maximum(found + of_peaks, 0.0)


def perturbed_reflection(
    seen: ViewSamples,
    samples: PerturbedSamples,
    incident: Incident,
    sky: SkyMap,
    tables: _slice_kernels.Tables,
    still: bool,
) -> Float32Array:
    """Radiance (N, 3) that perturbed glossy surfaces send to the camera."""
    lit = _peak_radiance(seen, samples, incident, sky, tables)
    if not still and _is_highlight(tables):
        ways, apart = (
            mirror_directions(samples.wo, samples.frames[:, 1]),
            peak_lights_of(make_sky(None, 0.0), incident, 0.0),
        )
        return lit + reflect_at_corners(
            seen, samples.which, ways, incident, apart, tables, np.zeros((0, 2), np.uint64), N_MIRRORED
        )
    level = _STILL_LEVEL if still else _BROAD_LEVEL

    def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Float32Array) -> None:
        kernels.shade_broad(
            start, stop, points, first, members, samples.wo, samples.frames, seen.points.frames, incident.slot,
            incident.stored, level, _directions(level), hemisphere().children, tables, out,
        )  # fmt: skip

    return lit + _by_points(seen, samples, fill)


_Fill = Callable[[int, int, Rows, Rows, Rows, Float32Array], None]


def _by_points(seen: ViewSamples, samples: PerturbedSamples, fill: _Fill) -> Float32Array:
    """Fill values at the samples' corners, point by point, and interpolate them, (N, 3)."""
    requested, first, members = _picture_kernels.by_point(samples.which, seen.samples.corners, len(seen.points))
    at_corners = np.empty((3 * len(samples.which), 3), np.float32)
    on_threads(
        lambda start, stop: fill(start, stop, requested, first, members, at_corners), *even_parts(len(requested))
    )
    weights = seen.samples.weights[samples.which]
    return np.asarray(np.einsum("nk,nki->ni", weights, at_corners.reshape(-1, 3, 3)), np.float32)


def _peak_radiance(
    seen: ViewSamples, samples: PerturbedSamples, incident: Incident, sky: SkyMap, tables: _slice_kernels.Tables
) -> Float32Array:  # fmt: skip
    out, met = np.zeros((len(samples.which), 3), np.float32), seen.samples

    def part(start: int, stop: int) -> None:
        kernels.peak_radiance(
            start, stop, samples.which, met.corners, met.weights, samples.wo, samples.frames, incident.stored.peak_bits,
            *_in_rows(sky), hemisphere().children, _of_bytes(), tables, out,
        )  # fmt: skip

    if len(sky.peak_power):
        on_threads(part, *even_parts(len(out)))
    return out


def _in_rows(sky: SkyMap) -> tuple[Float32Array, Float32Array]:
    """Direction and power (3, M) of a sky's peaks, padded with peaks without power to a multiple of 8."""
    n_more = -len(sky.peak_power) % 8
    more = np.zeros((n_more, 3), np.float32)
    direction, power = (np.concatenate([each, more]).T for each in (sky.peak_direction, sky.peak_power))
    return np.ascontiguousarray(direction), np.ascontiguousarray(power)


_of_bytes = lru_cache(maxsize=1)(kernels.of_bytes)


def _is_highlight(tables: _slice_kernels.Tables) -> bool:
    size = len(tables.values) // (tables.n_polar * tables.n_columns) // 3
    upright = _slice_kernels.unpacked(tables.values[: 3 * size]).reshape(size, 3).sum(axis=1)
    return bool(upright.max() > _HIGHLIGHT * upright.mean())


def _directions(level: int) -> Float32Array:
    """Directions of a level's triangles, scaled to the length of their mean cosines, (20·4^level, 3)."""
    sphere = geodesic(level)
    moments = triangle_first_moments(sphere.vertices[sphere.triangles]) / sphere.solid_angles[:, None]
    return np.ascontiguousarray(moments, np.float32)
