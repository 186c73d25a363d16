"""The edit that sets the value of a path: how the command line and scripts make the user's edits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.document.commands import EditCommand
from app.document.commands.layers import SetEditable, SetFresnelTerm, SetFrozen, SetMaterial, SetParameter, SetVisible
from app.document.commands.light import SetEmission, SetEnvironment, SetIntensity, SetMapping, SetRotation
from app.document.commands.maps import SetBumps, SetMap, surface_named
from app.document.commands.plan import FIRST_BANDS, set_first_bands
from app.document.commands.poses import with_amounts, with_time
from app.document.document import EMISSION, FRESNEL_TERM, MATERIAL, TIME, Document, Target, resolve
from app.document.sources import likely_mapping
from app.files.library import Library
from app.files.material_file import load_material
from app.files.measured_import import import_measured
from app.system.paths import is_file_name
from engine.core.errors import InsituError, LoadError
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS


def set_path(document: Document, path: str, value: Any) -> EditCommand:
    """The command that sets ``path`` to ``value``: ``"teapot.1.alpha"``, ``"light.rotation"``…

    Raises InsituError for a path that names nothing with a value. The command line and scripts set by path.
    """
    if path == FIRST_BANDS:
        return set_first_bands(value)
    if path == TIME and all(state.name != TIME for state in document.objects):
        return with_time(value)
    target = resolve(document, path)
    if target.kind == "parameter" and target.key is not None and target.name is not None:
        return SetParameter(target.key, target.name, value)
    if target.kind == "map" and target.key is not None and target.name is not None:
        return SetMap(target.key, target.name, value)
    if target.kind == "bumps" and target.name is not None:
        return SetBumps(target.object, target.name, value)
    if target.kind == "surface" and target.name is not None:
        return surface_named(target.object, target.name, value)
    if target.kind == "deformer" and target.name is not None:
        return with_amounts(document, target.object, {target.name: value})
    if target.kind == "time":
        return with_time(value, target.object)
    if target.kind == "light":
        return _set_light(path, target, value)
    if target.kind == "switch":
        return _set_switch(path, target, value)
    raise InsituError(f"{path!r} is a {target.kind} and has no value; name a parameter of it")


def _set_light(path: str, target: Target, value: Any) -> EditCommand:
    if target.name == "environment":
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "a built-in environment's name or a file's path")
        return SetEnvironment(value, likely_mapping(Path(value)))
    if target.name == "mapping":
        return SetMapping(value)
    return SetRotation(value) if target.name == "rotation" else SetIntensity(value)


def _set_switch(path: str, target: Target, value: Any) -> EditCommand:
    if target.name == MATERIAL:
        return _set_material(path, target.object, value)
    if target.name == EMISSION:
        return SetEmission(target.object, value)
    if not isinstance(value, bool):
        raise LoadError(path, "value", value, "true or false")
    owner = target.key or target.object
    if target.name == "editable":
        return SetEditable(owner, value)
    if target.name == FRESNEL_TERM:
        return SetFresnelTerm(owner, value)
    return SetVisible(owner, value) if target.name == "visible" else SetFrozen(owner, value)


def _set_material(path: str, name: str, value: Any) -> SetMaterial:
    if not isinstance(value, str):
        raise LoadError(path, "value", value, "the name of a material in the library, a material's or a measured file")
    if Path(value).suffix.lower() in MEASURED_ENDINGS:
        return import_measured(name, Path(value))
    material = load_material(Path(value)) if is_file_name(value) else Library().entry(value).material
    return SetMaterial(name, material.layers, material.name)
