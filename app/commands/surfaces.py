"""Edits of what Deform knows of an object's surface beyond its material (`engine.scene.surface_kinds`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document import SURFACE, Document
from engine.errors import InsituError, LoadError
from engine.scene.surface_kinds import SURFACES, surface_with

NONE = "none"


@dataclass(frozen=True)
class SetSurface:
    """Make an object's surface one of a kind ("": of none), with these values of what that kind has."""

    object: str
    kind: str
    values: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        return f"{self.object} {self.kind or 'surface'}"

    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        if state.frozen:
            raise InsituError(f"{self.object} is frozen; thaw it to edit it")
        if state.emits:
            raise InsituError(f"{self.object} shines; only what reflects has a surface for Deform")
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
