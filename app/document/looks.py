"""Looks: named variants of a document's materials, light, poses and background, one of which is current.

The current look is the document itself: every edit goes to it, and its entry in `Document.looks` has no state. The
others are stored as what they replace, `LookState`, which shares all objects that looks have in common. So edits need
not know of looks, a switch is an exchange of values, and undo restores bit by bit.

All looks share which objects there are, in which order and under which names, the plan and the bands. An edit of these
is carried out in each look (`in_all_looks`). Rejected: differences to one base look, as in USD's variants: an edit of
the base would change looks that nobody sees at that moment. Session files alone write looks as differences.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.document.background import Background
    from app.document.document import Document, ObjectState
    from app.document.light_state import LightState

FIRST_NAME = "Look 1"


@dataclass(frozen=True)
class LookState:
    """What differs between looks. The names and the order of objects, absent ones too, are those of all looks."""

    objects: tuple[ObjectState, ...]
    light: LightState
    background: Background
    absent: tuple[ObjectState, ...] = ()


@dataclass(frozen=True)
class Look:
    """A look by its name; state: None for the current one, which is the document itself."""

    name: str
    state: LookState | None = None


def state_of(document: Document) -> LookState:
    """The state of the current look."""
    return LookState(document.objects, document.light, document.background, document.absent)


def look_names(document: Document) -> tuple[str, ...]:
    """The names of its looks, in their order; none where it has one state without a name."""
    return tuple(each.name for each in document.looks)


def shown_looks(document: Document, count: int) -> tuple[str, ...]:
    """The names of the looks that are shown side by side: the first ones, the current one among them."""
    names = look_names(document)
    shown = names[:count]
    return shown if document.look in shown else (*shown[:-1], document.look)


def in_look(document: Document, name: str) -> Document:
    """The document with this look as its current one. Raises InsituError where it has none of that name."""
    from app.document.document import unknown

    chosen = next((each for each in document.looks if each.name == name), None)
    if chosen is None:
        raise unknown("look", name, look_names(document))
    if chosen.state is None:
        return document
    looks = tuple(
        Look(name) if each is chosen else each if each.state is not None else Look(each.name, state_of(document))
        for each in document.looks
    )
    return replace(document, **vars(chosen.state), looks=looks)


def in_all_looks(document: Document, edit: Callable[[Document], Document]) -> Document:
    """The document after an edit of what looks share, carried out in each of them."""
    changed = edit(document)
    if not document.looks:
        return changed
    looks = tuple(
        each if each.state is None else Look(each.name, state_of(edit(in_look(document, each.name))))
        for each in document.looks
    )
    return replace(changed, looks=looks)


def objects_of_looks(document: Document) -> tuple[ObjectState, ...]:
    """The objects of all looks; those that several have once."""
    looks = (each.state for each in document.looks if each.state is not None)
    states = (*document.objects, *(state for each in looks for state in each.objects))
    return tuple({id(state): state for state in states}.values())


def absent_of_looks(document: Document) -> tuple[ObjectState, ...]:
    """The absent objects of all looks (`Document.absent`)."""
    looks = (each.state for each in document.looks if each.state is not None)
    return (*document.absent, *(state for each in looks for state in each.absent))


def lights_of_looks(document: Document) -> tuple[LightState, ...]:
    """The lights of all looks."""
    return (document.light, *(each.state.light for each in document.looks if each.state is not None))


def carried_out_in_all_looks(apply: Callable[[Any, Document], Document]) -> Callable[[Any, Document], Document]:
    """A command's `apply`, for a command that edits what looks share."""

    @functools.wraps(apply)
    def apply_to_all(command: Any, document: Document) -> Document:
        return in_all_looks(document, functools.partial(apply, command))

    return apply_to_all
