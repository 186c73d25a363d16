"""Glossy reflection towards the camera, at shading points and at pixels.

In moving pictures, the visible points are shaded and their colours are interpolated. At rest, and where gloss is
sharper than the points' spacing, every pixel interpolates functions, not colours [Ma06, 3.3]: it reflects the light of
its three points in its own direction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.material.layer import Layer, evaluate_layers
from engine.realtime.triple_product import _corner_kernels as corner_kernels
from engine.realtime.triple_product import _peak_kernels as sun_kernels
from engine.realtime.triple_product import _picture_kernels as picture_kernels
from engine.realtime.triple_product import _slice_kernels as kernels
from engine.realtime.triple_product.incident import Incident, hemisphere
from engine.realtime.triple_product.sky_map import SkyMap
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.scene.primary_hits import LEAST_COSINE

Float32Array = NDArray[np.float32]
_PIXELS = 1024  # at a time
MOST_COEFFICIENTS = 5120


def empty_shades(incident: Incident) -> kernels.Shades:
    """Allocate a cache of what glossy points send to the camera."""
    n = len(incident.stored.number)
    return kernels.Shades(np.full(n, -1, np.int64), np.empty((n, 4, 4), np.float32))


def shade_points(
    seen: ViewSamples, points: NDArray[np.int64], incident: Incident, tables: kernels.Tables, n: int,
    shades: kernels.Shades, colours: Float32Array,
) -> None:  # fmt: skip
    """Add to colours (S, 3) of points (N,) what they send to the camera, by n coefficients and by peaks. shades: a
    cache, which must be invalidated where light changes."""
    at, frames = seen.points.position, seen.points.frames

    def part(start: int, stop: int) -> None:
        kernels.shade_points(
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


def reflect_at_rest(
    seen: ViewSamples, which: Rows, incident: Incident, sky: SkyMap, layers: Sequence[Layer], tables: kernels.Tables,
    little: float,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) that samples (N,) of one object reflect to the camera at rest.

    tables: the layers' slices. They reflect peaks about which neighbouring slices disagree by less than `little` of all
    reflected light. The layers' formulas reflect the other peaks, each in its own direction: highlights are thus as
    sharp as the layers, where slices resolve a triangle's 2.8 degrees. A pixel sees of a peak what its points see.
    """
    peaks = peak_lights_of(sky, incident, little)
    sharp = np.zeros((3 * len(which) if len(peaks.power) else 0, 2), np.uint64)
    directions = mirror_directions(seen.samples.wo[which], seen.normals(which))
    radiance = reflect_at_corners(seen, which, directions, incident, peaks, tables, sharp)
    if len(sharp):
        _add_sharp(seen, which, peaks, sharp, layers, radiance)
    return radiance


def reflect_moving(
    seen: ViewSamples, which: Rows, incident: Incident, sky: SkyMap, tables: kernels.Tables, n: int
) -> Float32Array:
    """The same for moving pictures: by n coefficients, and all peaks by slices."""
    directions, no_bits = mirror_directions(seen.samples.wo[which], seen.normals(which)), np.zeros((0, 2), np.uint64)
    return reflect_at_corners(
        seen, which, directions, incident, peak_lights_of(sky, incident, np.inf), tables, no_bits, n
    )


def peak_lights_of(sky: SkyMap, incident: Incident, little: float) -> corner_kernels.PeakLights:
    """A sky's peaks as points see them."""
    return corner_kernels.PeakLights(
        sky.peak_direction, sky.peak_power, incident.stored.peak_bits, hemisphere().children, little
    )  # fmt: skip


def mirror_directions(wo: Float32Array, normals: Float32Array) -> Float32Array:
    """Mirror directions of wo (N, 3) at surfaces with normals (N, 3)."""
    along = np.einsum("ni,ni->n", normals, wo)
    return np.asarray(2.0 * along[:, None] * normals - wo, np.float32)


def reflect_at_corners(
    seen: ViewSamples, which: Rows, directions: Float32Array, incident: Incident, peaks: corner_kernels.PeakLights,
    tables: kernels.Tables,
    sharp: NDArray[np.uint64], n_most: int = MOST_COEFFICIENTS,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) that samples (N,) with these mirror directions (N, 3) send, interpolated between the points
    around them; see `shade_corners`.

    Each point is evaluated in the outgoing direction that has the same mirror direction there. So a highlight keeps its
    position even where normals turn between points by more than its width; everything else changes only by the square
    of that angle.
    """
    samples = seen.samples
    requested, first, members = picture_kernels.by_point(which, samples.corners, len(seen.points))
    found = np.empty((3 * len(which), 3), np.float32)

    def part(start: int, stop: int) -> None:
        corner_kernels.shade_corners(
            start, stop, requested, first, members, directions, n_most, seen.points.frames, incident.slot,
            incident.stored,
            peaks,
            tables, found, sharp,
        )  # fmt: skip

    on_threads(part, *even_parts(len(requested)))
    return np.asarray(np.einsum("nk,nki->ni", samples.weights[which], found.reshape(-1, 3, 3)), np.float32)


def _add_sharp(
    seen: ViewSamples, which: Rows, peaks: corner_kernels.PeakLights, sharp: NDArray[np.uint64],
    layers: Sequence[Layer],
    radiance: Float32Array,
) -> None:  # fmt: skip
    """Add the layers' reflection of sharp peaks to radiance (N, 3)."""
    samples, frames = seen.samples, seen.points.frames

    def part(start: int) -> None:
        some, bits = which[start : start + _PIXELS], sharp[3 * start : 3 * (start + _PIXELS)]
        requested = _room(len(some) * len(peaks.power))
        n = sun_kernels.query_peaks(
            some, samples.corners, samples.weights, samples.wo, frames, peaks, bits, LEAST_COSINE, requested
        )
        if n:
            found = evaluate_layers(layers, requested.wi[:n], requested.wo[:n])
            sun_kernels.add_answers(n, requested, found, radiance[start : start + _PIXELS])

    on_threads(part, range(0, len(which), _PIXELS))


def _room(n: int) -> sun_kernels.BrdfQueries:
    """Allocate n peaks at most, for a few samples."""
    return sun_kernels.BrdfQueries(
        np.empty(n, np.int32), np.empty((n, 3), np.float32), np.empty((n, 3)), np.empty((n, 3))
    )  # fmt: skip
