"""Shadows of the brightest peaks, pixel by pixel, because they are sharper than the distance between points.

Occluders in front of a window cast shadows finer than any set of points; interpolated between points, the shadows look
torn. So pixels of pictures at rest trace rays to each of the few peaks that their points disagree about, and pixels of
stills to all of these, each to several places of the peak, because the width of a peak blurs its shadow.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from engine.realtime.triple_product import _peak_kernels as kernels
from engine.realtime.triple_product.incident import Incident
from engine.realtime.triple_product.pixel_light import Wrong, phases
from engine.realtime.triple_product.point_reflection import peak_lights_of
from engine.realtime.triple_product.sky_map import N_PLACES, SkyMap
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.scene.raycaster import RayCaster

Float32Array = NDArray[np.float32]
_AT_ONCE = 16384  # samples
_AT_REST, _FEW = 2, 4  # rays to a peak; the latter in stills at first


def peak_shadows(
    seen: ViewSamples, which: Rows, incident: Incident, sky: SkyMap, caster: RayCaster, everywhere: bool
) -> Iterator[Wrong]:
    """Find the corrections for peaks whose visibility samples (N,) do not know from their points, some at a time;
    caster: intersects the scene's triangles; everywhere: also test pixels whose points agree, and add all rays where a
    few reveal an edge."""
    peaks, n_peaks = peak_lights_of(sky, incident, 0.0), len(sky.sun_places)
    for start in range(0, len(which) if n_peaks else 0, _AT_ONCE):
        some = which[start : start + _AT_ONCE]
        row, peak = np.empty((2, len(some) * n_peaks), np.int32)
        share, cosine = np.empty((2, len(row)), np.float32)
        n = kernels.uncertain_peaks(
            some, seen.samples.corners, seen.samples.weights, seen.points.frames, peaks, n_peaks, everywhere,
            row, peak, share, cosine,
        )  # fmt: skip
        row, peak, share, cosine = row[:n], peak[:n], share[:n], cosine[:n]
        is_first = np.diff(row, prepend=-1) > 0  # of a sample's peaks, which are consecutive
        requested, place = some[row[is_first]], np.cumsum(is_first) - 1
        normals = seen.normals(requested)
        above = np.einsum("ni,ni->n", normals[place], sky.peak_direction[peak])
        lifted = caster.offset_origins(seen.places(requested), normals)[place]
        first, free, lit = phases(seen, requested)[place], np.zeros(n, np.float32), np.flatnonzero(above > 0.0)
        few = _FEW if everywhere else _AT_REST
        free[lit] = _free(caster, lifted[lit], sky.sun_places[peak[lit]], first[lit], few)
        if everywhere:
            is_edge = (free > 0.0) & (free < 1.0) | (share > 1e-3) & (share < 1.0 - 1e-3)
            edge = np.flatnonzero(is_edge & (above > 0.0))
            free[edge] = _free(caster, lifted[edge], sky.sun_places[peak[edge]], first[edge], N_PLACES)
        share, cosine = free - share, free * above - cosine
        wrong = np.flatnonzero(np.abs(share) > 1e-3)
        own = peak[wrong]
        yield Wrong(some[row[wrong]], sky.peak_direction[own], sky.peak_power[own], share[wrong], cosine[wrong])


def _free(
    caster: RayCaster, origins: Float32Array, places: Float32Array, first: NDArray[np.int64], n: int
) -> NDArray[np.floating]:  # fmt: skip
    """Share (R,) of n of the peak's places (R, 16, 3), from `first` (R,) on, that origins (R, 3) see."""
    chosen = (first[:, None] + np.arange(n) * (N_PLACES // n)) % N_PLACES
    ways = np.take_along_axis(places, chosen[..., None], axis=1).reshape(-1, 3)
    return 1.0 - caster.occluded(np.repeat(origins, n, axis=0), ways).reshape(-1, n).mean(axis=1)
