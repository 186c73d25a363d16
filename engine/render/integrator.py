"""Direct light by brute force: every light sample traced, the whole BRDF evaluated. The oracle of the transport path.

Shares with it the scene, the hits and the rays, and nothing else: no bands, no curves, no visibility bits, no cut.
The sky is integrated over all triangles of one geodesic level, each with its own radiance integral; emitters over an
even subdivision of their faces.
"""

from collections.abc import Callable, Sequence

import numpy as np

from engine.light.emitters import EmitterPatches
from engine.light.environment import Environment, triangle_integrals
from engine.material.layer import Layer
from engine.scene.hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic

POINTS_AT_ONCE = 16


def local_frames(hits: PrimaryHits, rows: np.ndarray) -> np.ndarray:
    """(p, 3, 3) float64 matrices whose rows are tangent, bitangent, normal: world to local."""
    tangent, normal = hits.tangent[rows].astype(np.float64), hits.normal[rows].astype(np.float64)
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)


def evaluate_layers(layers: Sequence[Layer], wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Σ layers ρ(ωi, ωo), (N, 3), of unedited or edited layers: quotient times curves where edits exist."""
    total = np.zeros((len(wi), 3))
    for layer in layers:
        if layer.visible:
            total += layer.brdf(wi, wo)
    return total


def integrate_direct(
    hits: PrimaryHits,
    rows: np.ndarray,
    caster: RayCaster,
    layers_of: Callable[[int], Sequence[Layer]],
    environment: Environment | None,
    rotation: float,
    patches: EmitterPatches | None,
    level: int = 6,
) -> np.ndarray:
    """Radiance (len(rows), 3) float64 towards the eye after one reflection.

    layers_of(object_id) gives the layers of an object; rotation in degrees; level: sky triangles, 20·4^level.
    """
    radiance = np.zeros((len(rows), 3))
    objects = hits.object_image.ravel()[hits.pixel]
    sky_directions = geodesic(level).centres
    sky_power = triangle_integrals(environment, rotation, level) if environment is not None else None
    for begin in range(0, len(rows), POINTS_AT_ONCE):
        for i in range(begin, min(begin + POINTS_AT_ONCE, len(rows))):
            row = rows[i]
            frame = local_frames(hits, rows[i : i + 1])[0]
            layers = layers_of(int(objects[row]))
            if sky_power is not None:
                radiance[i] += _reflect(hits, row, frame, caster, layers, sky_directions, sky_power, None)
            if patches is not None:
                wi, distance, power = patch_samples(patches, hits.position[row].astype(np.float64))
                radiance[i] += _reflect(hits, row, frame, caster, layers, wi, power, distance)
    return radiance


def patch_samples(patches: EmitterPatches, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit directions (M, 3), distances (M,) and radiance times projected area over distance squared (M, 3)."""
    towards = patches.centre.astype(np.float64) - point
    distance = np.linalg.norm(towards, axis=1)
    wi = towards / distance[:, None]
    edges = patches.corners[:, 1:].astype(np.float64) - patches.corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    facing = np.maximum(-(wi * patches.normal).sum(axis=1), 0.0)
    return wi, distance, patches.radiance * (area * facing / distance**2)[:, None]


def _reflect(hits, row, frame, caster, layers, wi, power, distance) -> np.ndarray:
    """Σ V ρ cosθ (L ΔΩ) at one point over samples wi (M, 3) with power (M, 3)."""
    local = wi @ frame.T
    geometric = wi @ hits.geometric_normal[row].astype(np.float64)
    above = (local[:, 2] > 0) & (geometric > 0) & (power.max(axis=1) > 0)
    origins = np.tile(hits.offset_position[row], (int(above.sum()), 1)).astype(np.float32)
    reach = None if distance is None else (distance[above] * 0.9999).astype(np.float32)
    blocked = caster.occluded(origins, wi[above].astype(np.float32), reach)
    lit = np.flatnonzero(above)[~blocked]
    wo = np.tile(frame @ hits.wo[row].astype(np.float64), (len(lit), 1))
    brdf = evaluate_layers(layers, local[lit], wo)
    return (brdf * local[lit, 2:3] * power[lit]).sum(axis=0)

