"""The edits of looks: made, chosen, renamed, moved and deleted (`app.document.looks`)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from pydantic import TypeAdapter, ValidationError

from app.document.document import Document, unknown
from app.document.looks import FIRST_NAME, Look, in_look, look_names, state_of
from app.document.scene_objects import numbered_name
from engine.core.errors import InsituError
from engine.scene.description import LONGEST_NAME, Name

MAX_LOOKS = 64
_NAMES = TypeAdapter[str](Name)


@dataclass(frozen=True)
class AddLook:
    """Add a look behind the current one, equal to it, and make it current; name: "" for the next free one. Without any
    look what there was is "Look 1" from now on."""

    name: str = ""

    @property
    def label(self) -> str:
        return f"new look {self.name}".rstrip()

    def apply(self, document: Document) -> Document:
        first = FIRST_NAME if self.name != FIRST_NAME else "Look 2"
        looks = document.looks or (Look(first),)
        if len(looks) >= MAX_LOOKS:
            raise InsituError(f"no look is added: a scene has at most {MAX_LOOKS}")
        taken = [each.name for each in looks]
        name = self.name or numbered_name("Look", taken)
        added = Look(_checked(name, taken))
        place = next(k for k, each in enumerate(looks) if each.state is None)
        before = Look(looks[place].name, state_of(document))
        return replace(document, looks=(*looks[:place], before, added, *looks[place + 1 :]))


@dataclass(frozen=True)
class SetLook:
    """Make a look current."""

    name: str

    @property
    def label(self) -> str:
        return f"look {self.name}"

    def apply(self, document: Document) -> Document:
        return in_look(document, self.name)


@dataclass(frozen=True)
class RenameLook:
    """Give a look another name."""

    look: str
    name: str

    @property
    def label(self) -> str:
        return f"rename the look {self.look}"

    def apply(self, document: Document) -> Document:
        place = _place_of(document, self.look)
        name = _checked(self.name, [each for each in look_names(document) if each != self.look])
        looks = (*document.looks[:place], replace(document.looks[place], name=name), *document.looks[place + 1 :])
        return replace(document, looks=looks)


@dataclass(frozen=True)
class DeleteLook:
    """Delete a look; of the current one the next becomes current, and what is there stays where it was the last."""

    look: str

    @property
    def label(self) -> str:
        return f"delete the look {self.look}"

    def apply(self, document: Document) -> Document:
        place, names = _place_of(document, self.look), look_names(document)
        if len(names) > 1 and document.look == self.look:
            document = in_look(document, names[place + 1] if place + 1 < len(names) else names[place - 1])
        return replace(document, looks=tuple(each for each in document.looks if each.name != self.look))


@dataclass(frozen=True)
class MoveLook:
    """Move a look to another place among them, from 0; beyond the ends: to the end."""

    look: str
    to: int

    @property
    def label(self) -> str:
        return f"move the look {self.look}"

    def apply(self, document: Document) -> Document:
        place = _place_of(document, self.look)
        looks = [*document.looks]
        looks.insert(min(max(self.to, 0), len(looks) - 1), looks.pop(place))
        return replace(document, looks=tuple(looks))


def _place_of(document: Document, name: str) -> int:
    """The index of a look. Raises InsituError."""
    names = look_names(document)
    if name not in names:
        raise unknown("look", name, names)
    return names.index(name)


def _checked(name: str, taken: Collection[str]) -> str:
    """A name for a look. Raises InsituError."""
    try:
        _NAMES.validate_python(name)
    except ValidationError:
        expected = f"a name of 1 to {LONGEST_NAME} characters without . = [ ] and quotes"
        raise InsituError(f"look = {name!r}, expected {expected}") from None
    if name in taken:
        raise InsituError(f"look = {name!r}, expected a name that no other look has")
    return name
