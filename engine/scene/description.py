"""The contents of a scene file as frozen values: `scene.toml`, without the files that it names.

The file is TOML of version 1: `[camera]`, an optional `[environment]` and a list of `[[object]]` with their layers. It
is read by the standard library's parser and pydantic models that accept no unknown key, no wrong type and no number
that is not finite; the first error becomes one `LoadError` with the place in the file. `engine.material` decides
whether a layer's model and parameters are valid: here they are names and finite numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    PlainValidator,
    PrivateAttr,
    ValidationError,
    model_validator,
)

from engine.light.cones import LEAST_OUTER, MOST_ANGLE
from engine.light.probe_mappings import Mapping
from engine.light.suns import SUN_DIAMETER
from engine.material.bumps import BUMP_TABLES, NO_BUMPS, Bumps, bump_values, bumps_from
from engine.material.layer import Frame
from engine.material.layer_maps import LayerMaps
from engine.material.map_tables import map_fields, map_values, maps_from
from engine.material.opacity import OPAQUE, Opacity, opacity_from, opacity_values
from engine.material.parameters import ParameterError
from engine.scene.surface_kinds import NO_SURFACE, DeformSurface
from engine.scene.toml_text import check_version, first_validation_error, load_toml

Table = TypeVar("Table")

SCENE_VERSION = 1
MAX_SCENE_BYTES = 16 * 2**20
MAX_BOUNCES = 8
MAX_OBJECTS = 4096
MAX_VARIANTS = 64
LONGEST_NAME = 64  # of an object or a layer
MAX_RESOLUTION = 16384
MAX_COORDINATE = 1e9
MAX_SUNS = 16
MAX_RADIANCE = 1e12
# Entries of transforms: their largest magnitude; and the least volume of the axes relative to orthogonal ones.
MAX_ENTRY, _FLATTEST = 1e9, 1e-9
IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def _grey_to_rgb(value: object) -> object:
    """Expand a single number to all three channels."""
    return [value] * 3 if _is_finite(value) else value


def _name(value: object) -> str:
    """Check a name, which appears in paths such as `teapot.1.alpha` and in messages."""
    good = isinstance(value, str) and 0 < len(value) <= LONGEST_NAME and value.isprintable() and value == value.strip()
    if not isinstance(value, str) or not good or set(value) & set(".\"'[]="):
        raise ValueError(f"a name of 1 to {LONGEST_NAME} characters without . = [ ] and quotes")
    return value


def valid_name(text: str, otherwise: str = "mesh") -> str:
    """A name that a file gives, as one that an object can have; otherwise: where nothing is left of it."""
    name = "".join("_" if c in ".\"'[]=" or not c.isprintable() else c for c in text).strip()
    return name[:48].strip() or otherwise


def free_name(name: str, taken: set[str]) -> str:
    """Make a name unique by a suffix, and mark it as taken; it stays one that an object can have."""
    free, number = name, len(taken)
    while free in taken and len(free) < LONGEST_NAME:
        free += "+"
    while free in taken:
        free, number = f"{name[: LONGEST_NAME - 8]}+{number}", number + 1
    taken.add(free)
    return free


def _parameter(value: object) -> ParameterValue:
    """A layer's parameter from TOML, lists as tuples."""
    if isinstance(value, (bool, str)):
        return value
    if isinstance(value, (list, tuple)) and all(_is_finite(item) for item in value):
        return tuple(float(item) for item in value)
    if isinstance(value, (int, float)) and _is_finite(value):
        return float(value)
    raise ValueError("a finite number, a list of them, a string or a boolean")


def table_validator(kind: type[Table], parse: Callable[[dict[str, Any]], Table]) -> Callable[[object], Table]:
    """A validator that takes a value of this kind as it is, and a table of its parts by name."""

    def validate(value: object) -> Table:
        if isinstance(value, kind):
            return value
        if not isinstance(value, dict):
            raise ValueError("a table")
        try:
            return parse(value)
        except ParameterError as error:
            raise ValueError(f"{error.what}: {error.expected}") from None

    return validate


def _emission_maps(tables: dict[str, Any]) -> LayerMaps:
    """The texture and vertex colours of an emission; a share of it would be another emission."""
    for name in tables:
        if name != "vertex_colours" and not name.startswith("texture"):
            raise ParameterError(name, tables[name], "keys of a texture, or vertex_colours")
    return maps_from(tables)


_maps = table_validator(LayerMaps, maps_from)
_texture = table_validator(LayerMaps, _emission_maps)
_bumps = table_validator(Bumps, lambda tables: bumps_from(tables) if tables else NO_BUMPS)
_opacity = table_validator(Opacity, opacity_from)


def _is_finite(value: object) -> bool:
    """Whether it is a number that a float can represent."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= 1e300


def _number(value: object) -> object:
    """Accept TOML integers as floats; booleans and strings are not numbers."""
    if not _is_finite(value):
        raise ValueError("a finite number")
    return value


Number = Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]
Coordinate = Annotated[
    float, BeforeValidator(_number), Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, allow_inf_nan=False)
]
Vector = tuple[Coordinate, Coordinate, Coordinate]
Intensity = Annotated[float, BeforeValidator(_number), Field(ge=0.0, le=MAX_RADIANCE, allow_inf_nan=False)]
Radiance = Annotated[tuple[Intensity, Intensity, Intensity], BeforeValidator(_grey_to_rgb)]
Pixels = Annotated[int, Field(ge=1, le=MAX_RESOLUTION, strict=True)]
Name = Annotated[str, PlainValidator(_name)]
Text = Annotated[str, Field(min_length=1, max_length=4096, strict=True)]
ParameterValue = bool | float | str | tuple[float, ...]
Maps = Annotated[LayerMaps, PlainValidator(_maps), PlainSerializer(map_values, return_type=dict)]
EmissionTexture = Annotated[LayerMaps, PlainValidator(_texture), PlainSerializer(map_values, return_type=dict)]
BumpMap = Annotated[Bumps, PlainValidator(_bumps), PlainSerializer(bump_values, return_type=dict)]
OpacityTable = Annotated[Opacity, PlainValidator(_opacity), PlainSerializer(opacity_values, return_type=dict)]
Primitive = Literal[  # engine.scene.primitives
    "quad", "cube", "sphere", "disc", "cylinder", "cone", "torus", "backdrop", "pedestal", "shader_ball",
    "shader_ball_base",
]  # fmt: skip
Parameter = Annotated[Any, PlainValidator(_parameter)]  # a ParameterValue; "Any" serializes unchanged


class _Description(BaseModel):
    """Frozen, without unknown keys; lists in the file become tuples."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Camera(_Description):
    """A pinhole camera: right-handed, metres, `fov_y` in degrees."""

    position: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: Annotated[float, BeforeValidator(_number), Field(ge=0.01, le=179.0, allow_inf_nan=False)] = 40.0

    @model_validator(mode="after")
    def _has_a_frame(self) -> Self:
        forward = [t - p for t, p in zip(self.target, self.position, strict=True)]
        length = math.hypot(*forward)
        if not length > 0.0:
            raise ValueError("target: a point other than the position")
        (fx, fy, fz), (ux, uy, uz) = forward, self.up
        across = math.hypot(fy * uz - fz * uy, fz * ux - fx * uz, fx * uy - fy * ux)
        if across <= 1e-6 * length * math.hypot(*self.up):
            raise ValueError("up: a direction that is not parallel to the view")
        return self


class CameraDescription(Camera):
    """The initial camera of a scene, and the picture's `resolution` = (width, height) in pixels."""

    resolution: tuple[Pixels, Pixels] = (512, 512)


class SunDescription(_Description):
    """A distant disc of light: where it is seen, the irradiance of a surface that faces it, and its size in degrees."""

    name: Name | None = None
    direction: Vector
    irradiance: Radiance
    diameter: Annotated[float, BeforeValidator(_number), Field(ge=0.1, le=90.0, allow_inf_nan=False)] = SUN_DIAMETER

    @model_validator(mode="after")
    def _has_a_direction(self) -> Self:
        if not math.hypot(*self.direction) > 1e-9:
            raise ValueError("direction: one other than 0 0 0")
        return self


class EnvironmentDescription(_Description):
    """Light from infinity: a file or one radiance, and suns; `rotation` in degrees about +Y turns them all."""

    file: Text | None = None
    mapping: Mapping = "latlong"
    radiance: Radiance | None = None
    rotation: Number = 0.0
    scale: Intensity = 1.0
    suns: tuple[SunDescription, ...] = Field(default=(), alias="sun", max_length=MAX_SUNS)

    @model_validator(mode="after")
    def _has_one_source(self) -> EnvironmentDescription:
        if (self.file is None) == (self.radiance is None):
            raise ValueError("file: exactly one of file and radiance")
        return self


class LayerDescription(_Description):
    """One layer of a material: its model, an optional name, the model's parameters as in the file, the name of a layer
    that it shares its curves with, of one that lies on it, the frame that it reflects in, its texture and weight map,
    and the maps of its parameters by name, as tables (`engine.material.parameter_maps`)."""

    model: Text
    name: Name | None = None
    follows: Name | None = None
    under: Name | None = None
    frame: Frame = "base"
    maps: Maps = LayerMaps()
    parameter_maps: dict[str, dict[str, Any]] = Field(default_factory=dict)
    parameters: dict[str, Parameter] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "parameters" in data:
            return data
        named = ("model", "name", "follows", "under", "frame", "parameter_maps")
        own = {key: value for key, value in data.items() if key in named}
        maps = {key: value for key, value in data.items() if key in map_fields()}
        rest = {key: value for key, value in data.items() if key not in own and key not in maps}
        return own | {"maps": _maps(maps), "parameters": rest}


def _gather_bumps(data: Any) -> Any:
    """An object's or a variant's keys, with those of bumps in one."""
    named = {key: data[key] for key in BUMP_TABLES if key in data} if isinstance(data, dict) else {}
    if not named:
        return data
    return {key: value for key, value in data.items() if key not in named} | {"bumps": _bumps(named)}


class ConeDescription(_Description):
    """The cone of a spot about the +Z axis of its object, by half angles in degrees: within `inner` it has all of its
    radiance, beyond `outer` none (`engine.light.cones`)."""

    inner: Annotated[float, BeforeValidator(_number), Field(ge=0.0, le=MOST_ANGLE, allow_inf_nan=False)] = 0.0
    outer: Annotated[float, BeforeValidator(_number), Field(ge=LEAST_OUTER, le=MOST_ANGLE, allow_inf_nan=False)]

    @model_validator(mode="after")
    def _has_an_edge(self) -> Self:
        if self.inner > self.outer:
            raise ValueError("inner: an angle of at most outer")
        return self


class VariantDescription(_Description):
    """Another material of an object, by the name of the scene's variant to which it belongs; None: the object keeps its
    bumps, its opacity, its emission."""

    name: Text
    layers: tuple[LayerDescription, ...] = Field(alias="layer", min_length=1, max_length=64)
    bumps: BumpMap | None = None
    opacity: OpacityTable | None = None
    emission: Radiance | None = None

    _gather = model_validator(mode="before")(_gather_bumps)

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """What each of its images is, and its name, but for those of its layers."""
        opacity = "" if self.opacity is None else self.opacity.opacity_map
        return (*(() if self.bumps is None else self.bumps.files), *([("opacity_map", opacity)] if opacity else []))


class ObjectDescription(_Description):
    """An object in the scene: geometry, transform, material, and the radiance that it emits from its front, in all
    directions or into a cone, which its texture multiplies. unlit: that radiance is seen by the camera and lights
    nothing [KHR_materials_unlit]."""

    name: Name
    mesh: Text | None = None
    primitive: Primitive | None = None
    part: Annotated[int, Field(ge=0, strict=True)] | None = None
    transform: Annotated[tuple[Number, ...], Field(min_length=16, max_length=16)] = IDENTITY
    smooth: Annotated[bool, Field(strict=True)] = True
    editable: Annotated[bool, Field(strict=True)] = True
    emission: Radiance | None = None
    cone: ConeDescription | None = None
    emission_texture: EmissionTexture = LayerMaps()
    unlit: Annotated[bool, Field(strict=True)] = False
    bumps: BumpMap = NO_BUMPS
    opacity: OpacityTable = OPAQUE
    deform: DeformSurface = NO_SURFACE
    layers: tuple[LayerDescription, ...] = Field(default=(), alias="layer", max_length=64)
    variants: tuple[VariantDescription, ...] = Field(default=(), alias="variant", max_length=MAX_VARIANTS)
    _former_name: str = PrivateAttr("")

    _gather = model_validator(mode="before")(_gather_bumps)

    @model_validator(mode="after")
    def _is_placed_geometry(self) -> ObjectDescription:
        if (self.mesh is None) == (self.primitive is None):
            raise ValueError("mesh: exactly one of mesh and primitive")
        if self.cone is not None and self.emission_texture.is_tinted:
            raise ValueError("cone: at most one of cone and emission_texture")
        if problem := check_transform(self.transform):
            raise ValueError(f"transform: {problem}")
        names = [layer.name for layer in self.layers if layer.name is not None]
        if len(set(names)) < len(names):
            raise ValueError("layer: layer names that differ")
        if len({variant.name for variant in self.variants}) < len(self.variants):
            raise ValueError("variant: names that differ")
        return self

    @property
    def former_name(self) -> str:
        """The name by which sessions of version 2 know it, a part of a glTF file; empty where that is its own."""
        return self._former_name

    def with_former_name(self, name: str) -> ObjectDescription:
        """The same object under another former name."""
        found = self.model_copy()
        found._former_name = name
        return found

    @property
    def is_of_files(self) -> bool:
        """Whether it has images, which need texture coordinates."""
        own = self.deform.is_mapped or bool(self.deform.files)
        own = own or bool(self.opacity.opacity_map) or bool(self.bumps.files) or self.emission_texture.is_of_files
        return own or any(layer.maps.is_of_files or layer.parameter_maps for layer in self.layers)

    @property
    def has_smooth_coat(self) -> bool:
        """Whether one of its layers reflects in the coat's frame, and that is smooth."""
        return self.bumps.of_coat.is_flat and any(layer.frame == "coat" for layer in self.layers)

    @property
    def emits(self) -> bool:
        """Whether it shines, itself or in a variant, as an emitter or unlit; with layers it reflects as well."""
        return any(each is not None and any(each) for each in (self.emission, *(v.emission for v in self.variants)))

    @property
    def is_lamp(self) -> bool:
        """Whether it emits and reflects nothing: it has no layers."""
        return self.emits and not self.layers

    @property
    def is_light(self) -> bool:
        """Whether it is a lamp that lights others, and not one that is unlit."""
        return self.is_lamp and not self.unlit


class SceneDescription(_Description):
    """A whole scene file. bounces: number of reflections between light and camera, None for as many as the picture
    requires."""

    version: Annotated[int, Field(strict=True)]
    name: Text = "scene"
    bounces: Annotated[int, Field(ge=1, le=MAX_BOUNCES, strict=True)] | None = None
    camera: CameraDescription
    environment: EnvironmentDescription | None = None
    objects: tuple[ObjectDescription, ...] = Field(default=(), alias="object", max_length=MAX_OBJECTS)

    @model_validator(mode="after")
    def _names_differ(self) -> SceneDescription:
        seen: set[str] = set()
        for item in self.objects:
            if item.name in seen:
                raise ValueError(f"object {item.name!r}: names that differ")
            seen.add(item.name)
        return self

    def from_camera(self, camera: Camera | None) -> SceneDescription:
        """The same from another camera; None: from its own."""
        if camera is None:
            return self
        return self.model_copy(update={"camera": self.camera.model_copy(update=dict(camera))})


def load_description(path: str | Path) -> SceneDescription:
    """Read and validate a scene file; raises LoadError with file, key, value and what was expected."""
    path = Path(path)
    return parse_description(load_toml(path, MAX_SCENE_BYTES), path)


def parse_description(tree: dict[str, Any], file: str | Path) -> SceneDescription:
    """Validate the tree of a TOML file named `file`."""
    check_version(tree, file, SCENE_VERSION)
    try:
        return SceneDescription.model_validate(tree)
    except ValidationError as error:
        raise first_validation_error(error, tree, file, SceneDescription) from None


def check_transform(entries: Sequence[float]) -> str | None:
    """What was expected instead of the 16 numbers of a transform (row-major, for column vectors, p' = M p), or None if
    they are an invertible affine one.

    Invertible means |det A| > 1e-9 · |a_x| |a_y| |a_z| with the columns a of the linear part A (Hadamard's inequality:
    the ratio is 1 for orthogonal axes, 0 for axes in one plane), at any scale.
    """
    if not all(math.isfinite(e) and abs(e) <= MAX_ENTRY for e in entries):
        return f"finite numbers of at most {MAX_ENTRY:g}"
    if any(abs(e - one) > 1e-9 for e, one in zip(entries[12:], (0.0, 0.0, 0.0, 1.0), strict=True)):
        return "a last row 0 0 0 1"
    volume = math.prod(math.hypot(*entries[i:12:4]) for i in range(3))
    if not abs(determinant(entries)) > _FLATTEST * volume or volume < 1e-27:
        return "an invertible matrix"
    return None


def determinant(entries: Sequence[float]) -> float:
    """Determinant of the linear part (upper left 3×3)."""
    a, b, c, _, d, e, f, _, g, h, i = entries[:11]
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
