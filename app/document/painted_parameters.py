"""What can be set of painted lights: the parameters of each kind, which panels, sessions, scripts and paths share."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from app.document.sources import IMAGE_SUFFIXES, LIGHT_ENDINGS, probe_size
from engine.core.errors import InsituError, LoadError, list_names
from engine.light.daylight import LEAST_TURBIDITY, MOST_TURBIDITY
from engine.light.painted_lights import BLENDS, PAINTED_KINDS, PLACEMENTS, PaintedKind, PaintedLight
from engine.light.suns import SUN_DIAMETER
from engine.material.parameters import Parameter, ParameterError

MOST_LETTERS = 64
_NOT_IN_NAMES = ".\"'[]="
MOST_CARD_DEGREES = 170.0
PAINTED_IMAGE_ENDINGS = tuple(dict.fromkeys((*LIGHT_ENDINGS, *IMAGE_SUFFIXES)))
NAME, FILE = "name", "file"
TITLES: Mapping[str, str] = {
    "box": "Soft box", "disc": "Disc", "gradient": "Gradient", "sky": "Sun and sky", "image": "Image",
}  # fmt: skip

_ANGLES = {"minimum": -1e9, "maximum": 1e9, "form": "%.1f°"}
_RADIANCE: dict[str, Any] = {"maximum": 1e9, "logarithmic": True, "form": "%.4g"}
AZIMUTH = Parameter(
    "azimuth", "scalar", 0.0, "Azimuth",
    "Where its middle is around the scene, before the environment is tilted and turned: 0° is -Z, 90° is +X.",
    soft=(-180.0, 180.0), **_ANGLES,  # type: ignore[arg-type]
)  # fmt: skip
ELEVATION = Parameter(
    "elevation", "scalar", 40.0, "Elevation", "How high its middle is over the horizon.", minimum=-90.0, maximum=90.0,
    form="%.1f°",
)  # fmt: skip
ROTATION = Parameter(
    "rotation", "scalar", 0.0, "Rotation", "Turns it about its middle, counter-clockwise as seen from the scene.",
    soft=(-180.0, 180.0), **_ANGLES,  # type: ignore[arg-type]
)  # fmt: skip
WIDTH = Parameter(
    "width", "scalar", 40.0, "Width", "The angle that it covers from side to side.", minimum=0.5,
    maximum=MOST_CARD_DEGREES, form="%.1f°",
)  # fmt: skip
HEIGHT = replace(WIDTH, name="height", label="Height", tooltip="The angle that it covers from top to bottom.")
SIZE = replace(WIDTH, label="Size", tooltip="The angle that the disc covers.", maximum=360.0, soft=(0.5, 180.0))
REACH = Parameter(
    "width", "scalar", 180.0, "Reach", "The angle from its middle to where it has the colour of its far end.",
    minimum=1.0, maximum=180.0, form="%.1f°",
)  # fmt: skip
SOFTNESS = Parameter(
    "softness", "scalar", 0.2, "Softness", "The share of its half size over which it fades at the rim; 0 is hard.",
    form="%.2f",
)  # fmt: skip
SMOOTHNESS = replace(
    SOFTNESS, label="Smoothness", default=0.0, tooltip="0: an even ramp; 1: it begins and ends gently."
)
RADIANCE = Parameter(
    "radiance", "rgb", (4.0, 4.0, 4.0), "Radiance", "Its radiance, per channel, before its row in the mix.", **_RADIANCE
)  # fmt: skip
FACTOR = replace(RADIANCE, label="Factor", default=(1.0, 1.0, 1.0), tooltip="Multiplies its radiance, per channel.")
SKY_FACTOR = replace(
    FACTOR, default=(0.1, 0.1, 0.1),
    tooltip="Multiplies its radiance, per channel: at 1 the sun has its real strength, 100,000 lux.",
)  # fmt: skip
FAR = replace(RADIANCE, name="far", label="Far end", default=(0.0, 0.0, 0.0), tooltip="Radiance at its far end.")
OPACITY = Parameter(
    "opacity", "scalar", 1.0, "Opacity", "The share of it that is seen, and of what is below that it covers.",
    form="%.2f",
)  # fmt: skip
BLEND = Parameter(
    "blend", "choice", "add", "Blend", "Whether it adds its light to what is below it, or covers that as a card does.",
    choices=BLENDS, titles=("Add", "Cover"),
)  # fmt: skip
TURBIDITY = Parameter(
    "turbidity", "scalar", 3.0, "Haze", "Turbidity of the air: 2 is clear, 10 is hazy.", minimum=LEAST_TURBIDITY,
    maximum=MOST_TURBIDITY, form="%.1f",
)  # fmt: skip
GROUND = Parameter(
    "ground", "rgb", (0.2, 0.2, 0.2), "Ground", "Albedo of the ground, which sky and sun light.", form="%.3f"
)
SUN = Parameter(
    "sun", "scalar", 1.0, "Sun", "Multiplies the sun; 0 leaves it out.", maximum=100.0, soft=(0.0, 2.0), form="× %.3g"
)
DIAMETER = Parameter(
    "diameter", "scalar", SUN_DIAMETER, "Sun's size", "The angle that the sun covers; its irradiance stays.",
    minimum=0.1, maximum=30.0, logarithmic=True, form="%.3g°",
)  # fmt: skip
PLACEMENT = Parameter(
    "placement", "choice", "card", "Shape", "A flat card at a distance, or a panorama all around.", choices=PLACEMENTS,
    titles=("Card", "Panorama"),
)  # fmt: skip
_SUN_AZIMUTH = replace(AZIMUTH, tooltip="Where the sun is around the scene: 0° is -Z, 90° is +X.")
_SUN_ELEVATION = replace(ELEVATION, default=35.0, tooltip="How high the sun stands over the horizon.")
_ENDS = replace(BLEND, default="cover")
_OF_KIND: Mapping[PaintedKind, tuple[Parameter, ...]] = {
    "box": (AZIMUTH, ELEVATION, WIDTH, HEIGHT, ROTATION, SOFTNESS, RADIANCE, BLEND, OPACITY),
    "disc": (AZIMUTH, ELEVATION, replace(SIZE, default=20.0), SOFTNESS, RADIANCE, BLEND, OPACITY),
    "gradient": (
        AZIMUTH, replace(ELEVATION, default=90.0), REACH, SMOOTHNESS, replace(RADIANCE, default=(1.0, 1.0, 1.0)), FAR,
        BLEND, OPACITY,
    ),
    "sky": (_SUN_AZIMUTH, _SUN_ELEVATION, TURBIDITY, SUN, DIAMETER, GROUND, SKY_FACTOR, _ENDS, OPACITY),
    "image": (
        PLACEMENT, AZIMUTH, replace(ELEVATION, default=0.0), WIDTH, HEIGHT, ROTATION, replace(SOFTNESS, default=0.0),
        FACTOR, _ENDS, OPACITY,
    ),
}  # fmt: skip
_HEAD_BYTES = 1 << 20
_CARD_ONLY = ("width", "height", "softness")


def parameters_of(kind: PaintedKind, placement: str = "card") -> dict[str, Parameter]:
    """The parameters of a kind of painted lights, by their names. placement: of an image."""
    hidden = _CARD_ONLY if kind == "image" and placement == "panorama" else ()
    return {each.name: each for each in _OF_KIND[kind] if each.name not in hidden}


def _plain(kind: PaintedKind, name: Any) -> PaintedLight:
    """A painted light with all its values as they are at first."""
    defaults: dict[str, Any] = {each.name: each.default for each in _OF_KIND[kind]}
    return replace(PaintedLight(_checked_name(name), kind), **defaults)


def new_painted(kind: PaintedKind, name: str, values: Mapping[str, Any] | None = None) -> PaintedLight:
    """A painted light as it is at first, with these values. Raises InsituError."""
    if kind not in PAINTED_KINDS:
        raise LoadError("painted light", "kind", kind, f"one of {', '.join(PAINTED_KINDS)}")
    given = dict(values or {})
    light = _plain(kind, name)
    if kind == "image":
        light = replace(light, **_image_values(given.pop(FILE, "")))
    if "placement" in given:
        light = changed_painted(light, "placement", given.pop("placement"))
    for field, value in given.items():
        light = changed_painted(light, field, value)
    return light


def restored_painted(kind: PaintedKind, name: str, values: Mapping[str, Any]) -> PaintedLight:
    """A painted light of a session: an image's size is not read again. Raises InsituError."""
    given = dict(values)
    light = _plain(kind, name)
    if kind == "image":
        light = replace(light, file=_checked_file(given.pop(FILE, "")))
    all_of_them = {each.name: each for each in _OF_KIND[kind]}
    for field, value in given.items():
        if field not in all_of_them:
            raise InsituError(f"a painted {kind} has no {field!r}; it has {list_names(list(all_of_them))}")
        light = replace(light, **{field: cast(Any, all_of_them[field].accept(value))})
    return light


def changed_painted(light: PaintedLight, name: str, value: Any) -> PaintedLight:
    """A painted light with another value. Raises InsituError for one that it does not accept."""
    if name == NAME:
        return replace(light, name=_checked_name(value))
    if name == FILE and light.kind == "image":
        return replace(light, file=_checked_file(value))
    parameters = parameters_of(light.kind, light.placement)
    if name not in parameters:
        there = [NAME, *((FILE,) if light.kind == "image" else ()), *parameters]
        raise InsituError(f"{light.name} is a painted {light.kind} and has no {name!r}; it has {list_names(there)}")
    found = cast(Any, parameters[name].accept(value))
    if name in ("azimuth", "rotation"):
        found = math.remainder(found, 360.0)
    return replace(light, **{name: found})


def painted_values(light: PaintedLight) -> dict[str, Any]:
    """What makes a painted light again: its name, kind, file and the values of its parameters."""
    file = {FILE: light.file} if light.kind == "image" else {}
    own = {each.name: getattr(light, each.name) for each in _OF_KIND[light.kind]}
    return {NAME: light.name, "kind": light.kind, **file, **own}


def _image_values(file: Any) -> dict[str, Any]:
    """The file, shape and height of an image that is painted anew."""
    path = _checked_file(file)
    is_light = Path(path).suffix.lower() in LIGHT_ENDINGS
    size = probe_size(Path(path)) if is_light else _picture_size(Path(path))
    if size is None:
        return {FILE: path}
    if is_light and size[0] == 2 * size[1]:
        return {FILE: path, "placement": "panorama"}
    half = math.tan(math.radians(WIDTH.default / 2.0)) * size[1] / size[0]  # type: ignore[operator]
    height = math.degrees(2.0 * math.atan(half))
    return {FILE: path, "height": min(max(height, WIDTH.minimum), MOST_CARD_DEGREES)}


def _picture_size(file: Path) -> tuple[int, int] | None:
    """(width, height) of a picture, by its header; None where it cannot be read: whoever paints it says why."""
    from engine.texture.texture_files import image_size

    if not os.path.isfile(file):
        return None
    try:
        with file.open("rb") as stream:
            return image_size(stream.read(_HEAD_BYTES), file)
    except (OSError, InsituError):
        return None


def _checked_name(value: Any) -> str:
    is_text = isinstance(value, str) and 0 < len(value.strip()) <= MOST_LETTERS and value.isprintable()
    if not is_text or any(each in _NOT_IN_NAMES for each in value):
        raise ParameterError(NAME, value, f"a name of 1 to {MOST_LETTERS} letters, none of {' '.join(_NOT_IN_NAMES)}")
    return value.strip()


def _checked_file(value: Any) -> str:
    if not isinstance(value, str) or Path(value).suffix.lower() not in PAINTED_IMAGE_ENDINGS:
        raise ParameterError(FILE, value, f"an image ({', '.join(PAINTED_IMAGE_ENDINGS)})")
    return value
