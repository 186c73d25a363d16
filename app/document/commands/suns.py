"""The edits of suns: which there are, where they are seen, how strong they are and how large."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, cast

from app.document.document import Document
from app.document.light_state import NO_SUNS, RGB, LightState, sun_key
from app.document.scene_objects import checked_new_name, numbered_name, taken_names
from app.document.targets import SUN_FIELDS, check_presence
from engine.core.errors import InsituError, list_names
from engine.light.suns import SUN_DIAMETER, Sun
from engine.material.parameters import Parameter, ParameterError
from engine.scene.composition import SUN
from engine.scene.description import MAX_SUNS, Camera

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


# Of a sun that is added: a surface that faces it is as bright as under a sky of radiance 1, lit from the camera's
# upper left.
_ADDED_IRRADIANCE, _ADDED_ELEVATION, _ADDED_ASIDE = math.pi, 45.0, 135.0


@dataclass(frozen=True)
class AddSun:
    """Add a sun behind the others. name: "" for "sun", with a number where that is taken; direction: towards it in the
    world, None for 45 degrees high, from the upper left of a camera that looks along -Z; diameter: degrees."""

    name: str = ""
    direction: RGB | None = None
    diameter: float = SUN_DIAMETER

    @property
    def label(self) -> str:
        return "add sun"

    def seen_from(self, camera: Camera) -> AddSun:
        """The same, from the upper left of a camera, unless it has a direction."""
        x, _, z = (t - p for t, p in zip(camera.target, camera.position, strict=True))
        heading = math.degrees(math.atan2(x, -z)) if math.hypot(x, z) > 1e-9 else 0.0
        return self if self.direction else replace(self, direction=_from_upper_left(heading))

    def apply(self, document: Document) -> Document:
        _check_room(document)
        taken = taken_names(document)
        name = checked_sun_name(document, self.name) if self.name else SUN
        name = numbered_name(name, taken) if not self.name and name in taken else name
        x, y, z = cast(RGB, DIRECTION.accept(self.direction or _from_upper_left(0.0)))
        direction = _unit((x, y, z), self.direction)
        diameter = cast(float, DIAMETER.accept(self.diameter))
        sun = Sun(in_environment(direction, document.light), (_ADDED_IRRADIANCE,) * 3, diameter, name)
        return replace(document, light=document.light.with_suns((*document.light.suns, sun)))


@dataclass(frozen=True)
class DuplicateSun:
    """Add a duplicate behind a sun, in its place, with a row of its own in the mix. name: "" for the sun's with the
    next number."""

    sun: str
    name: str = ""

    @property
    def label(self) -> str:
        return f"duplicate {self.sun}"

    def apply(self, document: Document) -> Document:
        sun, light = sun_named(document, self.sun), document.light
        _check_room(document)
        name = checked_sun_name(document, self.name) if self.name else numbered_name(sun.name, taken_names(document))
        place = light.suns.index(sun) + 1
        suns = (*light.suns[:place], sun._replace(name=name), *light.suns[place:])
        return replace(document, light=light.with_suns(suns).with_duplicate(sun_key(name), sun_key(sun.name)))


@dataclass(frozen=True)
class DeleteSun:
    """Delete a sun, with its row in the mix."""

    sun: str

    @property
    def label(self) -> str:
        return f"delete {self.sun}"

    def apply(self, document: Document) -> Document:
        sun, light = sun_named(document, self.sun), document.light
        without = light.with_suns(each for each in light.suns if each is not sun)
        return replace(document, light=without.without_object(sun_key(sun.name)))


@dataclass(frozen=True)
class RenameSun:
    """Give a sun another name, with its row in the mix. One of the scene's file no longer follows this then."""

    sun: str
    name: str

    @property
    def label(self) -> str:
        return f"rename {self.sun}"

    def apply(self, document: Document) -> Document:
        sun_named(document, self.sun)
        if self.name == self.sun:
            return document
        name = checked_sun_name(document, self.name)
        return replace(document, light=document.light.with_renamed_sun(self.sun, name))


@dataclass(frozen=True)
class SetSun:
    """Set a sun's `direction` (three numbers), `azimuth` or `elevation` (degrees), `irradiance` (W/m², three numbers or
    one) or `diameter` (degrees)."""

    sun: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.sun} {self.name}"

    def apply(self, document: Document) -> Document:
        sun, light = sun_named(document, self.sun), document.light
        suns = (self._changed(each) if each is sun else each for each in light.suns)
        return replace(document, light=light.with_suns(suns))

    def _changed(self, sun: Sun) -> Sun:
        match self.name:
            case "direction":
                return sun._replace(direction=_unit(cast(RGB, DIRECTION.accept(self.value)), self.value))
            case "azimuth":
                _, elevation = angles_of(sun.direction)
                return sun._replace(direction=direction_of(cast(float, AZIMUTH.accept(self.value)), elevation))
            case "elevation":
                azimuth, _ = angles_of(sun.direction)
                return sun._replace(direction=direction_of(azimuth, cast(float, ELEVATION.accept(self.value))))
            case "irradiance":
                return sun._replace(irradiance=cast(RGB, IRRADIANCE.accept(self.value)))
            case "diameter":
                return sun._replace(diameter=cast(float, DIAMETER.accept(self.value)))
        raise InsituError(f"a sun has no {self.name!r}; it has {list_names(SUN_FIELDS)}")


def sun_named(document: Document, name: str) -> Sun:
    """The sun of this name. Raises InsituError with the names that there are."""
    for sun in document.light.suns:
        if sun.name == name:
            return sun
    there = ", ".join(each.name for each in document.light.suns) or "none"
    raise InsituError(f"there is no sun {name!r}; available: {there}")


def checked_sun_name(document: Document, name: str) -> str:
    """A name for another sun. Raises InsituError."""
    if name in NO_SUNS:
        raise InsituError(f"name = {name!r}, expected another: a part of the light is called so")
    return checked_new_name(document, name)


def sun_addition(name: str, at: object = None, size: float | None = None) -> AddSun:
    """The command that adds a sun of this name and size in degrees. Raises InsituError where it is to have a place."""
    if at is not None:
        raise InsituError(f"at = {at!r}, expected none: a sun is far away; its azimuth and elevation say where")
    return AddSun(name, diameter=SUN_DIAMETER if size is None else size)


def sun_presence(path: str, sun: str, field: str, value: Any) -> DuplicateSun | DeleteSun | RenameSun:
    """The command that a sun's `name`, `duplicate` (the name of a new one) or `deleted` (true) stands for, by a value
    from a file or a command line. Raises LoadError."""
    check_presence(path, field, value)
    if field == "deleted":
        return DeleteSun(sun)
    return RenameSun(sun, value) if field == "name" else DuplicateSun(sun, value)


def in_world(direction: RGB, light: LightState) -> RGB:
    """A direction of the environment's frame in the world: tilted about +X, then rotated counter-clockwise about +Y."""
    return _turned(_tilted(direction, light.tilt), light.rotation)


def in_environment(direction: RGB, light: LightState) -> RGB:
    """A direction of the world in the environment's frame."""
    return _tilted(_turned(direction, -light.rotation), -light.tilt)


def _turned(direction: RGB, degrees: float) -> RGB:
    x, y, z = direction
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return cosine * x + sine * z, y, cosine * z - sine * x


def _tilted(direction: RGB, degrees: float) -> RGB:
    x, y, z = direction
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return x, cosine * y - sine * z, sine * y + cosine * z


def _from_upper_left(heading: float) -> RGB:
    return direction_of(heading - _ADDED_ASIDE, _ADDED_ELEVATION)


def _unit(direction: RGB, given: Any) -> RGB:
    """A direction of length 1. Raises ParameterError where there is none."""
    x, y, z = direction
    length = math.hypot(x, y, z)
    if not length > 1e-9:
        raise ParameterError("direction", given, "a direction other than 0 0 0")
    return x / length, y / length, z / length


def _check_room(document: Document) -> None:
    if len(document.light.suns) >= MAX_SUNS:
        raise InsituError(f"no sun is added: there are at most {MAX_SUNS}")


def angles_of(direction: RGB) -> tuple[float, float]:
    """Azimuth and elevation in degrees of a direction, as a lat-long map has them: 0 is -Z, 90 is +X."""
    x, y, z = direction
    return math.degrees(math.atan2(x, -z)), math.degrees(math.atan2(y, math.hypot(x, z)))


def direction_of(azimuth: float, elevation: float) -> RGB:
    """The unit direction with these angles in degrees."""
    across, up = math.radians(azimuth), math.radians(elevation)
    return math.cos(up) * math.sin(across), math.sin(up), -math.cos(up) * math.cos(across)
