"""Low-frequency approximation of a glossy layer: a lobe about the mean direction of the light that it reflects.

For each polar angle of wo, the reflection is taken to be symmetric about that direction, and n of its bands are stored,
changed as little as necessary for the lobe to have no rings (`engine.sphere.harmonics`): with n = 6 it is at least
about 33 degrees wide. The error for sharper lobes is known, and reported. The share of light that is blocked is taken
to be that of a Lambertian surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

from engine.core.threads import even_parts, on_threads
from engine.light.environment import LUMINANCE
from engine.material.layer import Layer
from engine.realtime.zonal_harmonics import _gloss_kernels as kernels
from engine.realtime.zonal_harmonics.shading import BandLight
from engine.render.integrator import evaluate_layer
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import clamped_cosine, without_rings

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

N_ANGLES = 16
STEEPEST = np.radians(85.0)
EVEN = 0.125  # share of the mean light that is added to both sides of the visibility ratio
_LEVEL = 5


@dataclass(frozen=True, eq=False)
class LowGloss:
    """A layer's reflection for `N_ANGLES` polar angles of wo, 0 to `STEEPEST`: bands (A, n, 3), the factors of each
    band of the light along the lobe's axis; lean (A,): angle in radians from the normal to the axis, towards the mirror
    direction of wo.

    lost_share: error of n bands as a share of the reflection's energy, 0 to 1, for wo at 45 degrees.
    """

    bands: Float32Array
    lean: Float32Array
    lost_share: float

    @property
    def albedo(self) -> Float64Array:
        """Share of uniform light that it reflects (3,), averaged over all directions of wo."""
        angles = np.linspace(0.0, STEEPEST, N_ANGLES)
        weights = np.sin(2.0 * angles)
        return np.asarray(weights @ self.bands[:, 0] / weights.sum())


@lru_cache(maxsize=64)
def low_gloss(layer: Layer, n: int) -> LowGloss:
    """Compute the approximation of order n; an anisotropic layer is represented by its reflection along the tangent."""
    sphere = geodesic(_LEVEL)
    above = sphere.centres[:, 2] > 0.0
    wi, weights = sphere.centres[above], sphere.solid_angles[above, None]
    bands, lean, lost = np.empty((N_ANGLES, n, 3), np.float32), np.empty(N_ANGLES, np.float32), np.zeros(N_ANGLES)
    for i, angle in enumerate(np.linspace(0.0, STEEPEST, N_ANGLES)):
        wo = np.tile([np.sin(angle), 0.0, np.cos(angle)], (len(wi), 1))
        sent = evaluate_layer(layer, wi, wo)
        mean = (weights * sent @ LUMINANCE[:, None] * wi).sum(axis=0)
        lean[i] = np.arctan2(-mean[0], mean[2])
        axis = np.array([-np.sin(lean[i]), 0.0, np.cos(lean[i])])
        legendre = eval_legendre(np.arange(n)[:, None], np.clip(wi @ axis, -1.0, 1.0))
        exact = legendre @ (weights * sent)
        bands[i] = np.stack([without_rings(exact[:, c]) for c in range(3)], axis=1)
        # Share of the squared integral of the reflection that is lost: |f|^2 - |f - h|^2, where f has the exact bands
        # and h the stored ones.
        grey, kept = exact @ LUMINANCE, bands[i] @ LUMINANCE
        held = ((2 * np.arange(n) + 1) / (4.0 * np.pi) * (2.0 * grey * kept - kept**2)).sum()
        lost[i] = 1.0 - held / max(float((weights[:, 0] * (sent @ LUMINANCE) ** 2).sum()), 1e-30)
    at_45 = np.interp(np.radians(45.0), np.linspace(0.0, STEEPEST, N_ANGLES), lost)
    return LowGloss(bands, lean, float(np.clip(at_45, 0.0, 1.0)))


def add_gloss(
    gloss: LowGloss, factor: NDArray[np.floating], which: NDArray[np.int64], places: Float32Array,
    normals: Float32Array,
    camera_position: Float64Array, light: BandLight, white: Float32Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points (P,), out of all, send to the camera (3,), times factor (3,).

    places (S, 3), normals (S, 3); white (S, 3): radiance of white Lambertian points, which tells how much light is
    blocked.
    """
    cosine = (clamped_cosine(light.table.shape[2]) / np.pi).astype(np.float32)
    bands = np.ascontiguousarray(gloss.bands * np.asarray(factor, np.float32))

    def part(start: int, stop: int) -> None:
        kernels.gloss_range(
            which[start:stop], places, normals, camera_position, light.table, bands, gloss.lean, float(STEEPEST),
            cosine,
            even_light(light), white, sent,
        )  # fmt: skip

    on_threads(part, *even_parts(len(which)))


def even_light(light: BandLight) -> float:
    """`EVEN` times what a white surface reflects of the mean light, summed over the channels."""
    return EVEN * float(light.harmonics[0].sum()) / float(np.sqrt(4.0 * np.pi))
