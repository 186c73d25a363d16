"""All lights of a scene for indirect light, in units of their own brightness, ready to be sampled by power.

Random decisions are then the same under a light and under the same light a billion times as bright, and squares stay
within single precision: values are of the order of 1, with a separate unit. The unit is a power of two times the sky's
scale, so that a scaled sky gives the same bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.light.cones import all_round
from engine.light.emitters import EmitterPatches
from engine.light.triangle_lights import TriangleLights, cut_lights, powers_in
from engine.precompute.direct.lighting import mean_radiance
from engine.precompute.direct.linking import object_groups
from engine.precompute.direct.pipeline import Placement, SkyState, patches_of
from engine.precompute.indirect._cache_kernels import Lights
from engine.precompute.indirect._light_choice_kernels import SampledLights
from engine.scene.scene_loader import Scene
from engine.sphere.geodesic import locate

N_LIGHTS, N_PATCHES = 4000, 256
_RASTER = (512, 1024)  # rows and columns


class ReachingLights(NamedTuple):
    """Lights, and which objects (M,) they reach; None: all of them."""

    lights: Lights
    objects: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Emission:
    """lights: sky and emitters, each for sampling by power, for each group of objects that the same lights reach;
    all_lights: both combined; all in units of `unit` (radiance)."""

    lights: tuple[ReachingLights, ...]
    all_lights: SampledLights
    unit: float


def scene_emission(placement: Placement, sky: SkyState) -> Emission:
    """The triangle lights of the sky and the scene's emitters."""
    cut = None if sky.environment is None else cut_lights(sky.environment, N_LIGHTS, sky.rotation)
    cut, patches, unit = in_units(cut, placement.patches(N_PATCHES), sky.scale)
    n_objects = len(placement.scene.emission)
    all_lights = emitters_for_sampling(cut, patches, n_objects)
    if sky.links:
        all_lights = linked(all_lights, sky, cut, patches, unit, n_objects)
        return Emission(group_lights(placement.scene, sky, unit), all_lights, unit)
    lights = [] if cut is None else [sky_lights(cut)]
    lights += [] if patches is None else [patch_lights(patches)]
    return Emission(tuple(ReachingLights(each) for each in lights if len(each.cumulative)), all_lights, unit)


def group_lights(scene: Scene, sky: SkyState, unit: float) -> tuple[ReachingLights, ...]:
    """The lights of each group of objects that the same lights reach, in this unit of radiance."""
    found = []
    for objects, reaching, emitters in object_groups(sky, len(scene.emission)):
        lights = []
        if reaching.environment is not None:
            cut = cut_lights(reaching.environment, N_LIGHTS, reaching.rotation)
            lights.append(sky_lights(cut.scale_by(reaching.scale / unit)))
        patches = patches_of(replace(scene, emission=scene.emission * emitters[:, None]), N_PATCHES)
        if patches is not None:
            radiance = (patches.radiance / np.float64(unit)).astype(np.float32)
            lights.append(patch_lights(replace(patches, radiance=radiance)))
        found += [ReachingLights(each, objects) for each in lights if len(each.cumulative)]
    return tuple(found)


def linked(
    lights: SampledLights, sky: SkyState, cut: TriangleLights | None, patches: EmitterPatches | None, unit: float,
    n_objects: int,
) -> SampledLights:  # fmt: skip
    """The same lights, of a sky's cut and of patches, with the shares of them that reach each group of objects."""
    n_sky, n_lights, groups = len(lights.density), len(lights.cumulative), object_groups(sky, n_objects)
    shares, numbers = np.zeros((len(groups), n_lights, 3), np.float32), np.zeros(n_objects, np.int32)
    for i, (objects, reaching, emitters) in enumerate(groups):
        numbers[objects] = i
        if n_sky and cut is not None and reaching.environment is not None:
            power = powers_in(cut, reaching.environment, reaching.rotation) * np.float32(reaching.scale / unit)
            np.divide(power, cut.power, out=shares[i, :n_sky], where=cut.power > 0.0)
        if n_lights > n_sky and patches is not None:
            shares[i, n_sky:] = emitters[patches.owner][:, None]
    return lights._replace(shares=np.minimum(shares, np.float32(1.0)), groups=numbers)


def shares_alone(
    lights: SampledLights, scene: Scene, cut: TriangleLights | None, unit: float, sky: SkyState,
    emission: NDArray[np.floating], weight: NDArray[np.floating],
) -> NDArray[np.float32]:  # fmt: skip
    """The shares (G, L, 3) of all lights, of a sky's cut and a scene's emitters, that reach each group of objects
    where one of them is alone: emitters, of emission (M, 3), or a sky, times its weight (3,) in this unit."""
    n_sky, shares = len(lights.density), np.zeros_like(lights.shares)
    if emission.any():
        patches = patches_of(scene, N_PATCHES)
        if patches is not None:
            emitting = np.asarray(emission.any(axis=1))
            shares[:, n_sky:] = np.where(emitting[patches.owner, None], lights.shares[:, n_sky:], np.float32(0.0))
    elif n_sky and sky.environment is not None and cut is not None:
        power = powers_in(cut, sky.environment, sky.rotation) * np.asarray(weight * (sky.scale / unit), np.float32)
        share = np.divide(power, cut.power, out=np.zeros_like(power), where=cut.power > 0.0)
        unreached = [i for link in sky.links for i in link.objects]  # by the only light there is
        shares[:, :n_sky] = np.minimum(share, np.float32(1.0))
        shares[lights.groups[unreached], :n_sky] = 0.0
    return shares


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


def sky_lights(cut: TriangleLights) -> Lights:
    """The triangle lights of a sky, sampled by power."""
    normals = np.zeros((len(cut), 3), np.float32)
    return _lights(cut.vertices[cut.corners], cut.power, normals, all_round(len(cut)), True)


def patch_lights(patches: EmitterPatches) -> Lights:
    """Patches of emitters, sampled by power."""
    return _lights(patches.corners, patches.radiance * patches.area[:, None], patches.normal, patches.cones, False)


def _lights(
    corners: NDArray[np.floating], power: NDArray[np.floating], normals: NDArray[np.floating],
    cones: NDArray[np.float32], is_sky: bool,
) -> Lights:  # fmt: skip
    """Lights with power, with cumulative shares and powers divided by the share."""
    strength = power.max(axis=1).astype(np.float64)
    lit = strength > 0.0
    share = strength[lit] / max(strength.sum(), 1e-300)
    return Lights(
        np.ascontiguousarray(corners[lit], np.float32), np.cumsum(share).astype(np.float32),
        np.ascontiguousarray(power[lit] / np.maximum(share, 1e-30)[:, None], np.float32),
        np.ascontiguousarray(normals[lit], np.float32), np.ascontiguousarray(cones[lit]), is_sky,
    )  # fmt: skip


def emitters_for_sampling(cut: TriangleLights | None, patches: EmitterPatches | None, n_objects: int) -> SampledLights:
    """Sky and emitters for sampling by power, all of which reach all objects; half of the samples each where there are
    both."""
    groups = np.zeros(n_objects, np.int32)
    parts = [part for part in (_sky(cut), _patches(patches)) if part is not None and part[1].max() > 0.0]
    if not parts:
        none = np.zeros((0, 3), np.float32)
        empty = np.zeros(0, np.float32)
        raster = np.zeros((0, 0), np.int32)
        return SampledLights(none[:, None], empty, none, none, all_round(0), empty, none, raster, none[None], groups)
    shares = [strength / strength.sum() / len(parts) for _, strength, *_ in parts]
    corners = np.concatenate([part[0] for part in parts]).astype(np.float32)
    share = np.concatenate(shares)
    power = np.concatenate([part[2] for part in parts]) / np.maximum(share, 1e-30)[:, None]
    power[share == 0.0] = 0.0
    cumulative = np.cumsum(share)
    cumulative[np.flatnonzero(share)[-1] :] = 2.0  # rounding leaves no sample beyond the last light with power
    density, radiance, raster = np.zeros(0, np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 0), np.int32)
    if cut is not None and _sky(cut)[1].max() > 0.0:
        density = (shares[0] / cut.solid_angle).astype(np.float32)
        radiance, raster = (cut.power / cut.solid_angle[:, None]).astype(np.float32), _raster(cut)
    normals, cones = (np.concatenate([part[k] for part in parts]).astype(np.float32) for k in (3, 4))
    return SampledLights(
        corners, cumulative.astype(np.float32), power.astype(np.float32), normals, cones, density, radiance, raster,
        np.ones((1, len(power), 3), np.float32), groups,
    )  # fmt: skip


_Part = tuple[
    NDArray[np.floating], NDArray[np.float64], NDArray[np.floating], NDArray[np.floating], NDArray[np.float32]
]


def _sky(cut: TriangleLights | None) -> _Part:
    """Corners, strengths, powers, (zero) normals and (no) cones of the sky's triangles."""
    if cut is None:
        return np.zeros((0, 3, 3)), np.zeros(1), np.zeros((0, 3)), np.zeros((0, 3)), all_round(0)
    strength, normals = cut.power.max(axis=1).astype(np.float64), np.zeros((len(cut), 3))
    return cut.vertices[cut.corners], strength, cut.power, normals, all_round(len(cut))


def _patches(patches: EmitterPatches | None) -> _Part | None:
    if patches is None:
        return None
    power = patches.radiance * patches.area[:, None]
    return patches.corners, power.max(axis=1).astype(np.float64), power, patches.normal, patches.cones


@lru_cache(maxsize=2)
def raster_of_triangles(level: int) -> NDArray[np.int32]:
    """The geodesic triangle of a level in each direction of a lat-long grid (H, W); columns from -Z over +X."""
    height, width = _RASTER
    polar = (np.arange(height) + 0.5) * np.pi / height
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    directions = np.stack(
        np.broadcast_arrays(
            np.sin(polar)[:, None] * np.sin(azimuth), np.cos(polar)[:, None], -np.sin(polar)[:, None] * np.cos(azimuth)
        ), axis=2,
    ).reshape(-1, 3)  # fmt: skip
    return np.ascontiguousarray(locate(directions, level).reshape(_RASTER), np.int32)


def _raster(cut: TriangleLights) -> NDArray[np.int32]:
    """The triangle of the cut in each direction of that grid."""
    finest = int(cut.level.max())
    size = 4 ** (finest - cut.level.astype(np.int64))
    first = cut.index.astype(np.int64) * size
    order = np.argsort(first)
    found = np.searchsorted(first[order], raster_of_triangles(finest), "right") - 1
    return order[found].astype(np.int32)
