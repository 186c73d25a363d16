"""Highlights of lamps on glossy points, for pictures at rest: the layer's own BRDF towards the parts of each lamp.

Six bands blur a lamp to a lobe of some 33 degrees, whose peak on a layer of alpha 0.3 is a tenth of what it should be.
At rest there is time for the BRDF itself:

    L_o = V Σ_s f(ω_s, ω_o) max(n · ω_s, 0) Ω_s L_s

over a lamp's parts s, of solid angles Ω_s at the point. V is the share of the lamp's light that arrives at a white
Lambertian point there, which diffuse shading knows already. Rays of their own for gloss were rejected: they would tell
apart which part of a lamp is hidden, at the cost of all diffuse shadows once more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.material.layer import Layer, evaluate_layer
from engine.realtime.zonal_harmonics.neighbours import towards_lamp
from engine.realtime.zonal_harmonics.posed_shadows import Lamp

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_NARROW = 1e-4  # 1 - length of the mean direction: a lamp of 0.8 degrees RMS radius
_LEAST_COSINE = 0.01  # of wo: with normals that diverge, a triangle may still face the camera


def add_lamp_gloss(
    layer: Layer, factor: NDArray[np.floating], lamp: Lamp, arrives: NDArray[np.floating], which: NDArray[np.int64],
    frames: Float32Array, places: Float32Array, camera_position: Float64Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points which (P,), out of all, send of a lamp's light to the camera (3,), times factor
    (3,).

    arrives (S, 3): radiance of white Lambertian points by the lamp, with all shadows; frames (S, 3, 3): tangent,
    bitangent and normal; places (V, 3), of the points first.
    """
    lit = which[arrives[which].any(axis=1)]

    def part(start: int, stop: int) -> None:
        some = lit[start:stop]
        at, axes = places[some].astype(np.float64), frames[some].astype(np.float64)
        wo = np.einsum("pai,pi->pa", axes, camera_position - at)
        wo /= np.maximum(np.linalg.norm(wo, axis=1, keepdims=True), 1e-30)
        wo[:, 2] = np.maximum(wo[:, 2], _LEAST_COSINE)
        wo /= np.linalg.norm(wo, axis=1, keepdims=True)
        reflected, unblocked = _reflected(layer, lamp, at, axes, wo)
        visible = arrives[some].sum(axis=1) / np.maximum(unblocked.sum(axis=1), 1e-30)
        sent[some] += (np.clip(visible, 0.0, 1.0)[:, None] * reflected * factor).astype(np.float32)

    on_threads(part, *even_parts(len(lit)))


def _reflected(
    layer: Layer, lamp: Lamp, places: Float64Array, frames: Float64Array, wo: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Radiance (P, 3) that points send along wo (P, 3), in their own axes, of a lamp's light without shadows; and that
    of white Lambertian points."""
    seen = [(*towards_lamp(places, sample), sample.tint * lamp.emission) for sample in lamp.samples]
    mean, power, angle = np.zeros_like(places), np.zeros_like(places), np.zeros(len(places))
    unblocked = np.zeros_like(places)
    for towards, solid_angle, radiance in seen:
        mean += solid_angle[:, None] * towards
        angle += solid_angle
        power += solid_angle[:, None] * radiance
        cosine = np.maximum(np.einsum("pc,pc->p", towards, frames[:, 2]), 0.0)
        unblocked += (solid_angle * cosine / np.pi)[:, None] * radiance
    length = np.linalg.norm(mean, axis=1)
    # A narrow lamp is one direction; of a wide one each part is.
    narrow = length > (1.0 - _NARROW) * angle
    mean /= np.maximum(length, 1e-30)[:, None]
    reflected = np.zeros_like(places)
    reflected[narrow] = power[narrow] * _evaluate(layer, mean[narrow], frames[narrow], wo[narrow])
    wide = np.flatnonzero(~narrow)
    for towards, solid_angle, radiance in seen if len(wide) else ():
        shares = solid_angle[wide, None] * radiance
        reflected[wide] += shares * _evaluate(layer, towards[wide], frames[wide], wo[wide])
    return reflected, unblocked


def _evaluate(layer: Layer, towards: Float64Array, frames: Float64Array, wo: Float64Array) -> Float64Array:
    """f cos θ_i (P, 3) for directions to the light (P, 3) in the world, 0 below the horizon."""
    wi = np.einsum("pai,pi->pa", frames, towards)
    found = np.zeros_like(wi)
    above = wi[:, 2] > 0.0
    found[above] = evaluate_layer(layer, wi[above], wo[above])
    return found
