"""Shadows of emitters in the scene, pixel by pixel: light through a slit is narrower than the distance between points.

Pixels of pictures at rest trace rays to the patches that their points disagree about. Pixels of stills first trace some
rays to all patches; where one of these contradicts the points, the pixel tests all patches itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.light.emitters import EmitterPatches
from engine.realtime.triple_product import _lamp_kernels as kernels
from engine.realtime.triple_product.incident import SceneEmitters
from engine.realtime.triple_product.pixel_light import Wrong, phases
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.realtime.triple_product.visibility import SHORT
from engine.scene.raycaster import RayCaster

Floats = NDArray[np.float32]
# Rays of a sample at most: to check the points' visibility, and to replace it, at rest and in stills.
_LOOKING, _MOST = 16, {"rest": 4, "still": 256}
_NARROW = 0.25  # share of a still's rays that arrive, below which all patches are tested
_LEAST = 4  # for each of several samples of a pixel
_AT_ONCE = 1 << 20  # rays


@dataclass(frozen=True, eq=False)
class _Asking:
    """Samples (N,) that trace rays: corners and weights (N, 3); places, normals and ray origins lifted (N, 3); phase
    (N,)."""

    corners: NDArray[np.int32]
    weights: Floats
    places: Floats
    normals: Floats
    lifted: Floats
    phase: NDArray[np.int64]

    def ask(
        self, how: NDArray[np.uint8], most: NDArray[np.int64], known: kernels.Known, patches: EmitterPatches,
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
        ways = patches.samples[requested.patch[sent]] - origins
        free[sent] = ~caster.occluded(origins, ways, np.full(len(sent), 1.0 - SHORT, np.float32))
        return requested, free


def lamp_shadows(
    seen: ViewSamples, which: Rows, lamps: SceneEmitters, caster: RayCaster, quality: str
) -> Iterator[Wrong]:
    """Find the corrections for patches whose visibility samples (N,) do not know from their points, some at a time;
    caster: intersects the scene's triangles; quality: "rest" or "still"."""
    patches, points, step = lamps.patches, seen.points, max(_AT_ONCE // _MOST[quality], 1)
    known = kernels.Known(points.position, points.normal, lamps.bits, patches.centre, patches.normal)
    if quality == "rest":
        which = which[_disagree(seen, which, lamps)]
    for start in range(0, len(which), step):
        some = which[start : start + step]
        normals, places = seen.normals(some), seen.places(some)
        lifted = caster.offset_origins(places, normals)
        own = seen.samples.corners[some], seen.samples.weights[some], places, normals, lifted
        asking, how = _Asking(*own, phases(seen, some)), np.full(len(some), kernels.ONLY_THOSE, np.uint8)
        most = np.maximum(_MOST[quality] * seen.share[some], _LEAST).astype(np.int64)
        if quality == "still":
            how[:] = kernels.EVERYTHING
            requested, free = asking.ask(how, np.minimum(most, _LOOKING), known, patches, caster)
            how[:] = kernels.WHERE_ANY
            how[requested.row[requested.agreed & (free != (requested.known > 0.5))]] = kernels.EVERYTHING
        requested, free = asking.ask(how, most, known, patches, caster)
        if quality == "still":
            n_free, n_requested = (np.bincount(requested.row, weights, len(some)) for weights in (free, None))
            narrow = (n_free > 0) & (n_free < _NARROW * n_requested) & (seen.share[some] == 1.0)
            whole, free_too = asking.ask(how, np.where(narrow, len(patches), 0), known, patches, caster)
            stored = ~narrow[requested.row]
            joined: list[Any] = [np.concatenate([a[stored], b]) for a, b in zip(requested, whole, strict=True)]
            requested, free = kernels.PatchRays(*joined), np.concatenate([free[stored], free_too])
        share = free - requested.known
        wrong = np.flatnonzero(np.abs(share) > 1e-3)
        row, patch = requested.row[wrong], requested.patch[wrong]
        ways = patches.centre[patch] - places[row]
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        power = patches.radiance[patch] * (patches.area[patch] * requested.solid[wrong])[:, None]
        cosine = free[wrong] * requested.cosine[wrong] - requested.known_cosine[wrong]
        yield Wrong(some[row], ways, power, share[wrong], cosine)


def _disagree(seen: ViewSamples, which: Rows, lamps: SceneEmitters) -> NDArray[np.bool_]:
    """Whether the points around samples (N,) see different patches."""
    found = np.empty(len(which), bool)

    def part(start: int, stop: int) -> None:
        kernels.disagree(start, stop, which, seen.samples.corners, lamps.bits, found)

    on_threads(part, *even_parts(len(which)))
    return found


def _room(n: int) -> kernels.PatchRays:
    """Allocate n rays."""
    whole, real = np.empty((2, n), np.int32), np.empty((4, n), np.float32)
    return kernels.PatchRays(whole[0], whole[1], real[0], real[1], real[2], real[3], np.empty(n, bool))
