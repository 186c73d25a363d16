"""Painted lights: soft boxes, discs, gradients, skies and images that are painted onto the environment, in order.

Each is a description; `engine.light.painting` paints it. Directions are in the environment's frame, as of suns: azimuth
0° is -Z and 90° is +X, before the environment is tilted and turned.

A painted light *adds* its radiance to what is below it in the list, or *covers* that, as a card does. Either way the
environment is linear in the radiance of each, so that painted lights can be mixed as all others: with the share a_i
that light i covers, the environment is Σ_i a_i L_i Π_{j > i} (1 − a_j), j over lights that cover.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.light.suns import SUN_DIAMETER

RGB = tuple[float, float, float]
PaintedKind = Literal["box", "disc", "gradient", "sky", "image"]
Blend = Literal["add", "cover"]
Placement = Literal["card", "panorama"]
PAINTED_KINDS: tuple[PaintedKind, ...] = ("box", "disc", "gradient", "sky", "image")
BLENDS: tuple[Blend, ...] = ("add", "cover")
PLACEMENTS: tuple[Placement, ...] = ("card", "panorama")
WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class PaintedLight:
    """A painted light. name: by which the user knows it.

    azimuth, elevation: degrees, where its middle is seen; of a sky its sun. width, height: degrees, the angles that it
    covers, at most 170 of a box or an image, which are flat cards at a distance; of a disc width alone, and of a
    gradient the angle from one end to the other. rotation: degrees by which it is turned counter-clockwise, as seen.
    softness: the share of its half size over which it fades at the rim, 0 for a hard one; of a gradient how gently it
    begins and ends. radiance: linear Rec. 709; it multiplies a sky and an image. far: that at the other end of a
    gradient. opacity: the share of what is below that it covers, and of itself that is seen.

    turbidity, ground, sun, diameter: of a sky, haze (2 to 10), the ground's albedo, a factor of its sun, and that sun's
    size in degrees. file, placement: of an image, an absolute path, and whether it is a card or surrounds the scene.
    gain: what the mix of lights makes of it; no part of what the user edits.
    """

    name: str
    kind: PaintedKind = "box"
    blend: Blend = "add"
    azimuth: float = 0.0
    elevation: float = 40.0
    width: float = 40.0
    height: float = 40.0
    rotation: float = 0.0
    softness: float = 0.2
    radiance: RGB = (4.0, 4.0, 4.0)
    far: RGB = (0.0, 0.0, 0.0)
    opacity: float = 1.0
    turbidity: float = 3.0
    ground: RGB = (0.2, 0.2, 0.2)
    sun: float = 1.0
    diameter: float = SUN_DIAMETER
    file: str = ""
    placement: Placement = "card"
    gain: RGB = WHITE

    @property
    def covers(self) -> bool:
        """Whether it covers what is below it."""
        return self.blend == "cover"

    @property
    def surrounds(self) -> bool:
        """Whether it is seen in all directions."""
        return self.kind in ("gradient", "sky") or self.kind == "image" and self.placement == "panorama"

    @property
    def least_size(self) -> float:
        """The smallest angle of what it shows, degrees."""
        if self.kind == "sky":
            return self.diameter if self.sun > 0.0 else 180.0
        if self.kind == "disc":
            return self.width
        if self.surrounds:
            return 180.0
        return min(self.width, self.height)

    @property
    def colour(self) -> RGB:
        """Its radiance times its gain."""
        red, green, blue = (own * gain for own, gain in zip(self.radiance, self.gain, strict=True))
        return red, green, blue

    @property
    def frame(self) -> NDArray[np.float64]:
        """(3, 3): the directions, in the environment's frame, of its right, of its top, and towards it."""
        across, up, turn = (math.radians(each) for each in (self.azimuth, self.elevation, self.rotation))
        towards = np.array([math.cos(up) * math.sin(across), math.sin(up), -math.cos(up) * math.cos(across)])
        right = np.array([math.cos(across), 0.0, math.sin(across)])
        top = np.cross(right, towards)
        return np.array([
            math.cos(turn) * right + math.sin(turn) * top, math.cos(turn) * top - math.sin(turn) * right, towards
        ])  # fmt: skip

    def alone(self) -> tuple[PaintedLight, RGB]:
        """The same light of strength 1, and the colour by which that is multiplied to have this one's radiance. A
        gradient has two colours, which stay its own."""
        if self.kind == "gradient":
            return replace(self, gain=WHITE), self.gain
        return replace(self, gain=WHITE, radiance=WHITE), self.colour

    def scaled(self, factor: float) -> PaintedLight:
        """The same, brighter by a factor."""
        if factor == 1.0:
            return self
        red, green, blue = self.gain
        return replace(self, gain=(factor * red, factor * green, factor * blue))

    def dark(self) -> PaintedLight:
        """The same without its radiance: it covers what is below it."""
        return replace(self, gain=(0.0, 0.0, 0.0))


def angles_in_environment(direction: ArrayLike, rotation: float, tilt: float) -> tuple[float, float]:
    """Azimuth and elevation, degrees, in an environment that is turned and tilted, of a direction in the world."""
    towards = np.asarray(direction, np.float64)
    x, y, z = tilt_matrix(tilt).T @ turn_matrix(-rotation) @ (towards / np.linalg.norm(towards))
    return math.degrees(math.atan2(x, -z)), math.degrees(math.atan2(y, math.hypot(x, z)))


def world_directions(directions: ArrayLike, rotation: float, tilt: float) -> NDArray[np.float64]:
    """Directions (..., 3) of the environment as they are in the world, where it is tilted, then turned."""
    return np.asarray(np.asarray(directions, np.float64) @ (turn_matrix(rotation) @ tilt_matrix(tilt)).T)


def turn_matrix(degrees: float) -> NDArray[np.float64]:
    """(3, 3): the rotation about +Y that turns an environment, counter-clockwise as seen from above."""
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def tilt_matrix(degrees: float) -> NDArray[np.float64]:
    """(3, 3): the rotation about +X that tilts an environment. What is at its middle, -Z, rises by so many degrees."""
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
