"""Direct light by brute force: traces every light sample and evaluates the whole BRDF. The oracle of the transport
path.

It shares with that path the scene, the hits and the rays, and nothing else: no bands, no curves, no visibility bits, no
cut. The sky is integrated over all triangles of one geodesic level, each with its own radiance integral; emitters over
a uniform subdivision of their faces.
"""

from collections.abc import Callable, Sequence

import numpy as np

from engine.core.frames import local_frames
from engine.light.cones import cone_shares
from engine.light.emitters import EmitterPatches
from engine.light.environment import Environment, triangle_integrals
from engine.material.layer import Layer, evaluate_layers
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic


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
    coated = hits.in_frame("coat")
    frames = local_frames(hits.tangent[rows], hits.normal[rows])
    of_coats = local_frames(coated.tangent[rows], coated.normal[rows])
    for i, row in enumerate(rows):
        layers = layers_of(int(objects[row]))
        own, both = None if factors is None else factors[row : row + 1], (frames[i], of_coats[i])
        if sky_power is not None:
            radiance[i] += _reflect(hits, row, both, caster, layers, sky_directions, sky_power, None, own)
        if patches is not None:
            wi, distance, power = patch_samples(patches, hits.position[row].astype(np.float64))
            radiance[i] += _reflect(hits, row, both, caster, layers, wi, power, distance, own)
    return radiance


def patch_samples(patches: EmitterPatches, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit directions (M, 3), distances (M,), and radiance towards the point times projected area over squared distance
    (M, 3)."""
    towards = patches.centre.astype(np.float64) - point
    distance = np.linalg.norm(towards, axis=1)
    wi = towards / distance[:, None]
    edges = patches.corners[:, 1:].astype(np.float64) - patches.corners[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    facing = np.maximum(-(wi * patches.normal).sum(axis=1), 0.0)
    return wi, distance, patches.radiance * (cone_shares(patches.cones, wi) * area * facing / distance**2)[:, None]


def _reflect(
    hits: PrimaryHits,
    row: int,
    frames: tuple[np.ndarray, np.ndarray],
    caster: RayCaster,
    layers: Sequence[Layer],
    wi: np.ndarray,
    power: np.ndarray,
    distance: np.ndarray | None,
    factors: np.ndarray | None,
) -> np.ndarray:
    """Σ V ρ cosθ (L ΔΩ) at one point over samples wi (M, 3) with power (M, 3); frames: (3, 3) for
    layers of the base's and of the coat's; factors (1, K, 3) of the layers.

    As in path tracers, a ray towards light that the shading normal faces but the surface does not starts from the other
    side.
    """
    local, in_coat = (wi @ frame.T for frame in frames)
    height = np.minimum(np.maximum(local[:, 2], in_coat[:, 2]), wi @ hits.horizon[row])
    above = np.flatnonzero((height > 0) & (power.max(axis=1) > 0))
    towards = wi[above]
    side = np.where(towards @ hits.geometric_normal[row].astype(np.float64) >= 0, 1.0, -1.0)
    position, lift = hits.position[row].astype(np.float64), hits.offset_position[row].astype(np.float64)
    origins = (position + side[:, None] * (lift - position)).astype(np.float32)
    reach = None if distance is None else (distance[above] * 0.9999).astype(np.float32)
    lit = above[~caster.occluded(origins, towards.astype(np.float32), reach)]
    wo, coat_wo = (np.tile(each @ hits.wo[row].astype(np.float64), (len(lit), 1)) for each in frames)
    return (evaluate_layers(layers, local[lit], wo, factors, (in_coat[lit], coat_wo)) * power[lit]).sum(axis=0)
