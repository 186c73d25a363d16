"""Maps in files, scripts and paths: their parts by name, each checked as it comes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, cast

from engine.core.plain_values import is_number
from engine.material.layer_maps import (
    CHANNELS,
    IDENTITY_TRANSFORM,
    MAX_REPEATS,
    MAX_UV_SETS,
    SPACES,
    TEXTURE_SCALE,
    TEXTURE_STRENGTH,
    WEIGHT_CHANNEL,
    WEIGHT_START,
    WRAPS,
    ChannelImage,
    FurtherWeight,
    LayerMaps,
    Space,
    TextureTransform,
    Wrap,
)
from engine.material.parameters import ParameterError
from engine.material.strokes import stroke_values, strokes_from

MAX_NAME = 4096
MOST_FURTHER_WEIGHTS = 8
# The keys of a channel of an image in files.
IMAGE_KEYS = ("map", "channel", "repeats", "offset", "rotation", "wrap", "uv_set")


def map_fields() -> tuple[str, ...]:
    """The names of `LayerMaps`' parts in scenes, sessions and paths."""
    return tuple(field.name for field in dataclasses.fields(LayerMaps) if field.name in _ACCEPTED)


def set_map_field(maps: LayerMaps, name: str, value: object) -> LayerMaps:
    """Set one part. Raises ParameterError for a value that the part does not accept."""
    if name not in _ACCEPTED:
        raise ParameterError(name, value, "one of " + ", ".join(_ACCEPTED))
    changes: dict[str, Any] = {name: _ACCEPTED[name](name, value)}
    return dataclasses.replace(maps, **changes)


def maps_from(values: Mapping[str, object]) -> LayerMaps:
    """Maps from parts by name, the others at their defaults. Raises ParameterError."""
    maps = LayerMaps()
    for name, value in values.items():
        maps = set_map_field(maps, name, value)
    return maps


def map_values(maps: LayerMaps) -> dict[str, Any]:
    """The parts that differ from the default, by name, for files."""
    plain = LayerMaps()
    found = {name: getattr(maps, name) for name in map_fields() if getattr(maps, name) != getattr(plain, name)}
    if maps.strokes:
        found["strokes"] = stroke_values(maps.strokes)
    if maps.further_weights:
        found["further_weights"] = [further_weight_table(each) for each in maps.further_weights]
    return found


def channel_image_from(name: str, table: Mapping[str, object]) -> ChannelImage:
    """An image's channel from `{map, channel, repeats, offset, rotation, wrap}`, of which only `map`, its file, is
    required. Raises ParameterError that names the key after `name`."""
    channel = table.get("channel", "grey")
    if channel not in CHANNELS:
        raise ParameterError(f"{name}: channel", channel, " or ".join(f'"{each}"' for each in CHANNELS))
    transform = TextureTransform(
        rotation_value(f"{name}: rotation", table.get("rotation", 0.0)),
        offset_value(f"{name}: offset", table.get("offset", IDENTITY_TRANSFORM.offset)),
        wrap_value(f"{name}: wrap", table.get("wrap", IDENTITY_TRANSFORM.wrap)),
        uv_set_value(f"{name}: uv_set", table.get("uv_set", 0)),
    )
    repeats = cast(tuple[float, float], TEXTURE_SCALE.accept(table.get("repeats", 1.0)))
    return ChannelImage(image_file_name(name, table.get("map")), channel, repeats, transform)


def channel_image_table(image: ChannelImage) -> dict[str, Any]:
    """The inverse; keys at their defaults are omitted."""
    plain = ChannelImage("")
    optional = {
        "channel": (image.channel, plain.channel), "repeats": (image.repeats, plain.repeats),
        "offset": (image.transform.offset, IDENTITY_TRANSFORM.offset),
        "rotation": (image.transform.rotation, 0.0), "wrap": (image.transform.wrap, IDENTITY_TRANSFORM.wrap),
        "uv_set": (image.transform.uv_set, 0),
    }  # fmt: skip
    return {"map": image.file} | {key: value for key, (value, default) in optional.items() if value != default}


def further_weight_table(further: FurtherWeight) -> dict[str, Any]:
    """The form in files."""
    return channel_image_table(further.image) | ({"invert": True} if further.invert else {})


def _further_weights(name: str, value: object) -> tuple[FurtherWeight, ...]:
    expected = f"up to {MOST_FURTHER_WEIGHTS} tables of map and, where they differ, {', '.join(IMAGE_KEYS[1:])}, invert"
    if not isinstance(value, (list, tuple)) or len(value) > MOST_FURTHER_WEIGHTS:
        raise ParameterError(name, value, expected)
    return tuple(_further_weight(name, each, expected) for each in value)


def _further_weight(name: str, table: object, expected: str) -> FurtherWeight:
    if isinstance(table, FurtherWeight):
        return table
    if not isinstance(table, Mapping) or not table.get("map") or not set(table) <= {*IMAGE_KEYS, "invert"}:
        raise ParameterError(name, table, expected)
    return FurtherWeight(channel_image_from(name, table), flag_value(f"{name}: invert", table.get("invert", False)))


def image_file_name(name: str, value: object) -> str:
    """The name of an image, "" for none. Raises ParameterError."""
    if isinstance(value, str) and len(value) <= MAX_NAME and value.isprintable():
        return value
    raise ParameterError(name, value, "the name of an image (PNG, JPEG or EXR), or nothing")


def _space(name: str, value: object) -> Space:
    for space in SPACES:
        if value == space:
            return space
    raise ParameterError(name, value, '"srgb" or "linear"')


def offset_value(name: str, value: object) -> tuple[float, float]:
    """Two numbers. Raises ParameterError."""
    if (
        isinstance(value, (list, tuple))
        and len(value) == 2
        and all(_is_finite(v) and abs(v) <= MAX_REPEATS for v in value)
    ):
        return float(value[0]), float(value[1])
    raise ParameterError(name, value, f"two numbers from {-MAX_REPEATS:g} to {MAX_REPEATS:g}")


def wrap_value(name: str, value: object) -> tuple[Wrap, Wrap]:
    """One of `WRAPS`, or two, along u and along v. Raises ParameterError."""
    pair = [value, value] if isinstance(value, str) else value
    if isinstance(pair, (list, tuple)) and len(pair) == 2 and all(each in WRAPS for each in pair):
        return pair[0], pair[1]
    raise ParameterError(name, value, "one or two of " + ", ".join(f'"{wrap}"' for wrap in WRAPS))


def uv_set_value(name: str, value: object) -> int:
    """The number of a set of texture coordinates. Raises ParameterError."""
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < MAX_UV_SETS:
        return value
    raise ParameterError(name, value, f"a set of texture coordinates, 0 to {MAX_UV_SETS - 1}")


def rotation_value(name: str, value: object) -> float:
    """Degrees. Raises ParameterError."""
    if _is_finite(value) and abs(value) <= 360.0:  # type: ignore[arg-type]
        return float(value)  # type: ignore[arg-type]
    raise ParameterError(name, value, "degrees from -360 to 360")


def flag_value(name: str, value: object) -> bool:
    """A boolean. Raises ParameterError."""
    if isinstance(value, bool):
        return value
    raise ParameterError(name, value, "true or false")


def _is_finite(value: object) -> bool:
    return is_number(value) and math.isfinite(value)


_ACCEPTED = {
    "texture": image_file_name,
    "texture_space": _space,
    "texture_scale": lambda name, value: TEXTURE_SCALE.accept(value),
    "texture_offset": offset_value,
    "texture_rotation": rotation_value,
    "texture_wrap": wrap_value,
    "texture_uv_set": uv_set_value,
    "texture_strength": lambda name, value: TEXTURE_STRENGTH.accept(value),
    "vertex_colours": flag_value,
    "weight": image_file_name,
    "weight_channel": lambda name, value: WEIGHT_CHANNEL.accept(value),
    "weight_invert": flag_value,
    "weight_start": lambda name, value: WEIGHT_START.accept(value),
    "strokes": lambda name, value: strokes_from(value),
    "further_weights": _further_weights,
}
