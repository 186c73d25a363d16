"""Edits of an object's surface below all of its layers: its normal or bump map (`engine.material.bumps`), and its
settings for Deform (`engine.scene.surface_kinds`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document.document import SURFACE, Document, ObjectState
from engine.core.errors import InsituError, LoadError
from engine.material.bumps import set_bump_field
from engine.scene.surface_kinds import SURFACES, surface_with

NONE = "none"


@dataclass(frozen=True)
class SetBumps:
    """Set a part of an object's bumps; an image's name of "" removes it."""

    object: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.object} {self.name.replace('_', ' ')}"

    def apply(self, document: Document) -> Document:
        state = _reflecting(document, self.object, "bumps")
        bumps = set_bump_field(state.bumps, self.name, self.value)
        return document.with_object(replace(state, new_bumps=None if bumps == state.own_bumps else bumps))


@dataclass(frozen=True)
class SetSurface:
    """Make an object's surface one of a kind ("": of none), with these values of that kind's parameters."""

    object: str
    kind: str
    values: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        what = self.values[0][0] if self.values else self.kind or SURFACE
        return f"{self.object} {what}"

    def apply(self, document: Document) -> Document:
        state = _reflecting(document, self.object, "a surface for Deform")
        new = surface_with(state.surface, self.kind, dict(self.values), self.object)
        return document.with_object(replace(state, new_surface=None if new == state.own_surface else new))


def surface_named(object_name: str, path: str, value: Any) -> SetSurface:
    """The command for "surface" = "membrane", or "none"; or "membrane.translucency" = 0.5. Raises LoadError."""
    kind, _, name = path.partition(".")
    if kind == SURFACE and not name:
        if value not in (NONE, *SURFACES):
            raise LoadError(object_name, SURFACE, value, f"one of {', '.join((NONE, *SURFACES))}")
        return SetSurface(object_name, "" if value == NONE else value)
    if kind == SURFACE or not name:
        raise LoadError(object_name, path, value, f"{SURFACE}, or one of its values such as membrane.translucency")
    return SetSurface(object_name, kind, ((name, value),))


def _reflecting(document: Document, name: str, what: str) -> ObjectState:
    """An object to edit. Raises InsituError where it is frozen or cannot have `what`."""
    state = document.object(name)
    if state.frozen:
        raise InsituError(f"{name} is frozen; thaw it to edit it")
    if state.is_lamp:
        raise InsituError(f"{name} is an emitter; only objects that reflect have {what}")
    return state
