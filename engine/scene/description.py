"""What a scene file says, as frozen values: `scene.toml` and nothing that has to be loaded for it.

The file is TOML of version 1: `[camera]`, an optional `[environment]` and a list of `[[object]]` with their layers.
Reading goes through the standard library's parser and pydantic models that accept no unknown key, no wrong type and no
number that is not finite; the first thing wrong becomes one `LoadError` with the place in the file. Whether a layer's
model and its parameters make sense is for `engine.material` to say: here they are names and finite numbers.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from engine.errors import LoadError
from engine.scene.files import read_regular_file
from engine.scene.transform import check_transform

SCENE_VERSION = 1
MAX_SCENE_BYTES = 16 * 2**20
MAX_OBJECTS = 4096
MAX_RESOLUTION = 16384
MAX_COORDINATE = 1e9
IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def _grey_to_rgb(value: object) -> object:
    """A single number stands for the same value in all three channels."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return [value] * 3 if is_number else value


def _number(value: object) -> object:
    """TOML integers are as good as floats; booleans and strings are not numbers."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("a number")
    return value


Number = Annotated[float, BeforeValidator(_number), Field(allow_inf_nan=False)]
Coordinate = Annotated[float, BeforeValidator(_number),
                       Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, allow_inf_nan=False)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
Intensity = Annotated[float, BeforeValidator(_number), Field(ge=0.0, le=1e12, allow_inf_nan=False)]
Radiance = Annotated[tuple[Intensity, Intensity, Intensity], BeforeValidator(_grey_to_rgb)]
Pixels = Annotated[int, Field(ge=1, le=MAX_RESOLUTION, strict=True)]
ObjectName = Annotated[str, Field(pattern=r"^[^\s.\"'\[\]=]([^.\"'\[\]=\n\r\t]{0,62}[^\s.\"'\[\]=])?$", strict=True)]
LayerName = ObjectName
Text = Annotated[str, Field(min_length=1, max_length=4096, strict=True)]
Parameter = bool | Number | Text | tuple[Number, ...]


class _Description(BaseModel):
    """Frozen, without unknown keys; lists in the file become tuples."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class CameraDescription(_Description):
    """A pinhole: right-handed, metres, `fov_y` in degrees, `resolution` = (width, height) in pixels."""

    position: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: Annotated[float, BeforeValidator(_number), Field(ge=0.01, le=179.0, allow_inf_nan=False)] = 40.0
    resolution: tuple[Pixels, Pixels] = (512, 512)

    @model_validator(mode="after")
    def _has_a_frame(self) -> CameraDescription:
        forward = [t - p for t, p in zip(self.target, self.position)]
        length = math.hypot(*forward)
        if not length > 0.0:
            raise ValueError("target: a point other than the position")
        (fx, fy, fz), (ux, uy, uz) = forward, self.up
        across = math.hypot(fy * uz - fz * uy, fz * ux - fx * uz, fx * uy - fy * ux)
        if across <= 1e-6 * length * math.hypot(*self.up):
            raise ValueError("up: a direction that is not parallel to the view")
        return self


class EnvironmentDescription(_Description):
    """Light from infinity: a file (lat-long or angular map) or one radiance; `rotation` in degrees about +Y."""

    file: Text | None = None
    mapping: Literal["latlong", "angular"] = "latlong"
    radiance: Radiance | None = None
    rotation: Number = 0.0
    scale: Intensity = 1.0

    @model_validator(mode="after")
    def _has_one_source(self) -> EnvironmentDescription:
        if (self.file is None) == (self.radiance is None):
            raise ValueError("file: exactly one of file and radiance")
        return self


class LayerDescription(_Description):
    """One layer of a material: its model, an optional name, and the model's parameters as the file gives them."""

    model: Text
    name: LayerName | None = None
    parameters: dict[str, Parameter] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "parameters" in data:
            return data
        own = {key: value for key, value in data.items() if key in ("model", "name")}
        return own | {"parameters": {key: value for key, value in data.items() if key not in own}}


class ObjectDescription(_Description):
    """A thing in the scene: geometry, where it stands, what it is made of, what it emits from its front."""

    name: ObjectName
    mesh: Text | None = None
    primitive: Literal["quad", "cube", "sphere"] | None = None
    part: Annotated[int, Field(ge=0, strict=True)] | None = None
    transform: Annotated[tuple[Number, ...], Field(min_length=16, max_length=16)] = IDENTITY
    smooth: Annotated[bool, Field(strict=True)] = True
    editable: Annotated[bool, Field(strict=True)] = True
    emission: Radiance | None = None
    layers: tuple[LayerDescription, ...] = Field(default=(), alias="layer", max_length=64)

    @model_validator(mode="after")
    def _is_placed_geometry(self) -> ObjectDescription:
        if (self.mesh is None) == (self.primitive is None):
            raise ValueError("mesh: exactly one of mesh and primitive")
        if problem := check_transform(self.transform):
            raise ValueError(f"transform: {problem}")
        names = [layer.name for layer in self.layers if layer.name is not None]
        if len(set(names)) < len(names):
            raise ValueError("layer: layer names that differ")
        return self

    @property
    def emits(self) -> bool:
        """Whether it is an emitter (shown by its emission, not by its layers)."""
        return self.emission is not None and any(self.emission)


class SceneDescription(_Description):
    """A whole scene file."""

    version: Annotated[int, Field(strict=True)]
    name: Text = "scene"
    camera: CameraDescription
    environment: EnvironmentDescription | None = None
    objects: tuple[ObjectDescription, ...] = Field(alias="object", min_length=1, max_length=MAX_OBJECTS)

    @model_validator(mode="after")
    def _names_differ(self) -> SceneDescription:
        seen: set[str] = set()
        for item in self.objects:
            if item.name in seen:
                raise ValueError(f"object {item.name!r}: names that differ")
            seen.add(item.name)
        return self


def load_description(path: str | Path) -> SceneDescription:
    """Read and validate a scene file; raises LoadError with file, key, value and what was expected."""
    path = Path(path)
    data = read_regular_file(path, MAX_SCENE_BYTES)
    try:
        tree = tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise LoadError(path, f"byte {error.start}", hex(data[error.start]), "UTF-8 text") from None
    except RecursionError:
        raise LoadError(path, "nesting", "too deep", "a TOML file with a few levels") from None
    except ValueError as error:
        raise LoadError(path, "TOML", str(error), "a valid TOML file") from None
    return parse_description(tree, path)


def parse_description(tree: dict[str, Any], file: str | Path) -> SceneDescription:
    """Validate the tree of a TOML file named `file`."""
    version = tree.get("version")
    if isinstance(version, int) and not isinstance(version, bool) and version > SCENE_VERSION:
        raise LoadError(file, "version", f"{version} (made by a newer version)", f"version {SCENE_VERSION}")
    if version != SCENE_VERSION or isinstance(version, bool):
        raise LoadError(file, "version", "nothing" if version is None else version, f"{SCENE_VERSION}")
    try:
        return SceneDescription.model_validate(tree)
    except ValidationError as error:
        raise _first_error(error, tree, file) from None


def dump_description(description: SceneDescription) -> str:
    """The TOML text that reads back as an equal description."""
    lines = [f"version = {description.version}", f"name = {_toml(description.name)}", "[camera]"]
    lines += _table(description.camera)
    if description.environment is not None:
        lines += ["[environment]", *_table(description.environment)]
    for item in description.objects:
        lines += ["[[object]]", *_table(item, skip="layers")]
        if item.layers:
            lines += ["layer = [", *(f"  {_layer(layer)}," for layer in item.layers), "]"]
    return "\n".join(lines) + "\n"


def _table(model: BaseModel, skip: str = "") -> list[str]:
    """`key = value` lines of a model's fields, those at None left out."""
    fields = ((key, getattr(model, key)) for key in type(model).model_fields if key != skip)
    return [f"{key} = {_toml(value)}" for key, value in fields if value is not None]


def _layer(layer: LayerDescription) -> str:
    """A layer as a TOML inline table."""
    own = {"model": layer.model} | ({} if layer.name is None else {"name": layer.name}) | layer.parameters
    return "{ " + ", ".join(f"{_key(key)} = {_toml(value)}" for key, value in own.items()) + " }"


def _key(key: str) -> str:
    """A TOML key, quoted unless it is a bare one."""
    bare = key.isascii() and key.replace("_", "a").replace("-", "a").isalnum()
    return key if bare else _toml(key)


def _toml(value: object) -> str:
    """A TOML value; floats in the shortest form that reads back the same."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    escaped = "".join(_escape(c) for c in str(value))
    return f'"{escaped}"'


def _escape(character: str) -> str:
    """A character inside a basic TOML string."""
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08x}"


def _first_error(error: ValidationError, tree: dict[str, Any], file: str | Path) -> LoadError:
    """The first complaint of pydantic as one line: where, what stands there, what should."""
    first = error.errors()[0]
    location, message = list(first["loc"]), first["msg"]
    if first["type"] == "value_error":
        own = str(first["ctx"]["error"])
        key, separator, message = own.partition(": ")
        if separator:
            location.append(key)
        else:
            message = own
        return LoadError(file, _place(location, tree), _found(location, tree), message)
    if first["type"] == "missing":
        return LoadError(file, _place(location, tree), "nothing", "a value")
    if first["type"] == "extra_forbidden":
        return LoadError(file, _place(location, tree), first["input"], "no such key; " + _known_keys(location))
    return LoadError(file, _place(location, tree), first["input"], _expected(message))


def _expected(message: str) -> str:
    """Pydantic's `Input should be X` as `X`."""
    for prefix in ("Input should be ", "Value should have ", "Tuple should have ", "String should have "):
        if message.startswith(prefix):
            return message.removeprefix(prefix)
    return message


def _known_keys(location: list[int | str]) -> str:
    """The keys of the table that holds the unknown one."""
    models: dict[str, type[BaseModel]] = {"camera": CameraDescription, "environment": EnvironmentDescription,
                                          "object": ObjectDescription, "layer": LayerDescription}
    tables = [models[part] for part in location[:-1] if part in models]
    model = tables[-1] if tables else SceneDescription
    return "one of " + ", ".join(field.alias or key for key, field in model.model_fields.items())


def _place(location: list[int | str], tree: dict[str, Any]) -> str:
    """`object 2 'ball': transform[3]`: the way to a value with the names of the objects on it."""
    words, node = "", tree
    for part in location:
        if isinstance(part, int):
            node = node[part] if isinstance(node, (list, tuple)) and part < len(node) else None  # type: ignore[assignment]
            name = node.get("name") if isinstance(node, dict) else None
            words += f" {part}" + (f" {name!r}" if isinstance(name, str) else "")
        elif part in ("parameters", "bool", "float", "constrained-str", "str") or part.startswith(("tuple[", "function-")):
            continue
        else:
            node = node.get(part) if isinstance(node, dict) else None  # type: ignore[assignment]
            words += (": " if words else "") + part
    return words


def _found(location: list[int | str], tree: dict[str, Any]) -> object:
    """The value at a location, or "nothing"."""
    node: Any = tree
    for part in location:
        try:
            node = node[part]
        except (KeyError, IndexError, TypeError):
            return "nothing" if node is tree or isinstance(node, dict) else node
    return node
