"""The edits of suns: where they are seen, how strong they are and how large."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, cast

from app.document.document import Document
from app.document.light_state import RGB
from engine.core.errors import InsituError
from engine.light.suns import SUN_DIAMETER, Sun
from engine.material.parameters import Parameter, ParameterError

DIRECTION = Parameter(
    "direction",
    "rgb",
    (0.0, 1.0, 0.0),
    "Direction",
    "Towards the sun, before the light is rotated.",
    minimum=-1e9,
    maximum=1e9,
)
AZIMUTH = Parameter(
    "azimuth",
    "scalar",
    0.0,
    "Azimuth",
    "Where the sun stands around the scene, before the light is rotated: 0° is -Z, 90° is +X.",
    minimum=-1e9,
    maximum=1e9,
    soft=(-180.0, 180.0),
    form="%.1f°",
)
ELEVATION = Parameter(
    "elevation",
    "scalar",
    45.0,
    "Elevation",
    "How high the sun stands over the horizon.",
    minimum=-90.0,
    maximum=90.0,
    form="%.1f°",
)
IRRADIANCE = Parameter(
    "irradiance",
    "rgb",
    (1.0, 1.0, 1.0),
    "Irradiance",
    "Irradiance of a surface that faces the sun, per channel, in W/m²; 1 W/m² is 683 lux.",
    maximum=1e9,
    logarithmic=True,
    form="%.4g",
)
STRENGTH = Parameter(
    "strength",
    "scalar",
    1.0,
    "Irradiance",
    "Irradiance of a surface that faces the sun, of the brightest channel; 1 W/m² is 683 lux.",
    minimum=0.001,
    maximum=1e5,
    unit="W/m²",
    logarithmic=True,
)
DIAMETER = Parameter(
    "diameter",
    "scalar",
    SUN_DIAMETER,
    "Size",
    "The angle that the sun's disc covers; the larger, the softer are shadows. Its irradiance stays.",
    minimum=0.1,
    maximum=90.0,
    logarithmic=True,
    form="%.3g°",
)


@dataclass(frozen=True)
class SetSun:
    """Set a sun's `direction` (three numbers), `irradiance` (W/m², three numbers or one) or `diameter` (degrees)."""

    sun: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.sun} {self.name}"

    def apply(self, document: Document) -> Document:
        light = document.light
        if all(each.name != self.sun for each in light.suns):
            there = ", ".join(each.name for each in light.suns) or "none"
            raise InsituError(f"there is no sun {self.sun!r}; available: {there}")
        suns = tuple(self._changed(each) if each.name == self.sun else each for each in light.suns)
        return replace(document, light=replace(light, new_suns=None if suns == light.own_suns else suns))

    def _changed(self, sun: Sun) -> Sun:
        match self.name:
            case "direction":
                x, y, z = cast(RGB, DIRECTION.accept(self.value))
                length = math.hypot(x, y, z)
                if not length > 1e-9:
                    raise ParameterError(self.name, self.value, "a direction other than 0 0 0")
                return sun._replace(direction=(x / length, y / length, z / length))
            case "irradiance":
                return sun._replace(irradiance=cast(RGB, IRRADIANCE.accept(self.value)))
            case "diameter":
                return sun._replace(diameter=cast(float, DIAMETER.accept(self.value)))
        raise InsituError(f"a sun has no {self.name!r}; it has direction, irradiance and diameter")


def angles_of(direction: RGB) -> tuple[float, float]:
    """Azimuth and elevation in degrees of a direction, as a lat-long map has them: 0 is -Z, 90 is +X."""
    x, y, z = direction
    return math.degrees(math.atan2(x, -z)), math.degrees(math.atan2(y, math.hypot(x, z)))


def direction_of(azimuth: float, elevation: float) -> RGB:
    """The unit direction with these angles in degrees."""
    across, up = math.radians(azimuth), math.radians(elevation)
    return math.cos(up) * math.sin(across), math.sin(up), -math.cos(up) * math.cos(across)
