"""What a glossy surface sends back along a ray, as plain sums over directions and lamps, in double precision."""

import numpy as np

from engine.light.emitters import EmitterPatches
from engine.material.layer import Layer, evaluate_layer
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic


def frame_of(normal: np.ndarray) -> np.ndarray:
    """Tangent, bitangent and normal as rows (3, 3); which tangent is all one to an isotropic surface."""
    aside = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    tangent = np.cross(aside, normal)
    tangent /= np.linalg.norm(tangent)
    return np.stack([tangent, np.cross(normal, tangent), normal])


def sent_back(
    layer: Layer, place: np.ndarray, normal: np.ndarray, towards: np.ndarray, caster: RayCaster, sky: np.ndarray,
    patches: EmitterPatches,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """π times the radiance (3,) that leaves a place towards a direction under an even sky (3,) and patches; and the
    same under the radiosity 1 of all that is seen from there, patches apart."""
    frame = frame_of(normal)

    def reflected(ways: np.ndarray) -> np.ndarray:
        return evaluate_layer(layer, ways @ frame.T, np.broadcast_to(frame @ towards, ways.shape))

    lifted = place + 1e-4 * normal
    sphere = geodesic(4)
    above = sphere.centres @ normal > 1e-3
    ways, angles = sphere.centres[above], sphere.solid_angles[above]
    hit = caster.occluded(np.tile(lifted, (len(ways), 1)), ways)
    values = reflected(ways) * angles[:, None]
    light = values[~hit].sum(axis=0) * sky
    to = patches.centre - lifted
    distance2 = (to**2).sum(axis=1)
    to = to / np.sqrt(distance2)[:, None]
    facing = np.maximum(-(to * patches.normal).sum(axis=1), 0.0)
    seen = (to @ normal > 0.0) & (facing > 0.0)
    seen[seen] = ~caster.occluded(
        np.tile(lifted, (int(seen.sum()), 1)), (patches.centre - lifted)[seen], np.full(int(seen.sum()), 0.999)
    )
    power = patches.radiance * (patches.area * facing / distance2)[:, None]
    light = light + (reflected(to[seen]) * power[seen]).sum(axis=0)
    return np.pi * light, values[hit].sum(axis=0)
