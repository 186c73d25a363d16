"""Paths: what can be set of a document, by name (`app.document.document` says how they are written)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from app.document.document import Document, ObjectState, all_factors, layer_key, split_layer, split_object, unknown
from app.document.light_state import ENVIRONMENT_KEY, MIX_FIELDS, group_key
from app.document.painted_parameters import FILE, parameters_of
from engine.core.errors import LoadError
from engine.material.bumps import bump_fields
from engine.material.map_tables import map_fields
from engine.material.opacity import opacity_fields
from engine.material.parameter_maps import MAPPED_KINDS
from engine.realtime.deformers import KINDS
from engine.scene.surface_kinds import SURFACES

Kind = Literal[
    "object", "layer", "factor", "parameter", "map", "parameter_map", "switch", "presence", "deformer", "transform",
    "lamp", "group", "time", "bumps", "opacity", "surface", "light", "sun", "painted", "mix",
]  # fmt: skip


@dataclass(frozen=True)
class Target:
    """The target of a path. ``key`` is None for an object or the light, ``name`` None for an object or a layer;
    ``object`` is the name of a sun, a painted light or a group where that is the target."""

    kind: Kind
    object: str = ""
    layer: int | None = None
    name: str | None = None

    @property
    def key(self) -> str | None:
        return None if self.layer is None else layer_key(self.object, self.layer)


SHADOW_CATCHER = "shadow_catcher"
SWITCHES = ("visible", "frozen", "editable", SHADOW_CATCHER)
MATERIAL = "material"
TIME = "time"
# The paths of a transform's parts, and its fields.
TRANSFORM_FIELDS = {"position": "translation", "rotation": "rotation", "scale": "scale"}
# What lamps have by numbers (`app.document.commands.lamps`).
LAMP_FIELDS = ("width", "height", "radius", "inner_angle", "outer_angle", "target")
# What makes, deletes and renames objects; `ADD` is of a name that no object has yet.
ADD = "add"
IN_GROUP = "in_group"
PRESENCE_FIELDS = ("name", "duplicate", "deleted", IN_GROUP)
# Of objects alone: a duplicate that shares their material, and the link of those that do.
LINKED_DUPLICATE, LINKED = "linked_duplicate", "linked"
# Of groups of objects, whose paths begin so.
GROUPS, GROUP_FIELDS = "groups", ("name", "visible", "frozen")
SURFACE = "surface"
EMISSION = "emission"
FRESNEL_TERM = "fresnel_term"
UNDER, FRAME = "under", "frame"
VARIANT = "variant"
LOOK = "look"
MAP_SUFFIX = "_map"  # of the path to the map of a parameter: "teapot.1.alpha_map"
BACKGROUND, BACKGROUND_COLOUR = "background", "background_colour"
MAP_FIELDS = ("tilt", "hue", "contrast", "clamp")
SIDES = "sides"
LIGHT_FIELDS = ("rotation", "intensity", "environment", "mapping", SIDES, *MAP_FIELDS, BACKGROUND, BACKGROUND_COLOUR)
# Of painted lights beside their parameters: place in the list, and what makes another one or deletes it.
PAINTED, PLACE = "painted", "position"
SUN_FIELDS = ("direction", "azimuth", "elevation", "irradiance", "diameter")


def resolve(document: Document, path: str) -> Target:
    """The target of a path in this document.

    Raises InsituError that says which part is unknown and what exists in its place.
    """
    head, _, rest = path.partition(".")
    if head == "light" and rest in LIGHT_FIELDS:
        return Target("light", name=rest)
    sun, _, last = rest.rpartition(".")
    suns = [each.name for each in document.light.suns]
    if head == "light" and last in (*SUN_FIELDS, *PRESENCE_FIELDS) and sun in suns:
        return Target("sun", sun, name=last)
    if head == "light" and rest in suns:
        return Target("sun", rest)
    painted = sun.removeprefix(f"{PAINTED}.") if head == "light" and rest.startswith(f"{PAINTED}.") else ""
    fields = painted_fields(document, painted) if painted else ()
    if last in fields:
        return Target("painted", painted, name=last)
    key, _, _ = path.rpartition(".")
    light = document.light
    keys = tuple(dict.fromkeys((ENVIRONMENT_KEY, *light.keys, *map(group_key, light.groups))))
    if last in MIX_FIELDS and key in keys:
        return Target("mix", key, name=last)
    if head == "light" and all(state.name != "light" for state in document.objects):
        values = [f"{name}.{field}" for name in suns for field in (*SUN_FIELDS, *PRESENCE_FIELDS)]
        rows = [f"{key.removeprefix('light.')}.{name}" for key in keys for name in MIX_FIELDS]
        rows += [f"{sun}.{name}" for name in fields]
        raise unknown("property of the light", rest, (*LIGHT_FIELDS, *values, *rows))
    if head == GROUPS and all(state.name != GROUPS for state in document.objects):
        return _resolve_group(document, rest)
    state, rest = split_object(document, path)
    if rest in MIX_FIELDS and state.emits and rest not in [layer.name for layer in state.layers]:
        return Target("mix", state.name, name=rest)
    if not rest:
        return Target("object", state.name)
    if rest in LAMP_FIELDS and state.lamp is not None and rest not in [layer.name for layer in state.layers]:
        return Target("lamp", state.name, name=rest)
    kind = _kind_of(rest)
    if kind is not None and rest.partition(".")[0] not in [layer.name for layer in state.layers]:
        return Target(kind, state.name, name=rest)
    index, rest = split_layer(state, rest)
    if not rest:
        return Target("layer", state.name, index)
    if rest in ("visible", "frozen", FRESNEL_TERM, UNDER, FRAME):
        return Target("switch", state.name, index, rest)
    return _resolve_in_layer(state, index, rest)


def _resolve_group(document: Document, path: str) -> Target:
    name, dot, field = path.partition(".")
    if name not in document.groups:
        raise unknown("group", name, document.groups)
    if dot and field not in GROUP_FIELDS:
        raise unknown(f"property of the group {name}", field, GROUP_FIELDS)
    return Target("group", name, name=field or None)


def check_presence(path: str, field: str, value: Any) -> None:
    """Raise LoadError unless `deleted` is true, and `name` and duplicates are names."""
    if field == "deleted" and value is not True:
        raise LoadError(path, "value", value, "true; undo brings back what was deleted")
    if field != "deleted" and not isinstance(value, str):
        raise LoadError(path, "value", value, "a name")


def painted_fields(document: Document, name: str) -> tuple[str, ...]:
    """What can be set of a painted light, besides its row in the mix; nothing where there is none of this name."""
    light = next((each for each in document.light.painted if each.name == name), None)
    if light is None:
        return ()
    file = (FILE,) if light.kind == "image" else ()
    return ("name", PLACE, "deleted", *file, *parameters_of(light.kind, light.placement))


def _kind_of(name: str) -> Kind | None:
    """The kind of an object's value with this name, besides its layers."""
    if name in (*SWITCHES, MATERIAL, EMISSION):
        return "switch"
    if name in KINDS:
        return "deformer"
    if name == TIME:
        return "time"
    if name in (*PRESENCE_FIELDS, LINKED_DUPLICATE, LINKED):
        return "presence"
    if name in TRANSFORM_FIELDS:
        return "transform"
    if name in bump_fields():
        return "bumps"
    if name in opacity_fields():
        return "opacity"
    return "surface" if name.partition(".")[0] in (SURFACE, *SURFACES) else None


def _resolve_in_layer(state: ObjectState, index: int, name: str) -> Target:
    layer = state.layers[index]
    factors = [factor.name for factor in all_factors(layer.model)]
    parameters = [parameter.name for parameter in layer.parameter_table]
    if name in factors:
        return Target("factor", state.name, index, name)
    if name in parameters:
        return Target("parameter", state.name, index, name)
    if name in map_fields():
        return Target("map", state.name, index, name)
    own = name.removesuffix(MAP_SUFFIX)
    if own != name and any(own == each.name and each.kind in MAPPED_KINDS for each in layer.model.parameters):
        return Target("parameter_map", state.name, index, own)
    raise unknown(f"curve or parameter of {layer_key(state.name, index)}", name, [*factors, *parameters])
