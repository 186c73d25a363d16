"""Shadows of the brightest suns, pixel by pixel: between points that are further apart than they are sharp.

What stands before a window throws shadows finer than any points; interpolated between those they are torn. So pixels of
a picture at rest send rays to each of the few suns that its points do not agree on, and stills to all of these: to
several places of each, as a shadow is as blurred as its sun is wide.
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
_AT_REST, _FEW = 2, 4  # rays to a sun, the latter in stills at first


def peak_shadows(
    seen: ViewSamples, which: Rows, incident: Incident, sky: SkyMap, caster: RayCaster, everywhere: bool
) -> Iterator[Wrong]:
    """What samples (N,) see of suns that their points do not know, some at a time; caster: of the scene's triangles;
    everywhere: whether pixels whose points agree are asked as well, and by all rays where few of them tell an edge."""
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
        is_first = np.diff(row, prepend=-1) > 0  # of the suns of a sample, which stand together
        asked, place = some[row[is_first]], np.cumsum(is_first) - 1
        normals = seen.normals(asked)
        above = np.einsum("ni,ni->n", normals[place], sky.peak_direction[peak])
        lifted = caster.offset_origins(seen.places(asked), normals)[place]
        first, free, lit = phases(seen, asked)[place], np.zeros(n, np.float32), np.flatnonzero(above > 0.0)
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
    """Which share (R,) of n of the places (R, 16, 3) of suns is seen from origins (R, 3), from `first` (R,) on."""
    chosen = (first[:, None] + np.arange(n) * (N_PLACES // n)) % N_PLACES
    ways = np.take_along_axis(places, chosen[..., None], axis=1).reshape(-1, 3)
    return 1.0 - caster.occluded(np.repeat(origins, n, axis=0), ways).reshape(-1, n).mean(axis=1)
