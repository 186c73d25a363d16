"""The edits of which objects share their material (`app.document.linked_objects`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from app.document.commands.several import named_together
from app.document.document import Document
from app.document.linked_objects import frozen_one, linked_objects, with_material_of
from app.document.looks import carried_out_in_all_looks
from app.document.scene_objects import checked_name
from engine.core.errors import InsituError, LoadError


@dataclass(frozen=True)
class LinkObjects:
    """Let objects share the material of those that have the link of this name, the first of them where none has it; "":
    each keeps what it has, and is edited alone from now on."""

    objects: tuple[str, ...]
    link: str = ""

    @property
    def label(self) -> str:
        return f"{'link' if self.link else 'make single user of'} {named_together(self.objects)}"

    @carried_out_in_all_looks
    def apply(self, document: Document) -> Document:
        link = checked_name(self.link) if self.link else ""
        for name in self.objects:
            state = document.object(name)
            every = (*document.objects, *document.absent)
            there = next((each for each in every if link and each.linked == link), state)
            if there.source != state.source:
                raise InsituError(f"{name} is not linked to {there.name}: only duplicates of one object are")
            if there is not state and (frozen := frozen_one(document, name)):
                raise InsituError(f"{frozen} is frozen; thaw it to change its material")
            linked = replace(with_material_of(state, there), linked=link)
            objects = tuple(linked if each is state else each for each in document.objects)
            document = replace(document, objects=objects)
        return document


def single_users(document: Document, names: tuple[str, ...]) -> LinkObjects:
    """The edit that takes those of these objects out of their links that share a material. Raises InsituError where
    none does."""
    linked = tuple(name for name in names if linked_objects(document, name))
    if not linked:
        raise InsituError("none of these objects shares its material with another one")
    return LinkObjects(linked)


def link_edit(path: str, name: str, value: Any) -> LinkObjects:
    """The edit that a value from a file or a command line of an object's `linked` stands for. Raises LoadError."""
    if not isinstance(value, str):
        raise LoadError(path, "value", value, 'the name of a link of objects, or ""')
    return LinkObjects((name,), value)
