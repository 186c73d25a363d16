"""Which objects of a scene a document has: their order, their names, and the scene's own with the same objects."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from pydantic import TypeAdapter, ValidationError

from app.document.document import Document, ObjectState
from app.document.looks import in_all_looks
from engine.core.errors import InsituError
from engine.scene.composition import ObjectSource
from engine.scene.description import LONGEST_NAME, Name

# Objects that the scene's file does not have, as they were read, by what they were read from.
AddedStates = Mapping[ObjectSource, ObjectState]
NONE_ADDED: AddedStates = MappingProxyType({})
_NAMES = TypeAdapter[str](Name)
_NUMBERED = re.compile(r"(?P<name>.*\S) \d+")


def in_scene_order(states: Iterable[ObjectState], scene: Document) -> tuple[ObjectState, ...]:
    """Objects in the order of the scene's, duplicates with their originals, in the order that they come in; those that
    were added at the end."""
    place: dict[ObjectSource, int] = {state.name: k for k, state in enumerate(scene.objects)}
    return tuple(sorted(states, key=lambda state: place.get(state.source, len(place))))


def by_source(described: Document, added: AddedStates) -> dict[ObjectSource, ObjectState]:
    """The objects of a scene as its file describes it, and those that were added, as they were read."""
    found: dict[ObjectSource, ObjectState] = {state.name: state for state in described.objects}
    return found | dict(added)


def with_objects_of(described: Document, document: Document, added: AddedStates = NONE_ADDED) -> Document:
    """The document of a scene as its file describes it, with the objects that another document of this scene has;
    added: those that the file does not have, as they were read."""
    if document.composition is None:
        return described
    own = by_source(described, added)
    objects = tuple(
        replace(own[state.source], name=state.name, original=state.original)
        for state in document.objects if state.source in own
    )  # fmt: skip
    return replace(described, objects=objects, deleted=document.deleted)


def with_group(document: Document, names: Collection[str], group: str) -> Document:
    """The document with these objects in a group of this name, in all its looks; "": in none."""

    def grouped(look: Document) -> Document:
        states = (replace(each, in_group=group) if each.name in names else each for each in look.objects)
        return replace(look, objects=tuple(states))

    return in_all_looks(document, grouped)


def without_sources(document: Document, missing: Collection[ObjectSource], described: Document) -> Document:
    """The document where the objects that are read from these are absent, in all its looks: they wait for their files
    with all edits. described: the scene as its file describes it, whose objects it has where no others are left."""

    def left(look: Document) -> Document:
        gone = tuple(state for state in look.objects if state.source in missing)
        if not gone:
            return look
        objects, deleted = tuple(state for state in look.objects if state.source not in missing), look.deleted
        if not objects:
            objects, deleted = tuple(with_free_names(described.objects, {state.name for state in gone})), ()
        return replace(look, objects=objects, absent=(*look.absent, *gone), deleted=deleted)

    return in_all_looks(document, left)


def with_free_names(own: Sequence[ObjectState], taken: Collection[str]) -> list[ObjectState]:
    """Objects of the scene's file under names that no others have taken, which they keep as their originals."""
    found, names = list[ObjectState](), {*taken, *(state.name for state in own)}
    for state in own:
        if state.name in taken:
            state = replace(state, name=numbered_name(state.name, names), original=state.name)
            names.add(state.name)
        found.append(state)
    return found


def taken_names(document: Document) -> set[str]:
    """The names that another object or light cannot have."""
    light = document.light
    suns = {each.name for each in (*light.suns, *light.own_suns)}
    return {each.name for each in (*document.objects, *document.absent)} | set(document.deleted) | suns


def checked_name(name: str) -> str:
    """A name of objects, lights or groups. Raises InsituError."""
    try:
        return _NAMES.validate_python(name)
    except ValidationError:
        expected = f"a name of 1 to {LONGEST_NAME} characters without . = [ ] and quotes"
        raise InsituError(f"name = {name!r}, expected {expected}") from None


def checked_new_name(document: Document, name: str) -> str:
    """A name for another object or light. Raises InsituError."""
    checked_name(name)
    objects, suns = (*document.objects, *document.absent), document.light.suns
    if any(each.name == name for each in objects):
        raise InsituError(f"name = {name!r}, expected one that no other object has")
    if any(each.name == name for each in suns):
        raise InsituError(f"name = {name!r}, expected one that no sun has")
    return name


def numbered_name(name: str, taken: Collection[str]) -> str:
    """The name with the first number from 2 on that is not taken: "cup 2" of "cup" and of "cup 7"."""
    numbered = _NUMBERED.fullmatch(name)
    base, number = numbered["name"] if numbered else name, 2
    while (found := f"{base[: LONGEST_NAME - len(str(number)) - 1].rstrip()} {number}") in taken:
        number += 1
    return found
