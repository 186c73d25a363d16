"""Suns of a sky: the small parts of it that hold much of its light. Gloss mirrors them by its BRDF, as lamps far away
(`engine.realtime.zonal_harmonics.lamp_gloss`): in six bands a sun is a lobe of some 33 degrees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.light.cones import ALL_ROUND
from engine.light.environment import LUMINANCE, triangle_integrals
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.lamp_gloss import LampLight
from engine.realtime.zonal_harmonics.neighbours import PROBE_LEVEL, sky_powers
from engine.realtime.zonal_harmonics.object_transfer import ORDER
from engine.realtime.zonal_harmonics.scene_lamps import Lamp, LampSample
from engine.realtime.zonal_harmonics.shading import BandLight, band_light
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import basis, project

Float64Array = NDArray[np.float64]

SUN_SHARE = 0.02  # of all light, in one of the sphere's triangles, which are 2 degrees wide
_FINE_LEVEL = 7  # which tells where in its triangle a sun is
_FAR = 1e6  # by the scene's size
_SOLID_ANGLE = 1e-8


@dataclass(frozen=True, eq=False)
class SkyLight:
    """A sky's light: powers (T, 3), its integrals over the sphere's triangles; suns (N,): the triangles that are suns;
    lamps (N,): these as lamps far away."""

    powers: Float64Array
    suns: NDArray[np.int64]
    lamps: Sequence[Lamp]

    @property
    def dull_powers(self) -> Float64Array:
        """The powers without suns (T, 3)."""
        dull = self.powers.copy()
        dull[self.suns] = 0.0
        return dull

    @cached_property
    def sun_harmonics(self) -> Float64Array:
        """Harmonics (N, n^2, 3) of each sun."""
        directions = geodesic(PROBE_LEVEL).centres[self.suns]
        return basis(directions, ORDER)[:, :, None] * self.powers[self.suns, None]

    @cached_property
    def bands(self) -> BandLight:
        """All of it."""
        return band_light(project(self.powers, ORDER))

    @cached_property
    def dull_bands(self) -> BandLight:
        """Without suns."""
        return band_light(project(self.dull_powers, ORDER)) if len(self.suns) else self.bands

    @cached_property
    def sun_lights(self) -> tuple[LampLight, ...]:
        """Each sun where nothing hides it."""
        return tuple(LampLight(band_light(each), 1.0) for each in self.sun_harmonics)


def sky_light(sky: SkyState, radius: float) -> SkyLight:
    """The light of a sky over a scene whose places are within a radius of the origin."""
    powers = sky_powers(sky)
    luminance = powers @ LUMINANCE
    suns = np.flatnonzero(luminance > SUN_SHARE * luminance.sum())
    if sky.environment is None or not len(suns):
        return SkyLight(powers, suns, ())
    # A sun is where the brightness in its triangle has its centre.
    fine = (triangle_integrals(sky.environment, sky.rotation, _FINE_LEVEL) @ LUMINANCE).reshape(len(powers), -1)[suns]
    towards = np.einsum("sk,ski->si", fine, geodesic(_FINE_LEVEL).centres.reshape(len(powers), -1, 3)[suns])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    distance = _FAR * max(radius, 1e-9)
    cone, white = np.array(ALL_ROUND, np.float32), np.ones(3)
    lamps = []
    for direction, power in zip(towards, powers[suns], strict=True):
        place = distance * direction
        sample = LampSample(place, -direction, _SOLID_ANGLE * distance**2, cone, white, place)
        lamps.append(Lamp([sample], [sample], power / _SOLID_ANGLE))
    return SkyLight(powers, suns, tuple(lamps))
