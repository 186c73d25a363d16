"""The edits of which objects there are: added, duplicated, deleted, renamed and shown ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from app.document.commands.several import named_together
from app.document.commands.suns import AddSun
from app.document.document import Document, ObjectState
from app.document.light_state import sun_key
from app.document.linked_objects import free_link
from app.document.looks import carried_out_in_all_looks
from app.document.scene_objects import checked_new_name, numbered_name, taken_names, with_group
from app.document.targets import LINKED_DUPLICATE, check_presence
from app.system.paths import full_path
from engine.core.errors import InsituError, LoadError
from engine.scene.composition import ADDABLE, SUN
from engine.scene.description import LONGEST_NAME, MAX_OBJECTS


@dataclass(frozen=True)
class AddObject:
    """Add a shape or a light, by its name, or all objects of a file, by its full path, behind the others. name: of what
    is added, "" for its own, with a number where that is taken; at: the point that it stands on, of a light its middle,
    None for where there is room; size: its largest side in metres, None for its own. objects: what was read, () before
    (`engine.scene.added_objects`)."""

    what: str
    name: str = ""
    at: tuple[float, float, float] | None = None
    size: float | None = None
    objects: tuple[ObjectState, ...] = ()

    @property
    def label(self) -> str:
        return f"add {Path(self.what).name}"

    def check(self, document: Document) -> None:
        """Raise InsituError where it would not be carried out."""
        if self.name:
            checked_new_name(document, self.name)
        if self.size is not None and not 1e-6 <= self.size <= 1e6:
            raise InsituError(f"size = {self.size!r}, expected metres from 1e-06 to 1e+06")
        if self.at is not None and not (len(self.at) == 3 and all(abs(each) <= 1e9 for each in self.at)):
            raise InsituError(f"at = {self.at!r}, expected three numbers, in metres")
        if len(document.objects) + max(len(self.objects), 1) > MAX_OBJECTS:
            raise InsituError(f"{Path(self.what).name} is not added: a scene has at most {MAX_OBJECTS} objects")

    @carried_out_in_all_looks
    def apply(self, document: Document) -> Document:
        self.check(document)
        taken = taken_names(document)
        found = list[ObjectState]()
        for state in self.objects:
            name = self._name_of(state)
            name = numbered_name(name, taken) if name in taken else name
            found.append(replace(state, name=name))
            taken.add(name)
        return replace(document, objects=(*document.objects, *found))

    def _name_of(self, state: ObjectState) -> str:
        """What an object is to be called: the given name, with what its own has behind that of the first."""
        first = self.objects[0].name
        more = state.name.removeprefix(first) if state.name.startswith(f"{first} ") else ""
        return f"{self.name}{more}" if self.name and len(self.name + more) <= LONGEST_NAME else self.name or state.name


@dataclass(frozen=True)
class DuplicateObject:
    """Add a duplicate behind an object: the same shape, material, pose and place, with a row of its own in the mix.
    name: of the duplicate; "" for the object's with the next number. linked: whether they share the material from then
    on (`app.document.linked_objects`)."""

    object: str
    name: str = ""
    linked: bool = False

    @property
    def label(self) -> str:
        return f"{'linked ' if self.linked else ''}duplicate {self.object}"

    @carried_out_in_all_looks
    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        if len(document.objects) == MAX_OBJECTS:
            raise InsituError(f"{self.object} is not duplicated: a scene has at most {MAX_OBJECTS} objects")
        name = checked_new_name(document, self.name) if self.name else free_name(document, self.object)
        place = document.objects.index(state)
        link = (state.linked or free_link(document, state.name)) if self.linked else ""
        own = replace(state, linked=link) if link else state
        copy = replace(_renamed(state, name), linked=link)
        objects = (*document.objects[:place], own, copy, *document.objects[place + 1 :])
        light = document.light.with_duplicate(name, state.name)
        return _of_file(replace(document, objects=objects, light=light))


@dataclass(frozen=True)
class DuplicateObjects:
    """Add duplicates of several objects, each linked to its original or not. Those of a whole group are a group of
    their own, with the next number."""

    objects: tuple[str, ...]
    linked: bool = False

    @property
    def label(self) -> str:
        return f"{'linked ' if self.linked else ''}duplicate {named_together(self.objects)}"

    def apply(self, document: Document) -> Document:
        found = document
        for name in self.objects:
            found = DuplicateObject(name, linked=self.linked).apply(found)
        copies = duplicates_of(document, found)
        for group, members in document.groups.items():
            if len(members) > 1 and copies.keys() >= set(members):
                new = numbered_name(group, found.groups)
                found = with_group(found, {copies[name] for name in members}, new)
        return found


@dataclass(frozen=True)
class DeleteObject:
    """Delete an object, with its row in the mix; of a scene without objects the light remains."""

    object: str

    @property
    def label(self) -> str:
        return f"delete {self.object}"

    @carried_out_in_all_looks
    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        objects = tuple(each for each in document.objects if each is not state)
        deleted = (*document.deleted, state.name) if state.is_of_file else document.deleted
        return replace(document, objects=objects, light=document.light.without_object(state.name), deleted=deleted)


@dataclass(frozen=True)
class RenameObject:
    """Give an object another name, with its row in the mix and its lines of the plan."""

    object: str
    name: str

    @property
    def label(self) -> str:
        return f"rename {self.object}"

    @carried_out_in_all_looks
    def apply(self, document: Document) -> Document:
        state = document.object(self.object)
        if self.name == self.object:
            return document
        name = checked_new_name(document, self.name)
        renamed = _renamed(state, name)
        objects = tuple(renamed if each is state else each for each in document.objects)
        deleted = (*document.deleted, state.name) if state.is_of_file else document.deleted
        names = {state.name: name}
        return _of_file(replace(
            document, objects=objects, deleted=deleted, light=document.light.with_renamed_rows(names),
            overrides=tuple(sorted((_line_of(line, names), value) for line, value in document.overrides)),
        ))  # fmt: skip


@dataclass(frozen=True)
class ShowObjects:
    """Show all objects that are hidden."""

    label = "show all objects"

    def apply(self, document: Document) -> Document:
        objects = tuple(each if each.visible else replace(each, visible=True) for each in document.objects)
        return replace(document, objects=objects)


def addition(path: str, name: str, value: Any) -> AddObject | AddSun:
    """The command that ``"ball.add"`` stands for, by a value from a file or a command line: the name of a shape or a
    light, or a file; of a sun ``"light.Noon.add"``, too. Raises InsituError."""
    if not isinstance(value, str):
        raise LoadError(path, "value", value, f"one of {', '.join((*ADDABLE, SUN))}, or the path of a mesh file")
    if value == SUN:
        return AddSun(name.removeprefix(sun_key("")))
    return AddObject(value if value in ADDABLE else full_path(value), name)


def with_presence(path: str, name: str, field: str, value: Any) -> DuplicateObject | DeleteObject | RenameObject:
    """The command that an object's `name`, `duplicate` or `linked_duplicate` (the name of a new one) or `deleted`
    (true) stands for, by a value from a file or a command line. Raises LoadError."""
    check_presence(path, field, value)
    if field == "deleted":
        return DeleteObject(name)
    return RenameObject(name, value) if field == "name" else DuplicateObject(name, value, field == LINKED_DUPLICATE)


def duplicates_of(before: Document, document: Document) -> dict[str, str]:
    """The names of the duplicates that a document has more than before, by those of their originals, which they stand
    behind."""
    there = {state.name for state in before.objects}
    return {a.name: b.name for a, b in pairwise(document.objects) if b.name not in there}


def free_name(document: Document, name: str) -> str:
    """The name with the first number from 2 on that no object of the document or of its file has: "cup 2"."""
    return numbered_name(name, taken_names(document))


def _renamed(state: ObjectState, name: str) -> ObjectState:
    source = state.original or state.name
    original = "" if state.added is not None or source == name else source
    return replace(state, name=name, original=original, former_name="")


def _of_file(document: Document) -> Document:
    """The document without those among its deleted objects that it has by their names."""
    there = {state.name for state in document.objects if state.is_of_file}
    return replace(document, deleted=tuple(name for name in document.deleted if name not in there))


def _line_of(line: str, names: Mapping[str, str]) -> str:
    """The name of a line of the plan, which begins with that of an object where it is a curve's."""
    name, dot, rest = line.partition(".")
    return f"{names.get(name, name)}{dot}{rest}" if dot else line
