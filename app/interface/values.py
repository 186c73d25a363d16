"""The values that paths name, as scripts and the Python interface read them."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from app.document.commands.lamps import lamp_value
from app.document.commands.painted import place_of
from app.document.commands.suns import angles_of, sun_named
from app.document.document import Document
from app.document.light_state import group_of
from app.document.targets import (
    BACKGROUND,
    BACKGROUND_COLOUR,
    FRAME,
    IN_GROUP,
    LINKED,
    MATERIAL,
    PLACE,
    PRESENCE_FIELDS,
    TRANSFORM_FIELDS,
    UNDER,
    resolve,
)
from app.system.memory import require_memory_for
from engine.core.errors import InsituError
from engine.light.suns import Sun
from engine.material.parameter_maps import parameter_map_table
from engine.scene.surface_kinds import SURFACES

MAX_SIDE = 16384


def value_at(document: Document, path: str) -> Any:
    """The value that a path names. Raises InsituError for a path that names none."""
    target = resolve(document, path)
    name = target.name or ""
    if target.kind == "light":
        if name in (BACKGROUND, BACKGROUND_COLOUR):
            return document.background.kind if name == BACKGROUND else document.background.colour
        return getattr(document.light, name)
    if target.kind == "sun" and name:
        return _value_of_sun(sun_named(document, target.object), name)
    if target.kind == "group" and name:
        members = map(document.object, document.groups[target.object])
        return target.object if name == "name" else all(getattr(state, name) for state in members)
    if target.kind == "painted":
        place = place_of(document, target.object)
        return {PLACE: place, "deleted": False}.get(name, getattr(document.light.painted[place], name, None))
    if target.kind == "mix":
        row = document.light.row(target.object)
        return group_of(target.object) or row.group if name == "group" else getattr(row, name)
    if target.key is not None and target.layer is not None:
        layer = document.layer(target.key)
        match target.kind:
            case "parameter":
                return layer.values[name]
            case "map":
                return getattr(layer.maps, name)
            case "parameter_map":
                own = layer.parameter_map(name)
                return None if own is None else parameter_map_table(own)
            case "switch" if name in ("visible", "frozen", UNDER, FRAME):
                return getattr(layer, name)
            case "switch":
                return layer.fresnel is not None
    state = document.object(target.object)
    match target.kind:
        case "switch" if name == MATERIAL:
            raise InsituError(f"{path} can be set alone; what the object has stands in its layers")
        case "switch":
            return getattr(state, name)
        case "deformer":
            return next((each.amount for each in state.deformations if each.kind == name), 0.0)
        case "presence" if name in (IN_GROUP, LINKED):
            return getattr(state, name)
        case "presence":
            return state.name if name == "name" else False if name == "deleted" else ""
        case "transform":
            return getattr(state.transform, TRANSFORM_FIELDS[name])
        case "lamp":
            return lamp_value(state, name)
        case "time":
            return None if state.moment is None else state.moment.time
        case "bumps":
            return getattr(state.bumps, name)
        case "opacity":
            return getattr(state.opacity, name)
        case "surface" if name not in SURFACES and "." not in name:
            return state.surface.kind or "none"
    raise InsituError(f"{path!r} is a {target.kind} and has no value")


def _value_of_sun(sun: Sun, name: str) -> Any:
    if name in ("azimuth", "elevation"):
        return angles_of(sun.direction)[("azimuth", "elevation").index(name)]
    if name in PRESENCE_FIELDS:
        return sun.name if name == "name" else "" if name == "duplicate" else False
    return getattr(sun, name)


def plain_value(value: object) -> object:
    """The value as files store it: numbers and tuples of them for NumPy's, a string for a path."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    return tuple(value) if isinstance(value, list) else os.fspath(value) if isinstance(value, os.PathLike) else value


def checked_resolution(resolution: tuple[int, int] | None) -> tuple[int, int] | None:
    """A resolution, which a picture must have room for. Raises InsituError."""
    if resolution is None:
        return None
    width_height = tuple(resolution) if isinstance(resolution, (tuple, list)) else ()
    sides_fit = all(isinstance(n, int) and not isinstance(n, bool) and 1 <= n <= MAX_SIDE for n in width_height)
    if len(width_height) != 2 or not sides_fit:
        raise InsituError(f"resolution = {resolution!r}, expected (width, height) from 1 to {MAX_SIDE}")
    require_memory_for((width_height[0], width_height[1]))
    return width_height[0], width_height[1]
