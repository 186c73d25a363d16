"""The light of lamps at points, each from where it is seen: live while lamps and points move.

A lamp near an object has another direction and solid angle at each of its points, so it is no distant light. At each
point it is projected onto the bands of transfer as caps of even light, one where it is narrow and else one for each
block of its parts. A cap about d of power Ω L, whose rim has the cosine c, is a zonal lobe, in closed form:

    band l along an axis a:  Ω L w_l (2l + 1) / 4π P_l(a · d),    w_l = (P_(l-1)(c) - P_(l+1)(c)) / ((2l + 1)(1 - c))

so that under a point's own lobes [Sloan05, eq. 10, 25] it needs neither a table nor a rotation. c is that of the cap
with the parts' mean direction: its bands 0 and 1 are theirs, the higher ones are a ball's and a round lamp's, and those
of other shapes as far as a block of them is round. Distance, cosine at the lamp and cone are those of its parts.

What bands lose of the cosine of an opaque point is known, so it is added: where nothing is in the way the light is that
of the parts themselves, Σ max(n · ω_s, 0) Ω_s L_s / π, and a lamp below the horizon gives none. The shadows in it are
those of the point's transfer, in six bands: of an object that bends its own. Objects at rest have this light until rays
to the lamp (`engine.realtime.zonal_harmonics.moving_lamps`) take its place; all have rays in pictures at rest.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.realtime.core.terms import is_glossy
from engine.realtime.zonal_harmonics import _lamp_light_kernels as kernels
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.lamp_gloss import share_by_transfer
from engine.realtime.zonal_harmonics.scene_lamps import Lamp
from engine.realtime.zonal_harmonics.shading import EVEN, Lobes
from engine.realtime.zonal_harmonics.shading_state import ShadingState
from engine.sphere.harmonics import clamped_cosine

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


def lamp_light(
    lamp: Lamp, which: NDArray[np.int64], lobes: Lobes, frames: Float32Array, places: Float32Array, is_opaque: bool,
    light: Float32Array, share: Float32Array,
) -> None:  # fmt: skip
    """Fill the rows which (P,) of light (S, 3), the radiance of white points by a lamp, and of share (S,), that of its
    light which is seen past what their lobes contain. frames (S, 3, 3): current axes; places (V, 3), of the points
    first; is_opaque: whether what the lobes contain is a cosine with shadows and reflections."""
    what = lobes.low, lobes.axes, lobes.coefficients, frames, places, lamp.rows, np.asarray(lamp.emission, np.float64)
    how = _cosine(lobes.coefficients.shape[2]), EVEN, is_opaque
    on_threads(
        lambda start, stop: kernels.light_range(start, stop, which, *what, *how, light, share), *even_parts(len(which))
    )


@cache
def _cosine(n: int) -> Float64Array:
    return clamped_cosine(n) / np.pi


def light_of_lamps(
    of: ShadingState, points: BendingPoints, frames: Float32Array, places: Float32Array, skipped: tuple[int, ...] = ()
) -> tuple[Float32Array, Float32Array]:
    """Radiance (S, L, 3) of white points by each lamp, in axes (S, 3, 3), at places (V, 3), and the shares (S, K) of
    the light of `mirrored_lamps` that arrive there; but for the lamps' on objects skipped. Rays have found both where
    these rest and the lamp is where it was then."""
    by_lamp = np.zeros((len(points), len(of.lamps), 3), np.float32)
    shares = np.zeros((len(points), len(of.mirrored_lamps)), np.float32)
    light, share = np.empty((len(points), 3), np.float32), np.empty(len(points), np.float32)
    for i, layers in of.layers_of.items():
        which, is_glossy_one = points.points_of(i), i not in of.details and any(map(is_glossy, layers))
        for k in of.lamps_of(i) if i not in skipped else ():
            lamp, rays = of.lamps[k], of.by_rays[k]
            if rays is not None and i in rays.objects and i not in of.alone:
                by_lamp[which, k], shares[which, k] = rays.radiance[which] * lamp.emission, rays.share[which]
                continue
            lamp_light(lamp, which, of.lobes, frames, places, of.is_opaque(i), light, share)
            left = of.shares_left.get((i, k), 1.0)
            by_lamp[which, k], shares[which, k] = left * light[which], left * share[which]
        if is_glossy_one:
            # None where they are in the bands of the object's light.
            mirrored = *zip(of.suns_of(i), of.suns_at(i), strict=False), *of.far_lamps.get(i, {}).items()
            for k, far in mirrored:
                shares[which, k] = share_by_transfer(far, of.lobes, which, frames)
    return by_lamp, shares
