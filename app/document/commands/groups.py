"""The edits of groups: objects that are selected, moved, shown and hidden together.

An object names the group that it is in (`ObjectState.in_group`), so that a group follows its objects through renames,
duplicates and sessions, and is gone with the last of them. Groups have no groups in them: several that are to move
together are selected together. Rejected: a list of members beside the objects, which each edit of these would have to
keep.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.document.commands.layers import SetFrozen, SetVisible
from app.document.commands.several import Several, named_together
from app.document.document import Document, unknown
from app.document.scene_objects import checked_name, numbered_name, with_group
from engine.core.errors import InsituError, LoadError

NEW_GROUP = "Group"


@dataclass(frozen=True)
class SetGroup:
    """Put objects in the group of this name, with those that it has; "": in none."""

    objects: tuple[str, ...]
    name: str = ""

    @property
    def label(self) -> str:
        return f"{'group' if self.name else 'ungroup'} {named_together(self.objects)}"

    def apply(self, document: Document) -> Document:
        if not self.objects:
            raise InsituError("a group has at least one object")
        name = checked_name(self.name) if self.name else ""
        for each in self.objects:
            document.object(each)
        return with_group(document, self.objects, name)


@dataclass(frozen=True)
class RenameGroup:
    """Give a group another name; "" dissolves it."""

    group: str
    name: str

    @property
    def label(self) -> str:
        return f"rename {self.group}" if self.name else f"ungroup {self.group}"

    def apply(self, document: Document) -> Document:
        members = members_of(document, self.group)
        if self.name == self.group:
            return document
        if self.name in document.groups:
            raise InsituError(f"name = {self.name!r}, expected one that no other group has")
        return with_group(document, members, checked_name(self.name) if self.name else "")


def members_of(document: Document, group: str) -> tuple[str, ...]:
    """The objects of a group. Raises InsituError."""
    if group not in document.groups:
        raise unknown("group", group, document.groups)
    return document.groups[group]


def free_group_name(document: Document) -> str:
    """A name for a new group."""
    return numbered_name(NEW_GROUP, document.groups) if NEW_GROUP in document.groups else NEW_GROUP


def ungrouping(document: Document, names: tuple[str, ...]) -> Several:
    """The edit that dissolves all groups that these objects are in. Raises InsituError where there are none."""
    groups = dict.fromkeys(each for name in names if (each := document.object(name).in_group))
    if not groups:
        raise InsituError("none of these objects is in a group")
    return Several(tuple(RenameGroup(group, "") for group in groups), f"ungroup {' and '.join(groups)}")


def group_edit(document: Document, path: str, group: str, field: str, value: Any) -> Several | RenameGroup:
    """The edit that sets a group's `name`, `visible` or `frozen` to a value from a file or a command line. Raises
    InsituError."""
    members = members_of(document, group)
    if field == "name":
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "a name")
        return RenameGroup(group, value)
    if not isinstance(value, bool):
        raise LoadError(path, "value", value, "true or false")
    return switching(members, field, value, group)


def switching(names: tuple[str, ...], field: str, value: bool, of: str = "") -> Several:
    """The edit that shows or hides, freezes or thaws objects in one step; of: what its label calls them."""
    commands = tuple((SetVisible if field == "visible" else SetFrozen)(name, value) for name in names)
    return Several(commands, f"{commands[0].label.split()[0]} {of or named_together(names)}")
