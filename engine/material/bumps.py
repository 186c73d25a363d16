"""Perturbation of an object's shading frame: of its normal by a normal map or heights (a bump map), of its tangent by
an angle and a map of angles.

Normal maps and heights cover the whole object, under all of its layers, and both become slopes (p, q): of a normal
map's texel (x, y, z) = 2 c − 1 they are (−x / z, −y / z) along the directions t and b in which u and v grow ([glTF20,
3.9.3]: +X to the right, +Y up; `flip_green` is for maps with +Y down, as DirectX has it), of heights their derivatives,
in metres a metre. The normal is then [Mikkelsen20, eq. 4]

    n' = normalize(n − strength · (p t + q b)).

The tangent, along which an anisotropic material's streaks are measured, is rotated about the normal, counter-clockwise
as seen from the side that is shown, by

    tangent_angle + tangent_range · grey(u, v)

degrees, as Blender's *anisotropic rotation* does. All models are symmetric under half a turn, so that the default range
of 180 degrees has every direction once; of measurements that are not, a map counts up to half a turn. With
`tangent_along_u` it is instead rotated from the direction in which u grows towards that in which v does; a map with
`tangent_vectors` has the directions themselves, along u in red and along v in green [glTF20,
KHR_materials_anisotropy].

Both rotate the frame in which a material reflects, and nothing else: position and face determine what a point sees and
its shadows. So transport depends on them, and visibility does not.

A clear coat need not follow the surface that it lies on. Layers of the coat's frame (`engine.material.layer.Layer`)
take their normal from a map of the coat's own, `coat_normal_map`, and without one that of the smooth surface [glTF20,
KHR_materials_clearcoat]; both frames share the rotation of tangents. Bumps of a layer's own for any layer were
rejected: each would be another frame of all points, and no format has more than two.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from engine.material.layer_maps import LEAST_REPEATS, MAX_REPEATS, TextureTransform, Wrap
from engine.material.map_tables import flag_value, image_file_name, offset_value, uv_set_value, wrap_value
from engine.material.parameters import Parameter, ParameterError

DEFAULT_HEIGHT = 0.01
BUMP_STRENGTH = Parameter(
    "bump_strength",
    "scalar",
    1.0,
    "Bump strength",
    "Strength of the bumps: 1 as in the image, 0 flat. Shown when idle.",
    maximum=10.0,
)
BUMP_HEIGHT = Parameter(
    "bump_height",
    "scalar",
    DEFAULT_HEIGHT,
    "Height",
    "Metres between black and white; below 0 the image is pressed in.",
    minimum=-1e3,
    maximum=1e3,
    step=0.0,
    form="%.4g m",
)
BUMP_REPEATS = Parameter(
    "bump_repeats",
    "pair",
    (1.0, 1.0),
    "Repeats",
    "How often the image repeats along u, across, and v, upwards; below 0 it is mirrored.",
    minimum=-MAX_REPEATS,
    maximum=MAX_REPEATS,
    least=LEAST_REPEATS,
)
COAT_STRENGTH = replace(
    BUMP_STRENGTH, name="coat_strength", label="Coat's strength",
    tooltip="Strength of the coat's bumps: 1 as in the image, 0 smooth. Shown when idle.",
)  # fmt: skip
COAT_REPEATS = replace(BUMP_REPEATS, name="coat_repeats", label="Coat's repeats")
TANGENT_ANGLE = Parameter(
    "tangent_angle",
    "scalar",
    0.0,
    "Rotation",
    "Rotates the direction of the streaks about the normal, counter-clockwise. Shown when idle.",
    minimum=-360.0,
    maximum=360.0,
    unit="°",
    step=0.5,
)
TANGENT_RANGE = Parameter(
    "tangent_range",
    "scalar",
    180.0,
    "White",
    "Degrees by which white of the map rotates; black does not.",
    minimum=-360.0,
    maximum=360.0,
    unit="°",
    step=0.5,
)


@dataclass(frozen=True)
class Bumps:
    """Bumps of one object, and the rotation of its tangents. Names are files, like those of textures
    (`engine.material.layer_maps.LayerMaps`); at most one of normal_map and bump_map.

    bump_strength: 0 has no effect. bump_height: metres between a bump map's black and its white; negative ones are
    pressed in. flip_green: whether a normal map's green means down and not up. bump_repeats: how often the image
    repeats along u and v; bump_offset, bump_wrap, bump_uv_set: see `engine.material.layer_maps.TextureTransform`.
    tangent_angle: degrees, about the normal; tangent_map: a grey image of further angles, white being tangent_range
    degrees, or of vectors; tangent_along_u: whether tangents follow the texture coordinates. coat_...: the normal map
    of layers of the coat's frame, empty for the smooth surface, with the parts that normal_map has.
    """

    normal_map: str = ""
    bump_map: str = ""
    bump_strength: float = 1.0
    bump_height: float = DEFAULT_HEIGHT
    bump_repeats: tuple[float, float] = (1.0, 1.0)
    bump_offset: tuple[float, float] = (0.0, 0.0)
    bump_wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    bump_uv_set: int = 0
    flip_green: bool = False
    tangent_angle: float = 0.0
    tangent_map: str = ""
    tangent_range: float = 180.0
    tangent_along_u: bool = False
    tangent_vectors: bool = False
    coat_normal_map: str = ""
    coat_strength: float = 1.0
    coat_repeats: tuple[float, float] = (1.0, 1.0)
    coat_offset: tuple[float, float] = (0.0, 0.0)
    coat_wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    coat_uv_set: int = 0
    coat_flip_green: bool = False

    @property
    def of_coat(self) -> Bumps:
        """The bumps of layers of the coat's frame, as if they were the object's."""
        tangents = {name: getattr(self, name) for name in bump_fields() if name.startswith("tangent")}
        return Bumps(
            self.coat_normal_map, bump_strength=self.coat_strength, bump_repeats=self.coat_repeats,
            bump_offset=self.coat_offset, bump_wrap=self.coat_wrap, bump_uv_set=self.coat_uv_set,
            flip_green=self.coat_flip_green, **tangents,
        )  # fmt: skip

    def with_coat(self, bumps: Bumps) -> Bumps:
        """The same with these images of the coat's, the inverse of `of_coat`; bumps: a normal map or none."""
        return replace(
            self, coat_normal_map=bumps.normal_map, coat_strength=bumps.bump_strength, coat_repeats=bumps.bump_repeats,
            coat_offset=bumps.bump_offset, coat_wrap=bumps.bump_wrap, coat_uv_set=bumps.bump_uv_set,
            coat_flip_green=bumps.flip_green,
        )  # fmt: skip

    def with_files(self, new_name: Callable[[str], str]) -> Bumps:
        """The same with other names of its images."""
        names: dict[str, Any] = {field: new_name(name) for field, name in self.files}
        return replace(self, **names)

    @property
    def transform(self) -> TextureTransform:
        """The mapping of texture coordinates to the image."""
        return TextureTransform(0.0, self.bump_offset, self.bump_wrap, self.bump_uv_set)

    @property
    def file(self) -> str:
        """The image of either kind; empty for none."""
        return self.normal_map or self.bump_map

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """The images that it names, and the field of each."""
        named = (self.kind, self.file), ("tangent_map", self.tangent_map), ("coat_normal_map", self.coat_normal_map)
        return tuple((field, name) for field, name in named if name)

    @property
    def kind(self) -> str:
        """The field that has it."""
        return "bump_map" if self.bump_map else "normal_map"

    @property
    def rotates_tangents(self) -> bool:
        """Whether tangents are not those around the object's own axis."""
        return bool(self.tangent_angle or self.tangent_map or self.tangent_along_u)

    @property
    def is_flat(self) -> bool:
        """Whether they have no effect, whatever the image contains."""
        return not self.file or self.bump_strength == 0.0 or (bool(self.bump_map) and self.bump_height == 0.0)

    @property
    def slope_scale(self) -> float:
        """The factor of the image's slopes."""
        return self.bump_strength * (self.bump_height if self.bump_map else 1.0)


# By the names of objects.
BumpsByObject = tuple[tuple[str, Bumps], ...]
NO_BUMPS = Bumps()
BUMP_KINDS = ("normal_map", "bump_map")
# Their tables in a scene's file.
BUMP_TABLES = (*BUMP_KINDS, "tangent", "coat_normal_map")
BUMP_IMAGES = (*BUMP_KINDS, "tangent_map", "coat_normal_map")


@functools.cache
def bump_fields() -> tuple[str, ...]:
    """The names of `Bumps`' parts in scripts and paths."""
    return tuple(field.name for field in dataclasses.fields(Bumps))


def set_bump_field(bumps: Bumps, name: str, value: object) -> Bumps:
    """Set one part; an image of one kind replaces one of the other.

    Raises ParameterError for a value that the part does not accept.
    """
    if name not in _ACCEPTED:
        raise ParameterError(name, value, "one of " + ", ".join(_ACCEPTED))
    changes: dict[str, Any] = {name: _ACCEPTED[name](name, value)}
    if name in BUMP_KINDS and changes[name]:
        changes |= {other: "" for other in BUMP_KINDS if other != name}
    return replace(bumps, **changes)


def bumps_from(tables: Mapping[str, object]) -> Bumps:
    """Bumps from their form in files: `normal_map` = {file, scale, repeats, offset, wrap, uv_set}, where scale is the
    strength, or `bump_map` with a height; a normal map may have flip_green; `tangent` = {angle, file, range, along_u,
    vectors}; and `coat_normal_map` with the keys of normal_map. Raises ParameterError."""
    if set(BUMP_KINDS) <= set(tables) or not set(tables) <= set(BUMP_TABLES):
        raise ParameterError(" and ".join(tables), dict(tables), "one of normal_map and bump_map")
    bumps = NO_BUMPS
    for name, table in tables.items():
        keys, is_image = _KEYS[name], name != "tangent"
        if not isinstance(table, dict) or not set(table) <= set(keys) or is_image and not table.get("file"):
            first = "file and, where they differ, " if is_image else ""
            raise ParameterError(name, table, f"a table of {first}{', '.join(list(keys)[is_image:])}")
        for key in (key for key in keys if key in table):
            bumps = set_bump_field(bumps, keys[key], table[key])
    return bumps


def bump_values(bumps: Bumps) -> dict[str, Any]:
    """The inverse; empty for bumps without images and tangents without rotation."""
    tables = {}
    images = (name for name in (bumps.kind, "coat_normal_map") if getattr(bumps, name))
    for name in (*images, "tangent"):
        values = {key: (getattr(bumps, field), getattr(NO_BUMPS, field)) for key, field in _KEYS[name].items()}
        # A bump map always has its height.
        shown = {key: value for key, (value, default) in values.items() if value != default or key == "height"}
        if shown:
            tables[name] = {key: list(value) if isinstance(value, tuple) else value for key, value in shown.items()}
    return tables


def bump_parts(bumps: Bumps) -> dict[str, Any]:
    """All parts that differ from the default, by field, for sessions."""
    return {name: getattr(bumps, name) for name in bump_fields() if getattr(bumps, name) != getattr(NO_BUMPS, name)}


def bumps_of_parts(parts: Mapping[str, object]) -> Bumps:
    """The inverse. Raises ParameterError."""
    bumps = NO_BUMPS
    for name, value in parts.items():
        bumps = set_bump_field(bumps, name, value)
    return bumps


_PLACE = {"repeats": "bump_repeats", "offset": "bump_offset", "wrap": "bump_wrap", "uv_set": "bump_uv_set"}
_KEYS = {
    "normal_map": {"file": "normal_map", "scale": "bump_strength", **_PLACE, "flip_green": "flip_green"},
    "bump_map": {"file": "bump_map", "scale": "bump_strength", "height": "bump_height", **_PLACE},
    "tangent": {
        "angle": "tangent_angle",
        "file": "tangent_map",
        "range": "tangent_range",
        "along_u": "tangent_along_u",
        "vectors": "tangent_vectors",
    },
    "coat_normal_map": {
        "file": "coat_normal_map",
        "scale": "coat_strength",
        **{key: field.replace("bump_", "coat_") for key, field in _PLACE.items()},
        "flip_green": "coat_flip_green",
    },
}


_ACCEPTED: dict[str, Callable[[str, object], Any]] = {
    "normal_map": image_file_name,
    "bump_map": image_file_name,
    "bump_strength": lambda name, value: BUMP_STRENGTH.accept(value),
    "bump_height": lambda name, value: BUMP_HEIGHT.accept(value),
    "bump_repeats": lambda name, value: BUMP_REPEATS.accept(value),
    "bump_offset": offset_value,
    "bump_wrap": wrap_value,
    "bump_uv_set": uv_set_value,
    "flip_green": flag_value,
    "tangent_angle": lambda name, value: TANGENT_ANGLE.accept(value),
    "tangent_map": image_file_name,
    "tangent_range": lambda name, value: TANGENT_RANGE.accept(value),
    "tangent_along_u": flag_value,
    "tangent_vectors": flag_value,
    "coat_normal_map": image_file_name,
    "coat_strength": lambda name, value: COAT_STRENGTH.accept(value),
    "coat_repeats": lambda name, value: COAT_REPEATS.accept(value),
    "coat_offset": offset_value,
    "coat_wrap": wrap_value,
    "coat_uv_set": uv_set_value,
    "coat_flip_green": flag_value,
}
