"""Glossy reflection towards the camera, at shading points and at pixels, and reflection where bumps perturb normals.

In moving pictures, the visible points are shaded and their colours are interpolated. At rest, and where gloss is
sharper than the points' spacing, every pixel interpolates functions, not colours [Ma06, 3.3]: it reflects the light of
its three points in its own direction.

Where bumps perturb normals, each pixel has its own frame. Light times visibility stays in the points' frames, and
slices are looked up in the pixel's frame. Stills do this triangle by triangle. Where a window waits, a broad reflection
uses larger triangles, and a highlight is looked up along the outgoing direction for which the unperturbed surface has
the same mirror direction: its position is then exact, and its shape nearly so. Peaks are always looked up one by
one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.frames import sphere_frames
from engine.core.threads import even_parts, on_threads
from engine.material.layer import Layer, evaluate_layers
from engine.realtime.core import _sample_kernels as sample_kernels
from engine.realtime.core.view_samples import Rows, ViewSamples, footprints_of
from engine.realtime.triple_product import _pixel_kernels as pixel_kernels
from engine.realtime.triple_product import _slice_kernels as slice_kernels
from engine.realtime.triple_product._patch_kernels import PatchLights
from engine.realtime.triple_product._patch_query_kernels import query_patches
from engine.realtime.triple_product.incident import Incident, SceneEmitters, SkyMap, hemisphere, make_sky
from engine.scene.bump_normals import offset_normals
from engine.scene.map_sampler import MOVING_PROBES
from engine.scene.raycaster import Intersections
from engine.scene.scene_loader import Scene
from engine.scene.shading_frames import LEAST_COSINE
from engine.sphere.geodesic import geodesic, triangle_first_moments

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
_PIXELS, _QUERIES = 1024, 65536  # at a time
# Share of a sample's radiance by which slices may disagree about all patches before the BRDF is evaluated for each.
_LITTLE_OF_PATCHES = 0.1
MOST_COEFFICIENTS = 5120
# A slice whose peak is this many times its mean is a highlight.
_HIGHLIGHT = 4.0
# Coefficients of a relocated highlight: more show detail that is wrong there (*rings*: 96 give an error of 3.7 %, 320
# of 4.8 %).
N_MIRRORED = 96
_DIFFUSE_LEVEL, _BROAD_LEVEL, _STILL_LEVEL = 2, 2, 4
_NONE = np.zeros((0, 3), np.float32)
NO_PATCHES = PatchLights(
    _NONE, np.zeros((0, 0), np.uint8), np.zeros(0, np.int32), np.zeros((0, 3, 3), np.float32), _NONE, _NONE, _NONE,
    np.zeros(0, np.float32), np.zeros((0, 4), np.float32), 0.0,
)  # fmt: skip


def empty_shades(incident: Incident) -> slice_kernels.Shades:
    """Allocate a cache of what glossy points send to the camera."""
    n = len(incident.stored.number)
    return slice_kernels.Shades(np.full(n, -1, np.int64), np.empty((n, 4, 4), np.float32))


def shade_points(
    seen: ViewSamples, points: NDArray[np.int64], incident: Incident, tables: slice_kernels.Tables, n: int,
    shades: slice_kernels.Shades, colours: Float32Array,
) -> None:  # fmt: skip
    """Add to colours (S, 3) of points (N,) what they send to the camera, by n coefficients and by peaks. shades: a
    cache, which must be invalidated where light changes."""
    at, frames = seen.points.position, seen.points.frames

    def part(start: int, stop: int) -> None:
        slice_kernels.shade_points(
            start,
            stop,
            points,
            seen.camera_position,
            n,
            at,
            frames,
            incident.slot,
            incident.stored,
            tables,
            shades,
            colours,
        )

    on_threads(part, *even_parts(len(points)))


def reflect_at_pixels(
    seen: ViewSamples, which: Rows, incident: Incident, sky: SkyMap, layers: Sequence[Layer],
    tables: slice_kernels.Tables, little: float, n: int = MOST_COEFFICIENTS, offsets: Float32Array | None = None,
    emitters: SceneEmitters | None = None, width: float = 0.0,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) that samples (N,) of one object reflect to the camera, by n coefficients and by peaks.

    tables: the layers' slices. They reflect peaks about which neighbouring slices disagree by less than `little` of all
    reflected light. The layers' formulas reflect the other peaks, each in its own direction: highlights are thus as
    sharp as the layers, where slices resolve a triangle's 2.8 degrees. A pixel sees of a peak what its points see.
    offsets (N, 3): of the unit normals by bumps, perpendicular to them; None for none. emitters: those whose patches
    the formulas reflect likewise, where their light is known by fine triangles; None for none. width: of the sharpest
    layer's lobe, in radians.
    """
    peaks, patches = peak_lights_of(sky, incident, little), patch_lights_of(seen, emitters)
    sharp_patches = np.zeros(3 * len(which) if len(patches.flux) else 0, bool)
    sharp = np.zeros((3 * len(which) if len(peaks.power) else 0, 2), np.uint64)
    normals = seen.normals(which)
    if offsets is not None:
        normals += offsets
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = mirror_directions(seen.samples.wo[which], normals)
    radiance = reflect_at_corners(seen, which, directions, incident, peaks, tables, sharp, n, patches, sharp_patches)
    if len(sharp):
        _add_sharp(seen, which, peaks, sharp, layers, offsets, radiance)
    if sharp_patches.any():
        _add_sharp_patches(seen, which, patches, sharp_patches, width, layers, offsets, radiance)
    return radiance


def peak_lights_of(sky: SkyMap, incident: Incident, little: float) -> slice_kernels.PeakLights:
    """A sky's peaks as points see them."""
    return slice_kernels.PeakLights(
        sky.peak_direction, sky.peak_power, incident.stored.peak_bits, hemisphere().children, little
    )  # fmt: skip


def patch_lights_of(seen: ViewSamples, emitters: SceneEmitters | None) -> PatchLights:
    """Emitters' patches as points see them."""
    if emitters is None:
        return NO_PATCHES
    own = emitters.patches
    return PatchLights(
        seen.points.position, emitters.bits, hemisphere().number, own.corners, own.centre, own.normal,
        own.radiance * own.area[:, None], own.area, own.cones, _LITTLE_OF_PATCHES,
    )  # fmt: skip


def mirror_directions(wo: Float32Array, normals: Float32Array) -> Float32Array:
    """Mirror directions of wo (N, 3) at surfaces with normals (N, 3)."""
    along = np.einsum("ni,ni->n", normals, wo)
    return np.asarray(2.0 * along[:, None] * normals - wo, np.float32)


def reflect_at_corners(
    seen: ViewSamples, which: Rows, directions: Float32Array, incident: Incident, peaks: slice_kernels.PeakLights,
    tables: slice_kernels.Tables,
    sharp: NDArray[np.uint64], n_most: int = MOST_COEFFICIENTS,
    patches: PatchLights | None = None, sharp_patches: NDArray[np.bool_] | None = None,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) that samples (N,) with these mirror directions (N, 3) send, interpolated between the points
    around them; see `shade_corners`.

    Each point is evaluated in the outgoing direction that has the same mirror direction there. So a highlight keeps its
    position even where normals turn between points by more than its width; everything else changes only by the square
    of that angle.
    """
    samples, patches = seen.samples, patches or NO_PATCHES
    without = np.zeros(0, bool) if sharp_patches is None else sharp_patches
    requested, first, members = sample_kernels.by_point(which, samples.corners, len(seen.points))
    found = np.empty((3 * len(which), 3), np.float32)

    def part(start: int, stop: int) -> None:
        slice_kernels.shade_corners(
            start, stop, requested, first, members, directions, n_most, seen.points.frames, incident.slot,
            incident.stored, peaks, patches, tables, found, sharp, without,
        )  # fmt: skip

    on_threads(part, *even_parts(len(requested)))
    return np.asarray(np.einsum("nk,nki->ni", samples.weights[which], found.reshape(-1, 3, 3)), np.float32)


def _add_sharp(
    seen: ViewSamples, which: Rows, peaks: slice_kernels.PeakLights, sharp: NDArray[np.uint64],
    layers: Sequence[Layer], offsets: Float32Array | None, radiance: Float32Array,
) -> None:  # fmt: skip
    """Add the layers' reflection of sharp peaks to radiance (N, 3)."""
    samples, frames = seen.samples, seen.points.frames
    offsets = np.zeros((0, 3), np.float32) if offsets is None else offsets

    def part(start: int) -> None:
        some, bits = which[start : start + _PIXELS], sharp[3 * start : 3 * (start + _PIXELS)]
        requested = _empty_queries(len(some) * len(peaks.power))
        n = pixel_kernels.query_peaks(
            some, samples.corners, samples.weights, samples.wo, frames, offsets[start : start + _PIXELS], peaks, bits,
            LEAST_COSINE, requested,
        )  # fmt: skip
        if n:
            found = evaluate_layers(layers, requested.wi[:n], requested.wo[:n])
            pixel_kernels.add_answers(n, requested, found, radiance[start : start + _PIXELS])

    on_threads(part, range(0, len(which), _PIXELS))


def _add_sharp_patches(
    seen: ViewSamples, which: Rows, patches: PatchLights, sharp: NDArray[np.bool_], width: float,
    layers: Sequence[Layer], offsets: Float32Array | None, radiance: Float32Array,
) -> None:  # fmt: skip
    """Add the layers' reflection of patches to radiance (N, 3) where corners (3 N,) left them out; width: of the
    layers' sharpest lobe, in radians."""
    samples, frames = seen.samples, seen.points.frames
    offsets = np.zeros((0, 3), np.float32) if offsets is None else offsets

    def part(start: int) -> None:
        some, own = which[start : start + _PIXELS], slice(start, start + _PIXELS)
        those, n_done = sharp[3 * start : 3 * (start + _PIXELS)], 0
        requested, places = _empty_queries(max(_QUERIES, 4 * len(patches.flux))), seen.places(some)
        while n_done < len(some):
            n, n_done = query_patches(
                n_done, some, samples.corners, samples.weights, samples.wo, frames, places, offsets[own], patches,
                those, width, LEAST_COSINE, requested,
            )  # fmt: skip
            if n:
                found = evaluate_layers(layers, requested.wi[:n], requested.wo[:n])
                pixel_kernels.add_answers(n, requested, found, radiance[own])

    on_threads(part, range(0, len(which), _PIXELS))


def _empty_queries(n: int) -> pixel_kernels.BrdfQueries:
    """Allocate n peaks at most, for a few samples."""
    return pixel_kernels.BrdfQueries(
        np.empty(n, np.int32), np.empty((n, 3), np.float32), np.empty((n, 3)), np.empty((n, 3))
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class PerturbedSamples:
    """Samples (N,) of one object, and their perturbed frames (N, 3, 3), as `ShadingPoints.frames`."""

    which: Rows
    frames: Float32Array
    wo: Float32Array


def perturb_samples(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> PerturbedSamples:
    """Frames of samples (N,) of an object under its bumps and the map of its tangents, averaged over the pixels."""
    footprints, samples = footprints_of(seen, which, scene, i_object), seen.samples
    frames = np.empty((len(which), 3, 3), np.float32)

    def part(start: int, stop: int) -> None:
        some = which[start:stop]
        wo = samples.wo[some].astype(np.float64)
        triangle, u, v, own = _places(seen, some)
        uv, across, down = (each[start:stop] for each in footprints)
        normals = own
        if i_object in scene.bump_normals.objects:
            lean = scene.bump_normals.normal_offsets(i_object, triangle, u, v, own, wo, (uv, across, down))
            normals = offset_normals(own, lean, wo)
        found = Intersections(
            triangle.astype(np.int32), u.astype(np.float32), v.astype(np.float32), np.zeros(len(some), np.float32)
        )
        tangents = scene.tangent_rotations.tangents(
            np.full(len(some), i_object), normals, found, lambda rows: (uv[rows], across[rows], down[rows])
        )
        frames[start:stop] = sphere_frames(tangents, normals)

    on_threads(part, *even_parts(len(which)))
    return PerturbedSamples(which, frames, np.ascontiguousarray(samples.wo[which]))


def quick_irradiance(seen: ViewSamples, which: Rows, incident: Incident, scene: Scene, i_object: int) -> Float32Array:
    """Irradiance (N, 3) of samples (N,) of an object under its bumps, for moving pictures: by the three moments of
    light that points store."""
    out, normal_offsets = np.empty((len(which), 3), np.float32), quick_normal_offsets(seen, which, scene, i_object)

    def part(start: int, stop: int) -> None:
        pixel_kernels.quick_irradiance(
            start, stop, which, seen.samples.corners, seen.samples.weights, normal_offsets, seen.points.frames,
            incident.slot, incident.stored, out,
        )  # fmt: skip

    on_threads(part, *even_parts(len(which)))
    return out


def quick_normal_offsets(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> Float32Array:
    """Offsets of the normals (N, 3) by bumps, with a rough estimate of a pixel's footprint; cached."""
    key = i_object, scene.description.objects[i_object].bumps
    if key not in seen.normal_offsets:
        normal_offsets, footprints = np.empty((len(which), 3), np.float32), footprints_of(seen, which, scene, i_object)

        def part(start: int, stop: int) -> None:
            some = which[start:stop]
            uv, across, down = (each[start:stop] for each in footprints)
            normal_offsets[start:stop] = scene.bump_normals.normal_offsets(
                i_object, *_places(seen, some), seen.samples.wo[some], (uv, across, down), MOVING_PROBES, is_quick=True
            )

        on_threads(part, *even_parts(len(which)))
        seen.normal_offsets[key] = normal_offsets
    return seen.normal_offsets[key]


def _places(seen: ViewSamples, which: Rows) -> tuple[Rows, Float64Array, Float64Array, Float64Array]:
    """Triangle, u and v of samples (N,) in the scene, and their interpolated normals (N, 3)."""
    n, samples, points = len(which), seen.samples, seen.points
    out = np.empty(n, np.int64), np.empty(n), np.empty(n), np.empty((n, 3))
    sample_kernels.places(
        0, n, which, seen.found[0], samples.corners, seen.shares, points.normal, points.within, points.source, *out
    )
    return out


def perturbed_irradiance(seen: ViewSamples, samples: PerturbedSamples, incident: Incident, sky: SkyMap) -> Float32Array:
    """Irradiance (N, 3) of perturbed surfaces at rest."""
    normals, met = np.ascontiguousarray(samples.frames[:, 1]), seen.samples

    def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Float32Array) -> None:
        pixel_kernels.irradiance(
            start, stop, points, first, members, normals, seen.points.frames, incident.slot, incident.stored,
            _DIFFUSE_LEVEL,
            _directions(_DIFFUSE_LEVEL), out,
        )  # fmt: skip

    found, of_peaks = _by_points(seen, samples, fill), np.empty((len(samples.which), 3), np.float32)

    def add_peaks(start: int, stop: int) -> None:
        pixel_kernels.peak_irradiance(
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
    layers: Sequence[Layer],
    tables: slice_kernels.Tables,
    still: bool,
) -> Float32Array:
    """Radiance (N, 3) that perturbed glossy surfaces send to the camera; tables: the layers' slices."""
    lit = _peak_radiance(seen, samples, incident, sky, tables)
    if not still and _is_highlight(tables):
        directions, apart = (
            mirror_directions(samples.wo, samples.frames[:, 1]),
            peak_lights_of(make_sky(None, 0.0), incident, 0.0),
        )
        relocated = reflect_at_corners(
            seen, samples.which, directions, incident, apart, tables, np.zeros((0, 2), np.uint64), N_MIRRORED
        )
        return lit + relocated * _view_ratio(seen, samples, layers, directions)
    level = _STILL_LEVEL if still else _BROAD_LEVEL

    def fill(start: int, stop: int, points: Rows, first: Rows, members: Rows, out: Float32Array) -> None:
        pixel_kernels.shade_broad(
            start, stop, points, first, members, samples.wo, samples.frames, seen.points.frames, incident.slot,
            incident.stored, level, _directions(level), hemisphere().children, tables, out,
        )  # fmt: skip

    return lit + _by_points(seen, samples, fill)


def _view_ratio(
    seen: ViewSamples, samples: PerturbedSamples, layers: Sequence[Layer], directions: Float32Array
) -> Float32Array:
    """f_o at the perturbed normals over that at the directions (N, 3) in which a highlight is looked up, (N or 1, 3): a
    coat's is 25 times as large at grazing angles. Of one layer alone, for the slices of several are summed."""
    if len(layers) > 1 or not layers[0].has_view_curve:
        return np.ones((1, 3), np.float32)
    cosines = (
        np.einsum("ni,ni->n", samples.wo, samples.frames[:, 1], dtype=np.float64),
        np.einsum("ni,ni->n", directions, seen.normals(samples.which), dtype=np.float64),
    )
    own, looked_up = (layers[0].view_curve(np.arccos(np.clip(each, 0.0, 1.0))) for each in cosines)
    return np.asarray(np.divide(own, looked_up, out=np.ones_like(own), where=looked_up > 1e-6), np.float32)


_Fill = Callable[[int, int, Rows, Rows, Rows, Float32Array], None]


def _by_points(seen: ViewSamples, samples: PerturbedSamples, fill: _Fill) -> Float32Array:
    """Fill values at the samples' corners, point by point, and interpolate them, (N, 3)."""
    requested, first, members = sample_kernels.by_point(samples.which, seen.samples.corners, len(seen.points))
    at_corners = np.empty((3 * len(samples.which), 3), np.float32)
    on_threads(
        lambda start, stop: fill(start, stop, requested, first, members, at_corners), *even_parts(len(requested))
    )
    weights = seen.samples.weights[samples.which]
    return np.asarray(np.einsum("nk,nki->ni", weights, at_corners.reshape(-1, 3, 3)), np.float32)


def _peak_radiance(
    seen: ViewSamples, samples: PerturbedSamples, incident: Incident, sky: SkyMap, tables: slice_kernels.Tables
) -> Float32Array:  # fmt: skip
    out, met = np.zeros((len(samples.which), 3), np.float32), seen.samples

    def part(start: int, stop: int) -> None:
        pixel_kernels.peak_radiance(
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


_of_bytes = lru_cache(maxsize=1)(pixel_kernels.of_bytes)


def _is_highlight(tables: slice_kernels.Tables) -> bool:
    size = len(tables.values) // (tables.n_polar * tables.n_columns) // 3
    upright = slice_kernels.unpacked(tables.values[: 3 * size]).reshape(size, 3).sum(axis=1)
    return bool(upright.max() > _HIGHLIGHT * upright.mean())


def _directions(level: int) -> Float32Array:
    """Directions of a level's triangles, scaled to the length of their mean cosines, (20·4^level, 3)."""
    sphere = geodesic(level)
    moments = triangle_first_moments(sphere.vertices[sphere.triangles]) / sphere.solid_angles[:, None]
    return np.ascontiguousarray(moments, np.float32)
