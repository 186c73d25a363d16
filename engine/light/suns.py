"""Suns: distant discs of light, added to the image of an environment, so that all that knows that knows them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import Environment, texel_solid_angles, upsample_interpolated

SUN_DIAMETER = 0.53  # degrees
_ROWS = 1024  # texels of 0.18 degrees: a sun covers nine
_N_SUB = 8
# Directions that stand for a sun while the light is dragged: of the real sun, and of a large one.
_LIGHTS_PER_SUN, _MOST_LIGHTS = 12, 96


class Sun(NamedTuple):
    """direction: unit, towards it, in the environment's frame; irradiance: RGB of a surface that faces it, W/m²;
    diameter: degrees. name: by which the user knows it."""

    direction: tuple[float, float, float]
    irradiance: tuple[float, float, float]
    diameter: float = SUN_DIAMETER
    name: str = ""

    def scaled(self, factor: float) -> Sun:
        """The same, brighter by a factor."""
        red, green, blue = self.irradiance
        return self._replace(irradiance=(factor * red, factor * green, factor * blue))


@lru_cache(maxsize=8)  # the same object again, whose integrals are known; with links there are several
def with_suns(environment: Environment, suns: tuple[Sun, ...]) -> Environment:
    """The environment with suns: discs of constant radiance L = E / (pi sin² r), r half the diameter.

    The image is made finer first, up to 1,024 rows, as interpolation shows it. A texel has the share of L that the disc
    covers of it, by 8 x 8 samples; all are scaled so that the power is exact.
    """
    if not suns:
        return environment
    image = _refined(environment)
    for sun in suns:
        add_sun_disc(image, sun)
    image.flags.writeable = False
    return Environment(image, environment.source, environment.notes, environment, suns)


def sun_lights(sun: Sun) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit directions (N, 3) spread evenly over a sun's disc, and the power (N, 3) of each, the integral of L dω."""
    radius = math.radians(sun.diameter / 2.0)
    n = min(max(math.ceil(_LIGHTS_PER_SUN * sun.diameter / SUN_DIAMETER), 1), _MOST_LIGHTS)
    # Vogel's spiral: equal steps of the solid angle, turned by the golden angle.
    k = np.arange(n)
    lowered, phi = 2.0 * math.sin(0.5 * radius) ** 2 * (k + 0.5) / n, math.pi * (3.0 - math.sqrt(5.0)) * k
    across = np.sqrt(lowered * (2.0 - lowered))
    axis = np.divide(sun.direction, math.hypot(*sun.direction))
    one = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    one /= np.linalg.norm(one)
    sides = np.cos(phi)[:, None] * one + np.sin(phi)[:, None] * np.cross(axis, one)
    directions = (1.0 - lowered)[:, None] * axis + across[:, None] * sides
    power = np.tile(_power_share(radius) / n * np.array(sun.irradiance), (n, 1))
    return directions.astype(np.float32), power.astype(np.float32)


def _power_share(radius: float) -> float:
    """The integral of L dω of a disc of this angular radius, for an irradiance of 1: its solid angle divided by
    pi sin² r, which is 1 / cos² (r / 2)."""
    return 1.0 / math.cos(0.5 * radius) ** 2


def _refined(environment: Environment) -> NDArray[np.float32]:
    if environment.radiance.shape[:2] == (1, 1):
        return np.tile(environment.radiance, (_ROWS, 2 * _ROWS, 1))
    return upsample_interpolated(environment).radiance.copy()


def add_sun_disc(image: NDArray[np.float32], sun: Sun) -> None:
    """Adds a sun to an image (H, W, 3), in place."""
    height, width, _ = image.shape
    x, y, z = np.divide(sun.direction, math.hypot(*sun.direction))
    radius = math.radians(sun.diameter / 2.0)
    theta = math.acos(min(max(y, -1.0), 1.0))
    first = max(int((theta - radius) / math.pi * height), 0)
    last = min(int((theta + radius) / math.pi * height) + 1, height)
    phi = 2.0 * math.pi * ((np.arange(width * _N_SUB) + 0.5) / (width * _N_SUB) - 0.5)
    across = np.sin(phi) * x - np.cos(phi) * z
    solid_angles = texel_solid_angles(height, width)[first:last, None]
    covered = np.empty((last - first, width))
    for row in range(first, last):
        theta = math.pi * (row + (np.arange(_N_SUB)[:, None] + 0.5) / _N_SUB) / height
        inside = np.sin(theta) * across + np.cos(theta) * y >= math.cos(radius)
        weights = np.sin(theta) / np.sin(theta).sum()  # solid angles of the samples, which differ at the poles
        covered[row - first] = (weights * inside).sum(axis=0).reshape(width, _N_SUB).mean(axis=1)
    if not covered.any():  # smaller than the samples are apart
        column = int((math.atan2(x, -z) / (2.0 * math.pi) + 0.5) * width) % width
        covered[(last - first) // 2, column] = 1.0
    share = covered * (_power_share(radius) / (covered * solid_angles).sum())
    image[first:last] += (share[..., None] * np.array(sun.irradiance)).astype(np.float32)
