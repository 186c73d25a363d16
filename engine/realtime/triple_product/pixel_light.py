"""Corrections of direct light that pixels at rest find with rays of their own, because shadows are finer than the
distance between points.

**Peaks.** Occluders in front of a window cast shadows finer than any set of points; interpolated between points, the
shadows look torn. So pixels of pictures at rest trace rays to suns and to each of the few peaks that their points
disagree about, and pixels of stills to all of these, each to several places of the peak, because the width of a peak
blurs its shadow.

**Emitters in the scene.** Light through a slit is narrower than the distance between points. Pixels of pictures at rest
trace rays to the patches that their points disagree about. Pixels of stills first trace some rays to all patches; where
one of these contradicts the points, the pixel tests all patches itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.light.emitters import EmitterPatches
from engine.material.layer import Layer, evaluate_layers
from engine.realtime.core.view_samples import Rows, ViewSamples
from engine.realtime.triple_product import _visibility_kernels as kernels
from engine.realtime.triple_product.incident import N_PLACES, Incident, SceneEmitters, SkyMap
from engine.realtime.triple_product.pixel_reflection import peak_lights_of
from engine.realtime.triple_product.visibility import SHORT
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.scene.shading_frames import LEAST_COSINE

Float32Array = NDArray[np.float32]
_ROWS_AT_ONCE = 65536
_SAMPLES_AT_ONCE = 16384
_N_FEW = 4  # rays to a peak at first
# Share of all peaks' power above which a peak is tested even where points agree: a sun.
_STRONG = 0.1
# Rays of a sample at most: to check the points' visibility, and to replace it, at rest and in stills.
_N_CHECKS, _MOST_RAYS = 16, {"rest": 4, "still": 256}
_NARROW = 0.25  # share of a still's rays that arrive, below which all patches are tested
_LEAST_RAYS = 4  # for each of several samples of a pixel
_RAYS_AT_ONCE = 1 << 20


@dataclass(frozen=True, eq=False)
class PixelLight:
    """Corrections where points are wrong about peaks and emitters' patches. irradiance (R, 3): to be added at each
    sample; sample (N,), direction (N, 3) and power (N, 3): to be added at glossy samples, of either sign."""

    irradiance: Float32Array
    sample: Rows
    direction: Float32Array
    power: Float32Array

    def reflected(self, seen: ViewSamples, scene: Scene, i_object: int, layers: Sequence[Layer]) -> Float32Array:
        """Radiance (N, 3) to be added to an object's samples, reflected by its layers."""
        which = seen.of(i_object)
        found = np.zeros((len(which), 3), np.float32)
        mine = np.flatnonzero(seen.samples.i_object[self.sample] == i_object)
        for start in range(0, len(mine), _ROWS_AT_ONCE):
            some = mine[start : start + _ROWS_AT_ONCE]
            rows, at = np.unique(self.sample[some], return_inverse=True)
            frames = seen.frames(rows, scene, i_object)[at]
            wo = np.einsum("nij,nj->ni", frames, seen.samples.wo[self.sample[some]])
            wo[:, 2] = np.maximum(wo[:, 2], LEAST_COSINE)
            wi = np.einsum("nij,nj->ni", frames, self.direction[some])
            value = evaluate_layers(layers, wi, wo / np.linalg.norm(wo, axis=1, keepdims=True)) * self.power[some]
            place = np.searchsorted(which, self.sample[some])  # an object's samples are in ascending order
            found += np.stack([np.bincount(place, value[:, i], len(which)) for i in range(3)], axis=1)
        return found


@dataclass(frozen=True, eq=False)
class Correction:
    """Some corrections: sample (N,), direction (N, 3) and power (N, 3) of the light; share (N,) of it to be added, of
    either sign, and cosine (N,), the same times the cosine."""

    sample: Rows
    direction: Float32Array
    power: Float32Array
    share: Float32Array
    cosine: Float32Array


def sum_corrections(seen: ViewSamples, parts: Iterable[Correction], has_gloss: NDArray[np.bool_]) -> PixelLight:
    """Sum all parts; has_gloss (R,): samples whose directions are stored."""
    irradiance = np.zeros((len(seen.pixel), 3))
    none = np.zeros((0, 3), np.float32)
    stored = [(np.zeros(0, np.int64), none, none)]
    for part in parts:
        if not len(part.sample):
            continue
        weighed, first = part.cosine[:, None] * part.power, part.sample.min()
        at = part.sample - first
        for i in range(3):
            found = np.bincount(at, weighed[:, i])
            irradiance[first : first + len(found), i] += found
        own = has_gloss[part.sample]
        stored.append((part.sample[own], part.direction[own], part.power[own] * part.share[own, None]))
    sample, direction, power = (np.concatenate(each) for each in zip(*stored, strict=True))
    return PixelLight(irradiance.astype(np.float32), sample, direction, power)


def phases(seen: ViewSamples, samples: Rows) -> NDArray[np.int64]:
    """Assign a number from 0 to 15 to each of some samples (N,), which selects its few rays differently from its
    neighbours'. The sixteen numbers of 4 × 4 pixels, and of an edge's rays, are all different."""
    row, column = np.divmod(seen.pixel[samples], seen.resolution[0])
    of_pixel = _BAYER[row & 3, column & 3]
    return np.asarray(np.where(seen.share[samples] < 1.0, 5 * samples, of_pixel) & 15)


# Ordered dither matrix [Bayer73]: the numbers of neighbours are far apart.
_BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])


def peak_shadows(
    seen: ViewSamples, which: Rows, incident: Incident, sky: SkyMap, caster: RayCaster, everywhere: bool
) -> Iterator[Correction]:
    """Find the corrections for peaks whose visibility samples (N,) do not know from their points, some at a time;
    caster: intersects the scene's triangles; everywhere: also test pixels whose points agree, and add all rays where
    points disagree as well as where a few rays reveal an edge."""
    peaks, n_peaks = peak_lights_of(sky, incident, 0.0), len(sky.peak_places)
    power = sky.peak_power.sum(axis=1)
    strong = sum(1 << int(s) for s in np.flatnonzero(power[:n_peaks] > _STRONG * power.sum()))
    for start in range(0, len(which) if n_peaks else 0, _SAMPLES_AT_ONCE):
        some = which[start : start + _SAMPLES_AT_ONCE]
        row, peak = np.empty((2, len(some) * n_peaks), np.int32)
        share, cosine = np.empty((2, len(row)), np.float32)
        n = kernels.uncertain_peaks(
            some, seen.samples.corners, seen.samples.weights, seen.points.frames, peaks, n_peaks, strong, everywhere,
            row, peak, share, cosine,
        )  # fmt: skip
        row, peak, share, cosine = row[:n], peak[:n], share[:n], cosine[:n]
        is_first = np.diff(row, prepend=-1) > 0  # of a sample's peaks, which are consecutive
        requested, place = some[row[is_first]], np.cumsum(is_first) - 1
        normals = seen.normals(requested)
        above = np.einsum("ni,ni->n", normals[place], sky.peak_direction[peak])
        lifted = caster.offset_origins(seen.places(requested), normals)[place]
        first, free = phases(seen, requested)[place], np.zeros(n, np.float32)
        # One ray tells whether points that agree are right; where they are not, as at an edge, all rays are sent.
        disagree = (share > 1e-3) & (share < 1.0 - 1e-3)
        for mine, n_rays in ((~(disagree | everywhere), 1), (disagree | everywhere, _N_FEW)):
            own = np.flatnonzero(mine & (above > 0.0))
            free[own] = _free_share(caster, lifted[own], sky.peak_places[peak[own]], first[own], n_rays)
        is_edge = (free > 0.0) & (free < 1.0) | ~disagree & (np.abs(free - share) > 0.5) | disagree & everywhere
        edge = np.flatnonzero(is_edge & (above > 0.0))
        free[edge] = _free_share(caster, lifted[edge], sky.peak_places[peak[edge]], first[edge], N_PLACES)
        share, cosine = free - share, free * above - cosine
        wrong = np.flatnonzero(np.abs(share) > 1e-3)
        of = peak[wrong]
        yield Correction(some[row[wrong]], sky.peak_direction[of], sky.peak_power[of], share[wrong], cosine[wrong])


def _free_share(
    caster: RayCaster, origins: Float32Array, places: Float32Array, first: NDArray[np.int64], n: int
) -> NDArray[np.floating]:  # fmt: skip
    """Share (R,) of n of the peak's places (R, 16, 3), from `first` (R,) on, that origins (R, 3) see."""
    chosen = (first[:, None] + np.arange(n) * (N_PLACES // n)) % N_PLACES
    directions = np.take_along_axis(places, chosen[..., None], axis=1).reshape(-1, 3)
    return 1.0 - caster.occluded(np.repeat(origins, n, axis=0), directions).reshape(-1, n).mean(axis=1)


@dataclass(frozen=True, eq=False)
class _RaySamples:
    """Samples (N,) that trace rays: corners and weights (N, 3); places, normals and ray origins lifted (N, 3); phase
    (N,)."""

    corners: NDArray[np.int32]
    weights: Float32Array
    places: Float32Array
    normals: Float32Array
    lifted: Float32Array
    phase: NDArray[np.int64]

    def trace(
        self, how: NDArray[np.uint8], most: NDArray[np.int64], known: kernels.PointVisibility, patches: EmitterPatches,
        caster: RayCaster,
    ) -> tuple[kernels.PatchRays, NDArray[np.bool_]]:  # fmt: skip
        """Trace at most `most` (N,) rays a sample to the patches that `how` (N,) selects; return the rays and which of
        them arrive."""
        around = self.corners, self.weights, self.places, self.normals
        requested = _room(int(most.sum()))
        n = kernels.patches_in_question(*around, how, self.phase, most, known, requested)
        rows: list[Any] = [each[:n] for each in requested]
        requested = kernels.PatchRays(*rows)
        free = requested.cosine > 0.0
        sent = np.flatnonzero(free)
        origins = self.lifted[requested.row[sent]]
        directions = patches.samples[requested.patch[sent]] - origins
        free[sent] = ~caster.occluded(origins, directions, np.full(len(sent), 1.0 - SHORT, np.float32))
        return requested, free


def emitter_shadows(
    seen: ViewSamples, which: Rows, emitters: SceneEmitters, caster: RayCaster, quality: str
) -> Iterator[Correction]:
    """Find the corrections for patches whose visibility samples (N,) do not know from their points, some at a time;
    caster: intersects the scene's triangles; quality: "rest" or "still"."""
    patches, points, step = emitters.patches, seen.points, max(_RAYS_AT_ONCE // _MOST_RAYS[quality], 1)
    known = kernels.PointVisibility(
        points.position, points.normal, emitters.bits, patches.centre, patches.normal, patches.cones
    )
    if quality == "rest":
        which = which[_points_disagree(seen, which, emitters)]
    for start in range(0, len(which), step):
        some = which[start : start + step]
        normals, places = seen.normals(some), seen.places(some)
        lifted = caster.offset_origins(places, normals)
        own = seen.samples.corners[some], seen.samples.weights[some], places, normals, lifted
        tested, how = _RaySamples(*own, phases(seen, some)), np.full(len(some), kernels.ONLY_THOSE, np.uint8)
        most = np.maximum(_MOST_RAYS[quality] * seen.share[some], _LEAST_RAYS).astype(np.int64)
        if quality == "still":
            how[:] = kernels.EVERYTHING
            requested, free = tested.trace(how, np.minimum(most, _N_CHECKS), known, patches, caster)
            how[:] = kernels.WHERE_ANY
            how[requested.row[requested.agreed & (free != (requested.known > 0.5))]] = kernels.EVERYTHING
        requested, free = tested.trace(how, most, known, patches, caster)
        if quality == "still":
            n_free, n_requested = (np.bincount(requested.row, weights, len(some)) for weights in (free, None))
            narrow = (n_free > 0) & (n_free < _NARROW * n_requested) & (seen.share[some] == 1.0)
            whole, free_too = tested.trace(how, np.where(narrow, len(patches), 0), known, patches, caster)
            stored = ~narrow[requested.row]
            joined: list[Any] = [np.concatenate([a[stored], b]) for a, b in zip(requested, whole, strict=True)]
            requested, free = kernels.PatchRays(*joined), np.concatenate([free[stored], free_too])
        share = free - requested.known
        wrong = np.flatnonzero(np.abs(share) > 1e-3)
        row, patch = requested.row[wrong], requested.patch[wrong]
        directions = patches.centre[patch] - places[row]
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        power = patches.radiance[patch] * (patches.area[patch] * requested.solid[wrong])[:, None]
        cosine = free[wrong] * requested.cosine[wrong] - requested.known_cosine[wrong]
        yield Correction(some[row], directions, power, share[wrong], cosine)


def _points_disagree(seen: ViewSamples, which: Rows, emitters: SceneEmitters) -> NDArray[np.bool_]:
    """Whether the points around samples (N,) see different patches."""
    found = np.empty(len(which), bool)

    def part(start: int, stop: int) -> None:
        kernels.patches_disagree(start, stop, which, seen.samples.corners, emitters.bits, found)

    on_threads(part, *even_parts(len(which)))
    return found


def _room(n: int) -> kernels.PatchRays:
    """Allocate n rays."""
    whole, real = np.empty((2, n), np.int32), np.empty((4, n), np.float32)
    return kernels.PatchRays(whole[0], whole[1], real[0], real[1], real[2], real[3], np.empty(n, bool))
