"""All lights of a scene for indirect light, in units of their own brightness.

Random decisions are then the same under a light and under the same light a billion times as bright, and squares stay
within single precision: values are of the order of 1, with a separate unit. The unit is a power of two times the sky's
scale, so that a scaled sky gives the same bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from engine.light.emitters import EmitterPatches
from engine.light.triangle_lights import TriangleLights, cut_lights
from engine.precompute.direct.lighting import mean_radiance
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect._cache_kernels import Lights
from engine.precompute.indirect._second_bounce_kernels import SampledLights
from engine.precompute.indirect.irradiance_cache import patch_lights, sky_lights
from engine.precompute.indirect.second_bounce import emitters_for_sampling

N_LIGHTS, N_PATCHES = 4000, 256


@dataclass(frozen=True, eq=False)
class Emission:
    """lights: sky and emitters, each for sampling by power; lamps: both combined; in units of `unit` (radiance)."""

    lights: tuple[Lights, ...]
    lamps: SampledLights
    unit: float


def scene_emission(placement: Placement, sky: SkyState) -> Emission:
    """The triangle lights of the sky and the scene's emitters."""
    cut = None if sky.environment is None else cut_lights(sky.environment, N_LIGHTS, sky.rotation)
    cut, patches, unit = in_units(cut, placement.patches(N_PATCHES), sky.scale)
    lights = [] if cut is None else [sky_lights(cut)]
    lights += [] if patches is None else [patch_lights(patches)]
    return Emission(tuple(each for each in lights if len(each.cumulative)), emitters_for_sampling(cut, patches), unit)


def in_units(
    cut: TriangleLights | None, patches: EmitterPatches | None, scale: float
) -> tuple[TriangleLights | None, EmitterPatches | None, float]:
    """A sky scaled by `scale`, and emitters, in units of about their mean; and that unit."""
    common = 1.0 if patches is not None or cut is None else scale
    own = scale / common if common > 0.0 else 0.0
    mean = mean_radiance(cut, patches, own)
    unit = math.ldexp(1.0, math.frexp(mean)[1])
    if cut is not None:
        cut = cut.scale_by(own / unit)
    if patches is not None:
        patches = replace(patches, radiance=(patches.radiance / np.float64(unit)).astype(np.float32))
    return cut, patches, unit * common if common > 0.0 else unit
