"""Shadows of the brightest suns, pixel by pixel: between points that are further apart than they are sharp.

What stands before a window throws shadows finer than any points; interpolated between those they are torn. So pixels of
a picture at rest send a ray to each of the few suns that its points do not agree on, and stills to all of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.orbit import _sun_kernels as kernels
from engine.orbit._incident_kernels import N_ASKED
from engine.orbit.incident import Incident
from engine.orbit.picture import Rows, Seen
from engine.orbit.reflected import suns_of
from engine.orbit.sky import Sky
from engine.render.integrator import evaluate_layers
from engine.scene.hits import LEAST_COSINE
from engine.scene.load import Scene
from engine.scene.raycaster import RayCaster

Floats = NDArray[np.float32]
_AT_ONCE = 16384  # samples


@dataclass(frozen=True, eq=False)
class SunShadows:
    """Where points are wrong about suns: the sample (N,), direction and power (N, 3) of the sun, and what is to be
    added: the share (N,) of the sun, of either sign, and that times its cosine (N,)."""

    sample: Rows
    direction: Floats
    power: Floats
    share: Floats
    cosine: Floats

    def irradiance(self, n_samples: int) -> Floats:
        """What is to be added at each sample of a picture (R, 3)."""
        weighed = self.cosine[:, None] * self.power
        return np.stack([np.bincount(self.sample, weighed[:, i], n_samples) for i in range(3)], axis=1)

    def reflected(self, seen: Seen, scene: Scene, i_object: int, layers: Sequence[Layer]) -> Floats:
        """What is to be added of an object's layers to the radiance of its samples (N,), (N, 3)."""
        which = seen.of(i_object)
        mine = np.flatnonzero(seen.samples.i_object[self.sample] == i_object)
        rows, at = np.unique(self.sample[mine], return_inverse=True)
        frames = seen.frames(rows, scene, i_object)[at]
        wo = np.einsum("nij,nj->ni", frames, seen.samples.wo[self.sample[mine]])
        wo[:, 2] = np.maximum(wo[:, 2], LEAST_COSINE)
        wi = np.einsum("nij,nj->ni", frames, self.direction[mine])
        value = evaluate_layers(layers, wi, wo / np.linalg.norm(wo, axis=1, keepdims=True))
        found = (value * self.power[mine] * self.share[mine, None]).astype(np.float32)
        place = np.searchsorted(which, self.sample[mine])  # an object's samples stand in their order
        return np.stack([np.bincount(place, found[:, i], len(which)) for i in range(3)], axis=1)


def sun_shadows(
    seen: Seen, which: Rows, incident: Incident, sky: Sky, caster: RayCaster, everywhere: bool
) -> SunShadows:
    """What samples (N,) see of suns that their points do not know; caster: of the scene's triangles; everywhere:
    whether pixels whose points agree are asked as well."""
    suns, n_suns, parts = suns_of(sky, incident, 0.0), min(len(sky.sun_power), N_ASKED), []
    for start in range(0, len(which) if n_suns else 0, _AT_ONCE):
        some = which[start : start + _AT_ONCE]
        normals = seen.normals(some)
        row, sun = np.empty((2, len(some) * n_suns), np.int32)
        share, cosine = np.empty((2, len(row)), np.float32)
        n = kernels.suns_in_question(
            some, seen.samples.corners, seen.samples.weights, normals, seen.points.frames, suns, n_suns, everywhere,
            row, sun, share, cosine,
        )  # fmt: skip
        row, sun, share, cosine = row[:n], sun[:n], share[:n], cosine[:n]
        above = np.einsum("ni,ni->n", normals[row], sky.sun_direction[sun])
        lifted = caster.offset_origins(seen.places(some), normals)
        free = (above > 0.0) & ~caster.occluded(lifted[row], sky.sun_direction[sun])
        share, cosine = free - share, np.where(free, above, 0.0) - cosine
        wrong = np.flatnonzero(np.abs(share) > 1e-3)
        parts.append((some[row[wrong]], sun[wrong], share[wrong], cosine[wrong]))
    none = np.zeros(0, np.int64)
    sample, sun, share, cosine = (np.concatenate(each) for each in zip((none, none, none, none), *parts, strict=True))
    return SunShadows(sample, sky.sun_direction[sun], sky.sun_power[sun], share, cosine)
