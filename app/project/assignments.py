"""The edits that paths and values stand for, as the command line (``--set``) and scripts write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.document.commands import EditCommand
from app.document.commands.groups import SetGroup, group_edit
from app.document.commands.lamps import with_lamp_value
from app.document.commands.layers import (
    SetEditable,
    SetFrame,
    SetFresnelTerm,
    SetFrozen,
    SetMaterial,
    SetParameter,
    SetShadowCatcher,
    SetUnder,
    SetVariant,
    SetVisible,
)
from app.document.commands.light import (
    SetBackground,
    SetBackgroundColour,
    SetEmission,
    SetEnvironment,
    SetIntensity,
    SetMapChange,
    SetMapping,
    SetRotation,
    SplitEnvironment,
)
from app.document.commands.linked_objects import link_edit
from app.document.commands.links import LinkCurves, UnlinkCurve
from app.document.commands.looks import SetLook
from app.document.commands.maps import SetBumps, SetMap, SetOpacity, SetParameterMap, surface_named
from app.document.commands.mix import SetMix
from app.document.commands.objects import addition, with_presence
from app.document.commands.painted import painted_addition, with_painted
from app.document.commands.plan import FIRST_BANDS, set_first_bands
from app.document.commands.poses import with_amounts, with_placement, with_time
from app.document.commands.suns import SetSun, sun_presence
from app.document.document import Document
from app.document.light_state import ENVIRONMENT_KEY
from app.document.sources import likely_mapping
from app.document.targets import (
    ADD,
    BACKGROUND,
    BACKGROUND_COLOUR,
    EMISSION,
    FRAME,
    FRESNEL_TERM,
    IN_GROUP,
    LINKED,
    LOOK,
    MAP_FIELDS,
    MATERIAL,
    PAINTED,
    PRESENCE_FIELDS,
    SHADOW_CATCHER,
    SIDES,
    TIME,
    UNDER,
    VARIANT,
    Target,
    resolve,
)
from app.files.material_files import import_material, is_material_file
from app.files.materials import Library, full_material_name, import_measured, load_material
from app.system.paths import full_path, is_file_name
from engine.core.errors import InsituError, LoadError
from engine.light.painted_lights import PAINTED_KINDS
from engine.material.layer import FRAMES
from engine.material.parameters import INDICES, reflectance_of_index
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from engine.scene.composition import ADDABLE
from engine.scene.toml_text import parse_toml


def parse_assignment(text: str) -> tuple[str, Any]:
    """("teapot.1.alpha", 0.3) of "teapot.1.alpha=0.3": the value as TOML writes it, a bare word is a string."""
    path, equals, value = text.partition("=")
    path, value = path.strip(), value.strip()
    if not path or not equals or not value:
        raise InsituError(f"{text!r} is not of the form path=value, such as teapot.1.alpha=0.3")
    try:
        return path, parse_toml(f"value = {value}", "--set")["value"]
    except LoadError:
        return path, value


def set_path(document: Document, path: str, value: Any) -> EditCommand:
    """The command that sets ``path`` to ``value``: ``"teapot.1.alpha"``, ``"light.rotation"``…

    Raises InsituError for a path that names nothing with a value. The command line and scripts set by path.
    """
    if path == FIRST_BANDS:
        return set_first_bands(value)
    if path == TIME and all(state.name != TIME for state in document.objects):
        return with_time(value)
    if path == VARIANT and all(state.name != VARIANT for state in document.objects):
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "the name of a variant of the scene")
        return SetVariant(value)
    if path == LOOK and all(state.name != LOOK for state in document.objects):
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "the name of a look of the session")
        return SetLook(value)
    head, _, last = path.rpartition(".")
    if last == ADD and head.startswith(f"light.{PAINTED}."):
        return painted_addition(path, head.removeprefix(f"light.{PAINTED}."), value)
    if last == ADD and all(state.name != head for state in document.objects):
        return addition(path, head, value)
    by_index = _set_by_index(document, path, value)
    if by_index is not None:
        return by_index
    target = resolve(document, path)
    if target.kind == "factor":
        if not isinstance(value, str):
            raise LoadError(path, "value", value, 'the curve that it follows, such as cup.coat.theta_h, or ""')
        return LinkCurves(value, (path,)) if value else UnlinkCurve(path)
    if target.kind == "parameter" and target.key is not None and target.name is not None:
        return SetParameter(target.key, target.name, value)
    if target.kind == "map" and target.key is not None and target.name is not None:
        return SetMap(target.key, target.name, value)
    if target.kind == "parameter_map" and target.key is not None and target.name is not None:
        return SetParameterMap(target.key, target.name, value)
    if target.kind == "bumps" and target.name is not None:
        return SetBumps(target.object, target.name, value)
    if target.kind == "opacity" and target.name is not None:
        return SetOpacity(target.object, target.name, value)
    if target.kind == "surface" and target.name is not None:
        return surface_named(target.object, target.name, value)
    if target.kind == "deformer" and target.name is not None:
        return with_amounts(document, target.object, {target.name: value})
    if target.kind == "transform" and target.name is not None:
        return with_placement(path, target.object, target.name, value)
    if target.kind == "lamp" and target.name is not None:
        return with_lamp_value(path, target.object, target.name, value)
    if target.kind == "group" and target.name is not None:
        return group_edit(document, path, target.object, target.name, value)
    if target.kind == "presence" and target.name == IN_GROUP:
        if not isinstance(value, str):
            raise LoadError(path, "value", value, 'the name of a group, or ""')
        return SetGroup((target.object,), value)
    if target.kind == "presence" and target.name == LINKED:
        return link_edit(path, target.object, value)
    if target.kind == "presence" and target.name is not None:
        return with_presence(path, target.object, target.name, value)
    if target.kind == "time":
        return with_time(value, target.object)
    if target.kind == "light":
        return _set_light(path, target, value)
    if target.kind == "sun" and target.name is not None:
        if target.name in PRESENCE_FIELDS:
            return sun_presence(path, target.object, target.name, value)
        return SetSun(target.object, target.name, value)
    if target.kind == "painted" and target.name is not None:
        return with_painted(path, target.object, target.name, value)
    if target.kind == "mix" and target.name is not None:
        return SetMix(target.object, target.name, value)
    if target.kind == "switch":
        return _set_switch(path, target, value)
    raise InsituError(f"{path!r} is a {target.kind} and has no value; name a parameter of it")


def value_with_full_path(path: str, value: Any) -> Any:
    """A value that `path` is set to, with the absolute path of the file that it names, if it names one. Raises
    InsituError."""
    if isinstance(value, str) and (
        path == ENVIRONMENT_KEY or (path.endswith(f".{ADD}") and value not in (*ADDABLE, *PAINTED_KINDS))
    ):
        return full_path(value)
    is_material = isinstance(value, str) and path.rpartition(".")[2] == MATERIAL
    return full_material_name(value) if is_material else value


def _set_by_index(document: Document, path: str, value: Any) -> SetParameter | None:
    """The command that sets a facing reflectance by its index of refraction, ``"coat.1.fresnel_index"``; None where the
    path is of anything else."""
    head, _, last = path.rpartition(".")
    name = next((name for name, index in INDICES.items() if index.name == last), None)
    if name is None:
        return None
    target = resolve(document, f"{head}.{name}")
    if target.kind != "parameter" or target.key is None:
        return None
    return SetParameter(target.key, name, reflectance_of_index(INDICES[name].accept(value)))


def _set_light(path: str, target: Target, value: Any) -> EditCommand:
    if target.name == "environment":
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "a built-in environment's name or a file's path")
        return SetEnvironment(value, likely_mapping(Path(value)))
    if target.name == "mapping":
        return SetMapping(value)
    if target.name in MAP_FIELDS:
        return SetMapChange(target.name, value)
    if target.name == SIDES:
        return SplitEnvironment(value)
    if target.name == BACKGROUND:
        return SetBackground(value)
    if target.name == BACKGROUND_COLOUR:
        return SetBackgroundColour(value)
    return SetRotation(value) if target.name == "rotation" else SetIntensity(value)


def _set_switch(path: str, target: Target, value: Any) -> EditCommand:
    if target.name == MATERIAL:
        return _set_material(path, target.object, value)
    if target.name == EMISSION:
        return SetEmission(target.object, value)
    owner = target.key or target.object
    if target.name == UNDER:
        if not isinstance(value, str):
            raise LoadError(path, "value", value, 'the name of a layer of the same object, or ""')
        return SetUnder(owner, value)
    if target.name == FRAME:
        if value not in FRAMES:
            raise LoadError(path, "value", value, f"one of {', '.join(FRAMES)}")
        return SetFrame(owner, value)
    if not isinstance(value, bool):
        raise LoadError(path, "value", value, "true or false")
    if target.name == SHADOW_CATCHER:
        return SetShadowCatcher(owner, value)
    if target.name == "editable":
        return SetEditable(owner, value)
    if target.name == FRESNEL_TERM:
        return SetFresnelTerm(owner, value)
    return SetVisible(owner, value) if target.name == "visible" else SetFrozen(owner, value)


def _set_material(path: str, name: str, value: Any) -> SetMaterial:
    if not isinstance(value, str):
        raise LoadError(
            path, "value", value, "the name of a material in the library, or a file of materials or of measurements"
        )
    if Path(value).suffix.lower() in MEASURED_ENDINGS:
        return import_measured(name, Path(value))
    if is_material_file(value):
        return import_material(name, value)
    material = load_material(Path(value)) if is_file_name(value) else Library().entry(value).material
    return SetMaterial(name, material.layers, material.name)
