"""Direct light by brute force: traces every light sample and evaluates the whole BRDF. The oracle of the transport
path.

It shares with that path the scene, the hits and the rays, and nothing else: no bands, no curves, no visibility bits, no
cut. The sky is integrated over all triangles of one geodesic level, each with its own radiance integral; emitters over
a uniform subdivision of their faces.
"""

from collections.abc import Callable, Sequence

import numpy as np

from engine.core.frames import local_frames
from engine.curve.operators import HALF_PI
from engine.light.emitters import EmitterPatches
from engine.light.environment import Environment, triangle_integrals
from engine.material import kinds
from engine.material.layer import Layer
from engine.render import _kernels as kernels
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic


def evaluate_layers(
    layers: Sequence[Layer], wi: np.ndarray, wo: np.ndarray, factors: np.ndarray | None = None
) -> np.ndarray:
    """Σ over visible layers of ρ(ωi, ωo) cosθi, (N, 3), for local directions (N, 3).

    factors (N or 1, K, 3): factors of the first K visible layers; None, or K = 0, for none.
    """
    total = np.zeros((len(wi), 3))
    for k, layer in enumerate(layer for layer in layers if layer.visible):
        value = evaluate_layer(layer, wi, wo)
        total += value if factors is None or k >= factors.shape[1] else value * factors[:, k]
    return total


def evaluate_layer(layer: Layer, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """ρ(ωi, ωo) cosθi of one layer, (N, 3): the model's own formula, or quotient times curves if it was edited."""
    if not layer.edits:
        return layer.brdf(wi, wo) * np.maximum(wi[:, 2:3], 0.0)
    return layer.scale() * evaluate_by_curves(layer, wi, wo)


def evaluate_by_curves(layer: Layer, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """ρ_q f_o f_A f_B cosθi of one layer, without f_q, (N, 3) [BenArtzi07, eq. 3.1]."""
    wi, wo = np.ascontiguousarray(wi, np.float64), np.ascontiguousarray(wo, np.float64)
    q = layer.quotient_parameters()
    value = _quotients(layer, q, wi, wo)
    view = layer.model.view_factor
    for factor in (*layer.model.factors, *((view,) if view else ())):
        angle = np.empty(len(wi))
        kernels.curve_angles(factor.gamma, q, wi, wo, angle)
        value *= layer.curve(factor.name)(np.clip(angle, 0.0, HALF_PI))
    return value


def _quotients(layer: Layer, q: np.ndarray, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """ρ_q cosθi (N, 3): equal in all channels unless the model is coloured."""
    model, q = layer.model, np.array(layer.model.bind_parameters(q))
    value = np.empty((3, len(wi)))
    for channel in range(3 if model.is_coloured else 1):
        if model.is_coloured:
            q[kinds.CHANNEL] = channel
        kernels.quotient_cosines(model.number, q, wi, wo, value[channel])
    return value.T.copy() if model.is_coloured else np.repeat(value[0][:, None], 3, axis=1)


def integrate_direct(
    hits: PrimaryHits,
    rows: np.ndarray,
    caster: RayCaster,
    layers_of: Callable[[int], Sequence[Layer]],
    environment: Environment | None,
    rotation: float,
    patches: EmitterPatches | None,
    level: int = 6,
    factors: np.ndarray | None = None,
) -> np.ndarray:
    """Radiance (len(rows), 3) float64 towards the camera after one reflection.

    layers_of(object_id) gives the layers of an object; rotation in degrees; level: of the sky's triangles, 20·4^level;
    factors (P, K, 3): factors of the first K visible layers at each of the hits.
    """
    radiance = np.zeros((len(rows), 3))
    objects = hits.objects
    sky_directions = geodesic(level).centres
    sky_power = triangle_integrals(environment, rotation, level) if environment is not None else None
    frames = local_frames(hits.tangent[rows], hits.normal[rows])
    for i, row in enumerate(rows):
        layers = layers_of(int(objects[row]))
        own = None if factors is None else factors[row : row + 1]
        if sky_power is not None:
            radiance[i] += _reflect(hits, row, frames[i], caster, layers, sky_directions, sky_power, None, own)
        if patches is not None:
            wi, distance, power = patch_samples(patches, hits.position[row].astype(np.float64))
            radiance[i] += _reflect(hits, row, frames[i], caster, layers, wi, power, distance, own)
    return radiance


def patch_samples(patches: EmitterPatches, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit directions (M, 3), distances (M,), and radiance times projected area over squared distance (M, 3)."""
    towards = patches.centre.astype(np.float64) - point
    distance = np.linalg.norm(towards, axis=1)
    wi = towards / distance[:, None]
    edges = patches.corners[:, 1:].astype(np.float64) - patches.corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    facing = np.maximum(-(wi * patches.normal).sum(axis=1), 0.0)
    return wi, distance, patches.radiance * (area * facing / distance**2)[:, None]


def _reflect(
    hits: PrimaryHits,
    row: int,
    frame: np.ndarray,
    caster: RayCaster,
    layers: Sequence[Layer],
    wi: np.ndarray,
    power: np.ndarray,
    distance: np.ndarray | None,
    factors: np.ndarray | None,
) -> np.ndarray:
    """Σ V ρ cosθ (L ΔΩ) at one point over samples wi (M, 3) with power (M, 3); factors (1, K, 3) of the layers.

    As in path tracers, a ray towards light that the shading normal faces but the surface does not starts from the other
    side.
    """
    local = wi @ frame.T
    above = np.flatnonzero((np.minimum(local[:, 2], wi @ hits.horizon[row]) > 0) & (power.max(axis=1) > 0))
    towards = wi[above]
    side = np.where(towards @ hits.geometric_normal[row].astype(np.float64) >= 0, 1.0, -1.0)
    position, lift = hits.position[row].astype(np.float64), hits.offset_position[row].astype(np.float64)
    origins = (position + side[:, None] * (lift - position)).astype(np.float32)
    reach = None if distance is None else (distance[above] * 0.9999).astype(np.float32)
    lit = above[~caster.occluded(origins, towards.astype(np.float32), reach)]
    wo = np.tile(frame @ hits.wo[row].astype(np.float64), (len(lit), 1))
    return (evaluate_layers(layers, local[lit], wo, factors) * power[lit]).sum(axis=0)
