"""The edits of the light, and of what is seen behind all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from app.document.background import BACKGROUND_KINDS, Background, BackgroundKind
from app.document.document import Document
from app.document.light_state import RGB, LightState, side_key
from app.document.linked_objects import frozen_one
from app.document.sources import likely_mapping, probe_size
from engine.core.errors import InsituError, LoadError
from engine.core.safe_files import resolved
from engine.light.probe_mappings import MAPPINGS, Mapping, mapping_problem
from engine.light.sides import SIDES
from engine.material.parameters import Parameter, ParameterError

ROTATION = Parameter(
    "rotation",
    "scalar",
    0.0,
    "Rotation",
    "Turns the light around the scene, counter-clockwise from above. So does Shift-drag in the picture.",
    minimum=-1e9,
    maximum=1e9,
    soft=(0.0, 360.0),
    form="%.1f°",
)
INTENSITY = Parameter(
    "intensity",
    "scalar",
    1.0,
    "Intensity",
    "Multiplies all light in the scene. Free: the picture is only scaled.",
    maximum=1e6,
    soft=(0.01, 100.0),
    logarithmic=True,
    form="× %.3g",
)
MAPPING = Parameter(
    "mapping",
    "choice",
    "latlong",
    "Mapping",
    "How the file is read.",
    choices=MAPPINGS,
    titles=("Lat-long", "Angular map", "Mirroring ball", "Cube map"),
)
_AS: dict[Mapping, str] = {
    "latlong": "a lat-long map",
    "angular": "an angular map",
    "ball": "a mirroring ball",
    "cube": "a cube map",
}
TILT = Parameter(
    "tilt",
    "scalar",
    0.0,
    "Tilt",
    "Raises what is in the middle of the environment, before it is turned; suns and painted lights tilt with it.",
    minimum=-180.0,
    maximum=180.0,
    soft=(-90.0, 90.0),
    form="%.1f°",
)
HUE = Parameter(
    "hue",
    "scalar",
    0.0,
    "Hue",
    "Turns the colours of the map about grey; their luminance stays. Painted lights keep theirs.",
    minimum=-180.0,
    maximum=180.0,
    form="%.1f°",
)
CONTRAST = Parameter(
    "contrast",
    "scalar",
    1.0,
    "Contrast",
    "Exponent of the map's luminance about its mean: above 1 what is bright becomes brighter, below 1 it evens out.",
    maximum=3.0,
    soft=(0.0, 2.0),
    form="%.2f",
)
CLAMP = Parameter(
    "clamp",
    "scalar",
    0.0,
    "Clamp",
    "The largest radiance of the map; what is brighter keeps its colour. 0 is no limit.",
    maximum=1e9,
    soft=(0.0, 100.0),
    form="%.3g",
)
# What changes the map as a whole, by the names of its paths.
MAP_PARAMETERS = {each.name: each for each in (TILT, HUE, CONTRAST, CLAMP)}
BACKGROUND = Parameter(
    "background",
    "choice",
    "environment",
    "Background",
    "What is seen behind all: it changes no light. Transparent pictures have alpha.",
    choices=BACKGROUND_KINDS,
    titles=("Environment", "Colour", "Transparent"),
)
BACKGROUND_COLOUR = Parameter(
    "background_colour",
    "rgb",
    (0.8, 0.8, 0.8),
    "Colour",
    "Radiance behind all, per channel, which the intensity of the light does not multiply.",
    maximum=100.0,
    soft=(0.0, 1.0),
    form="%.3f",
)
RADIANCE = Parameter("radiance", "scalar", 1.0, "Radiance", "Radiance from everywhere, of a channel.", maximum=1e12)
EMISSION = Parameter(
    "emission",
    "rgb",
    (1.0, 1.0, 1.0),
    "Emission",
    "Radiance of the light's surface, per channel: how bright it is, and how much it lights the scene.",
    maximum=1e9,
    logarithmic=True,
    form="%.4g",
)
STRENGTH = Parameter(
    "strength",
    "scalar",
    1.0,
    "Strength",
    "Radiance of the brightest channel. The light itself follows at once.",
    minimum=0.01,
    maximum=1e5,
    logarithmic=True,
)


@dataclass(frozen=True)
class SetRotation:
    """Rotate the environment to ``degrees`` counter-clockwise about +Y; wrapped to [0, 360)."""

    degrees: float

    @property
    def label(self) -> str:
        return "rotate the environment"

    def apply(self, document: Document) -> Document:
        degrees = _number("light.rotation", ROTATION, self.degrees) % 360.0
        return replace(document, light=replace(document.light, rotation=0.0 if degrees == 360.0 else degrees))


@dataclass(frozen=True)
class SetMapChange:
    """Set the environment's `tilt`, or its map's `hue`, `contrast` or `clamp`."""

    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"environment {self.name}"

    def apply(self, document: Document) -> Document:
        value = _number(f"light.{self.name}", MAP_PARAMETERS[self.name], self.value)
        changed: dict[str, Any] = {self.name: value}
        return replace(document, light=replace(document.light, **changed))


@dataclass(frozen=True)
class SplitEnvironment:
    """Split the environment's map into six sides, lights of their own, or make it one light again, whose row stays."""

    is_split: bool

    @property
    def label(self) -> str:
        return "split the environment" if self.is_split else "join the environment's sides"

    def apply(self, document: Document) -> Document:
        if not isinstance(self.is_split, bool):
            raise LoadError("light.sides", "value", self.is_split, "true or false")
        light = document.light
        rows = {key: row for key, row in light.mix if key not in map(side_key, SIDES)}
        return replace(document, light=replace(light, sides=self.is_split).with_rows(rows))


@dataclass(frozen=True)
class SetIntensity:
    """Multiply all light by ``intensity``."""

    intensity: float

    @property
    def label(self) -> str:
        return "light intensity"

    def apply(self, document: Document) -> Document:
        value = _number("light.intensity", INTENSITY, self.intensity)
        return replace(document, light=replace(document.light, intensity=value))


@dataclass(frozen=True)
class SetEnvironment:
    """Light the scene by another environment, or one radiance from everywhere; rotation and intensity stay."""

    environment: str
    mapping: Mapping = "latlong"
    radiance: tuple[float, float, float] | None = None

    @property
    def label(self) -> str:
        return f"environment {self.environment}"

    def apply(self, document: Document) -> Document:
        changed = replace(document.light, environment=self.environment, mapping=self.mapping, radiance=self.radiance)
        return replace(document, light=check_light(changed, "light"))


def set_environment_file(file: Path) -> SetEnvironment:
    """Light the scene by a file, read as its size suggests."""
    return SetEnvironment(str(resolved(file)), likely_mapping(file))


@dataclass(frozen=True)
class SetMapping:
    """Read the environment's file as a lat-long map, as a light probe or as a cube map (`engine.light.probe_mappings`).

    Refused for environments that are no file of the user's, and for a file whose size is not that of the mapping: its
    header is checked here, so that an impossible picture is never requested.
    """

    mapping: Mapping

    @property
    def label(self) -> str:
        return f"environment as {_AS[self.mapping]}"

    def apply(self, document: Document) -> Document:
        light = check_light(replace(document.light, mapping=self.mapping), "light")
        if not light.is_file:
            raise InsituError(
                f"environment {light.environment!r} has a mapping of its own; only a file's can be chosen"
            )
        file = Path(light.environment)
        size = probe_size(file)
        if size is not None and (expected := mapping_problem(self.mapping, *size)):
            raise InsituError(f"{file.name} has {size[0]} x {size[1]} pixels, expected {expected}; nothing changed")
        return replace(document, light=light)


@dataclass(frozen=True)
class SetBackground:
    """Set what is seen behind all: one of `BACKGROUND_KINDS`."""

    kind: BackgroundKind

    @property
    def label(self) -> str:
        return f"background {self.kind}"

    def apply(self, document: Document) -> Document:
        if self.kind not in BACKGROUND_KINDS:
            raise LoadError("light.background", "value", self.kind, f"one of {', '.join(BACKGROUND_KINDS)}")
        return replace(document, background=replace(document.background, kind=self.kind))


@dataclass(frozen=True)
class SetBackgroundColour:
    """Set the colour behind all, and show it."""

    colour: Any

    @property
    def label(self) -> str:
        return "background colour"

    def apply(self, document: Document) -> Document:
        try:
            red, green, blue = cast(RGB, BACKGROUND_COLOUR.accept(self.colour))
        except ParameterError:
            expected = BACKGROUND_COLOUR.expected
            raise LoadError("light.background_colour", "value", self.colour, expected) from None
        return replace(document, background=Background("colour", (red, green, blue)))


@dataclass(frozen=True)
class SetEmission:
    """Set the radiance of an emitter: three numbers, or one for all."""

    object: str
    emission: Any

    @property
    def label(self) -> str:
        return f"{self.object} emission"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        if not state.emits:
            raise InsituError(f"{self.object} is not an emitter; the scene file says which objects are")
        if frozen := frozen_one(document, self.object):
            raise InsituError(f"{frozen} is frozen; thaw it to change its light")
        red, green, blue = cast(RGB, EMISSION.accept(self.emission))
        return document.with_object(replace(state, emission=(red, green, blue)))


def check_light(light: LightState, where: str) -> LightState:
    """The light itself when all of it is valid, else LoadError."""
    if not light.environment:
        raise LoadError(where, "environment", light.environment, "a name or a path")
    if light.mapping not in MAPPING.choices:
        raise LoadError(where, "mapping", light.mapping, " or ".join(MAPPING.choices))
    if (light.radiance is None) == (light.environment == "constant"):
        raise LoadError(where, "radiance", light.radiance, "a radiance with environment = constant, and only then")
    for value in light.radiance or ():
        _number(f"{where}.radiance", RADIANCE, value)
    _number(f"{where}.rotation", ROTATION, light.rotation)
    _number(f"{where}.intensity", INTENSITY, light.intensity)
    for name, parameter in MAP_PARAMETERS.items():
        _number(f"{where}.{name}", parameter, getattr(light, name))
    return light


def _number(where: str, parameter: Parameter, value: Any) -> float:
    try:
        return cast(float, parameter.accept(value))
    except ParameterError:
        raise LoadError(where, "value", value, parameter.expected) from None
