"""Highlights of lamps on glossy points: the layer's own BRDF towards the parts of each lamp.

Six bands blur a lamp to a lobe of some 33 degrees, whose peak on a layer of alpha 0.3 is a tenth of what it should be.
A lamp is a few directions, so there is time for the BRDF itself:

    L_o = V Σ_s f(ω_s, ω_o) max(n · ω_s, 0) Ω_s L_s

over a lamp's parts s, of solid angles Ω_s at the point. V is the share of the lamp's light that arrives at a white
Lambertian point there, which diffuse shading knows already: at rest by rays in the pose; in motion by rays of the rest
pose where an object rests, and by the object's own transfer where it bends. Rays of their own for gloss were rejected:
they would tell apart which part of a lamp is hidden, at the cost of all diffuse shadows once more.

The window's shaders get this sum point by point with the pose, for a BRDF may be of any model, edited and measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.material.layer import Layer, evaluate_layer
from engine.realtime.zonal_harmonics import _lamp_gloss_kernels as kernels
from engine.realtime.zonal_harmonics.scene_lamps import Lamp, LampSample, towards_lamp
from engine.realtime.zonal_harmonics.shading import BandLight, Lobes, even_light, shade, shade_some, unshadowed_points

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_NARROW = 1e-4  # 1 - length of the mean direction: a lamp of 0.8 degrees RMS radius
_LEAST_COSINE = 0.01  # of wo: with normals that diverge, a triangle may still face the camera


class LampLight(NamedTuple):
    """A lamp's light as it comes to an object, as if from afar: in bands, and the share of it that neighbours leave."""

    bands: BandLight
    share: float


class LampView(NamedTuple):
    """A lamp as seen from points: mean directions (P, 3), shorter than 1 by how wide it is; power (P, 3), the sum of Ω
    L; unblocked (P, 3): radiance of white Lambertian points without any shadow."""

    mean: Float64Array
    power: Float64Array
    unblocked: Float64Array


def view_lamp(lamp: Lamp, which: Indices, places: Float32Array, normals: Float32Array) -> LampView:
    """A lamp as seen from points which (P,) out of all, at places (V, 3) with normals (S, 3)."""
    mean, power, unblocked = np.empty((3, len(which), 3))
    on_threads(
        lambda start, stop: kernels.sum_parts(start, stop, which, places, normals, lamp.rows, mean, power, unblocked),
        *even_parts(len(which)),
    )
    return LampView(mean, power * lamp.emission, unblocked * lamp.emission)


def share_by_rays(
    lamp: Lamp, arrives: NDArray[np.floating], places: Float32Array, normals: Float32Array
) -> Float32Array:
    """The share (S,) of a lamp's light that arrives at points, of which white ones get the radiance arrives (S, 3)."""
    share, lit = np.zeros(len(arrives), np.float32), np.flatnonzero(arrives.any(axis=1))
    unblocked = view_lamp(lamp, lit, places, normals).unblocked
    share[lit] = np.clip(arrives[lit].sum(axis=1) / np.maximum(unblocked.sum(axis=1), 1e-30), 0.0, 1.0)
    return share


def share_by_transfer(light: LampLight, lobes: Lobes, which: Indices, frames: Float32Array) -> Float32Array:
    """The share (P,) of a lamp's light that points which (P,) see past their own object, by their lobes."""
    arrives = np.zeros((len(frames), 3), np.float32)
    shade_some(which, lobes, frames, light.bands, arrives)
    n = light.bands.table.shape[2]
    unblocked, even = shade(unshadowed_points(len(which), 1, n), frames[which], light.bands), even_light(light.bands)
    reached = (arrives[which].sum(axis=1) + even) / np.maximum(unblocked.sum(axis=1) + even, 1e-20)
    return np.asarray(light.share * np.clip(reached, 0.0, 1.0), np.float32)


def add_lamp_gloss(
    layer: Layer, factor: NDArray[np.floating], lamp: Lamp, share: Float32Array, which: Indices,
    frames: Float32Array, places: Float32Array, camera_position: Float64Array, sent: Float32Array, is_moving: bool,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points which (P,), out of all, send of a lamp's light to the camera (3,), times factor
    (3,).

    share (S,): of the lamp's light that arrives; frames (S, 3, 3): tangent, bitangent and normal; places (V, 3), of the
    points first; is_moving: with fewer parts of a wide lamp.
    """
    lit, normals = which[share[which] > 0.0], np.ascontiguousarray(frames[:, 2])
    view = view_lamp(lamp, lit, places, normals)
    length = np.linalg.norm(view.mean, axis=1)

    def part(start: int, stop: int) -> None:
        some = lit[start:stop]
        at, axes = places[some].astype(np.float64), frames[some].astype(np.float64)
        wo = np.einsum("pai,pi->pa", axes, camera_position - at)
        wo /= np.maximum(np.linalg.norm(wo, axis=1, keepdims=True), 1e-30)
        wo[:, 2] = np.maximum(wo[:, 2], _LEAST_COSINE)
        wo /= np.linalg.norm(wo, axis=1, keepdims=True)
        power, reflected = view.power[start:stop], np.zeros_like(at)
        # A narrow lamp is one direction; of a wide one each part is.
        is_narrow = length[start:stop] > 1.0 - _NARROW
        narrow, wide = np.flatnonzero(is_narrow), np.flatnonzero(~is_narrow & power.any(axis=1))
        mean = view.mean[start:stop][narrow] / length[start:stop][narrow, None]
        reflected[narrow] = power[narrow] * _evaluate(layer, mean, axes[narrow], wo[narrow])
        if len(wide):
            samples = lamp.few if is_moving else lamp.samples
            reflected[wide] = _reflect_parts(layer, lamp, samples, at[wide], axes[wide], wo[wide], power[wide])
        sent[some] += (share[some, None] * reflected * factor).astype(np.float32)

    on_threads(part, *even_parts(len(lit)))


def _reflect_parts(
    layer: Layer, lamp: Lamp, samples: Sequence[LampSample], places: Float64Array, frames: Float64Array,
    wo: Float64Array, power: Float64Array,
) -> Float64Array:  # fmt: skip
    """Radiance (P, 3) that points send along wo (P, 3), in their own axes, by the parts of a lamp of power (P, 3)."""
    reflected, total = np.zeros_like(places), np.zeros_like(places)
    for sample in samples:
        towards, solid_angle = towards_lamp(places, sample)
        shares = solid_angle[:, None] * (sample.tint * lamp.emission)
        total += shares
        reflected += shares * _evaluate(layer, towards, frames, wo)
    # Few parts, of which some may face away, have another sum than all.
    return reflected * (power / np.maximum(total, 1e-30))


def _evaluate(layer: Layer, towards: Float64Array, frames: Float64Array, wo: Float64Array) -> Float64Array:
    """f cos θ_i (P, 3) for directions to the light (P, 3) in the world, 0 below the horizon."""
    wi = np.einsum("pai,pi->pa", frames, towards)
    found = np.zeros_like(wi)
    above = wi[:, 2] > 0.0
    found[above] = evaluate_layer(layer, wi[above], wo[above])
    return found
