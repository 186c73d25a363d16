"""The light of simple previews, for comparison with light in place [BenArtzi07, 1.1, figs 1.2-1.4].

Editors that cannot afford final placement show a material under one light, or under an environment that casts no
shadows. Both are here as they are there, with all else unchanged (camera, materials, transport, edits), so that it can
be seen what the difference hides: no transport is faster than that of shadows, only wrong.

    no_shadows   the scene's light, from which nothing hides anything
    point_light  one distant light in place of all, where the scene's is strongest, without shadows

The distant light brings as much light as the scene's, over all orientations of a surface: its irradiance facing it is
the integral E of radiance over all directions. The mean over the sphere of max(cos, 0) is 1/4 for either. Rejected: the
strength and position that a user finds by hand, as for fig. 4.4 (a.1-d.1), which differ each time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.light.environment import Environment, downsample, texel_solid_angles
from engine.precompute.direct.pipeline import Placement, SkyState, patches_of
from engine.settings import Lighting

Float64Array = NDArray[np.float64]

# The strongest light is looked for among texels of 5.6 degrees, so that it is a window and not a speck in it.
SEARCH_HEIGHT = 32
# The light itself is one texel of 0.35 degrees.
LIGHT_HEIGHT = 512
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def simple_lighting(placement: Placement, sky: SkyState, lighting: Lighting) -> tuple[Placement, SkyState]:
    """A placement and its sky under simple light; "scene": as they are."""
    if lighting == "scene":
        return placement, sky
    bare = placement.without_shadows()
    if lighting == "no_shadows":
        return bare, sky
    towards, irradiance = strongest_light(placement, sky)
    unlit = {each.name: (0.0, 0.0, 0.0) for each in placement.scene.description.objects}
    bare.set_emission(unlit)
    return bare, SkyState(distant_light(towards, irradiance))


def strongest_light(placement: Placement, sky: SkyState) -> tuple[Float64Array, Float64Array]:
    """The direction (3,) of the strongest light in the world, unit, and the irradiance (3,) that faces it of all light:
    of the sky where there is one that shines, else of emitters, as seen from the middle of what the camera sees."""
    if sky.environment is not None and sky.environment.radiance.any():
        return _strongest_of_sky(sky.environment, sky.rotation, sky.scale)
    patches = patches_of(placement.scene, 64)
    if patches is None:
        return np.array([0.0, 1.0, 0.0]), np.zeros(3)
    middle = placement.hits.position.mean(axis=0, dtype=np.float64) if len(placement.hits.position) else np.zeros(3)
    towards = patches.centre.astype(np.float64) - middle
    distance = np.linalg.norm(towards, axis=1, keepdims=True)
    towards /= distance
    facing = np.maximum(-np.einsum("pc,pc->p", patches.normal, towards), 0.0)
    shares = patches.radiance * (patches.area * facing)[:, None] / distance**2
    return towards[int(np.argmax(shares @ _LUMINANCE))], shares.sum(axis=0)


def _strongest_of_sky(environment: Environment, rotation: float, scale: float) -> tuple[Float64Array, Float64Array]:
    coarse = environment
    if len(environment.radiance) > SEARCH_HEIGHT:
        coarse = downsample(environment, SEARCH_HEIGHT)
    rows, columns = np.divmod(np.arange(2 * SEARCH_HEIGHT**2), 2 * SEARCH_HEIGHT)
    # Of an even sky the first is taken, at the zenith.
    towards = texel_direction(rows, columns, SEARCH_HEIGHT, 2 * SEARCH_HEIGHT, rotation)
    brightest = int(np.argmax(coarse.evaluate(towards, rotation) @ _LUMINANCE))
    height, width, _ = coarse.radiance.shape
    light = coarse.radiance * texel_solid_angles(height, width)[:, None, None]
    return towards[brightest], scale * light.sum(axis=(0, 1), dtype=np.float64)


def texel_direction(row: ArrayLike, column: ArrayLike, height: int, width: int, rotation: float = 0.0) -> Float64Array:
    """The world directions (..., 3) of lat-long texels' centres: +Y up, the centre column along -Z, rotated by degrees
    counter-clockwise about +Y seen from above."""
    theta = math.pi * (np.asarray(row) + 0.5) / height
    phi = 2.0 * math.pi * ((np.asarray(column) + 0.5) / width - 0.5) - math.radians(rotation)
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)


def distant_light(towards: Float64Array, irradiance: Float64Array) -> Environment:
    """An environment of one texel that shines, around a unit direction (3,), with this irradiance (3,) facing it."""
    height, width = LIGHT_HEIGHT, 2 * LIGHT_HEIGHT
    theta, phi = math.acos(min(max(towards[1], -1.0), 1.0)), math.atan2(towards[0], -towards[2])
    row = min(int(theta / math.pi * height), height - 1)
    column = int((phi / (2.0 * math.pi) + 0.5) * width) % width
    radiance = np.zeros((height, width, 3), np.float32)
    radiance[row, column] = irradiance / texel_solid_angles(height, width)[row]
    return Environment(radiance, "the strongest light")
