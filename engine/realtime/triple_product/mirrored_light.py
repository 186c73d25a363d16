"""Glossy reflection of other surfaces: rooms in a mirror ball, shelves in a varnished floor.

The coefficients of light hold emitters and sky, not surfaces that these light. So pixels at rest trace a few rays,
importance-sampled by their layers, to other shading points, and add the radiance of these. In moving pictures, a glossy
surface reflects that light as a diffuse one of its equivalent albedo does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.material.layer import Layer
from engine.realtime.triple_product.lit_points import LitPoints
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.reference.path_lobes import N_NUMBERS, Scattering
from engine.scene.primary_hits import LEAST_COSINE
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
N_RAYS = {"rest": 4, "still": 32}
_AT_ONCE = 65536  # rays
_BRIGHTEST = 1e4  # limit of a ray's contribution, relative to the radiance of the surface that it meets


def mirrored_light(
    seen: ViewSamples, which: Rows, lit: LitPoints, scene: Scene, i_object: int, layers: Sequence[Layer], quality: str,
    normals: Float32Array | None = None,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) from other surfaces that an object's layers reflect to the camera at samples (N,).

    normals (N, 3): perturbed by bumps; None for those interpolated between points.
    """
    found, n_rays = np.zeros((len(which), 3), np.float32), N_RAYS[quality]
    scattering, step = Scattering(layers), max(_AT_ONCE // n_rays, 1)
    chance = np.random.default_rng(4)
    pattern, shifts = chance.random((n_rays, N_NUMBERS)), chance.random((len(which), N_NUMBERS))
    late = lit.late
    pattern[:, 0] = (np.arange(n_rays) + pattern[:, 0]) / n_rays  # the lobes in turn

    def part(start: int) -> None:
        some = which[start : start + step]
        between = seen.normals(some)
        frames = seen.frames(some, scene, i_object, None if normals is None else normals[start : start + step])
        frames, towards = np.repeat(frames, n_rays, axis=0), np.repeat(seen.samples.wo[some], n_rays, axis=0)
        wo = np.einsum("nij,nj->ni", frames, towards)
        wo[:, 2] = np.maximum(wo[:, 2], LEAST_COSINE)
        wo /= np.linalg.norm(wo, axis=1, keepdims=True)
        numbers = ((pattern + shifts[start : start + step, None]) % 1.0).reshape(-1, N_NUMBERS)
        wi = scattering.sample(numbers, wo)
        value, pdf = scattering.evaluate(wi, wo)
        ways = np.einsum("nij,ni->nj", frames, wi).astype(np.float32)
        above = np.einsum("ni,ni->n", ways, np.repeat(between, n_rays, axis=0)) > 0.0
        rays = np.flatnonzero((pdf > 0.0) & above)
        lifted = np.repeat(lit.caster.offset_origins(seen.places(some), between), n_rays, axis=0)
        met, _ = lit.mesh.trace(lifted[rays], ways[rays])
        of_back, own = late[met.corners[:, 0]], np.repeat(late[seen.samples.corners[some, 0]], n_rays)[rays]
        hit = (met.corners[:, 0] >= 0) & ((of_back < 0) | (of_back == own))
        sent = np.einsum("nk,nki->ni", met.weights[hit], lit.sent_on[met.corners[hit]])
        weight = np.minimum(value[rays[hit]] / pdf[rays[hit], None], _BRIGHTEST)
        for i in range(3):
            total = np.bincount(rays[hit] // n_rays, weight[:, i] * sent[:, i], len(some))
            found[start : start + step, i] = total / n_rays

    on_threads(part, range(0, len(which), step))
    return found
