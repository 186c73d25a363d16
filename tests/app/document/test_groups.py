"""Groups of objects: commands, paths, sessions, and random sequences that keep each object in at most one."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from app.document.commands import (
    AddLook,
    DeleteObject,
    DuplicateObject,
    DuplicateObjects,
    EditCommand,
    RenameGroup,
    RenameObject,
    SetGroup,
    SetLook,
    SetTransform,
)
from app.document.commands.groups import free_group_name, ungrouping
from app.document.document import Document
from app.document.looks import in_look
from app.document.scene_change import SceneChange
from app.document.selection import clicked, group_around, select_in_view, toggled
from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.interface.values import value_at
from app.project.assignments import set_path
from engine.core.errors import InsituError


def edited(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


@pytest.fixture
def grouped(document: Document) -> Document:
    """The pot and the lamp in a group, the floor in none."""
    return SetGroup(("pot", "lamp"), "Tea").apply(document)


def test_a_group_follows_its_objects(document: Document, grouped: Document) -> None:
    assert grouped.groups == {"Tea": ("pot", "lamp")} and document.groups == {}
    assert edited(grouped, RenameObject("pot", "mug")).groups == {"Tea": ("mug", "lamp")}
    assert edited(grouped, DeleteObject("pot")).groups == {"Tea": ("lamp",)}
    assert edited(grouped, DeleteObject("pot"), DeleteObject("lamp")).groups == {}
    assert edited(grouped, DuplicateObject("pot")).groups == {"Tea": ("pot", "pot 2", "lamp")}
    assert edited(grouped, SetGroup(("floor",), "Tea")).groups == {"Tea": ("pot", "floor", "lamp")}
    assert edited(grouped, SetGroup(("pot", "floor"), "Set")).groups == {"Set": ("pot", "floor"), "Tea": ("lamp",)}
    assert edited(grouped, SetGroup(("pot", "lamp"))) == document == edited(grouped, RenameGroup("Tea", ""))
    assert grouped.composition is None and grouped.poses == ()


def test_a_duplicate_of_a_whole_group_is_a_group_of_its_own(grouped: Document) -> None:
    found = edited(grouped, DuplicateObjects(("lamp", "floor", "pot")))
    assert found.groups == {"Tea": ("pot", "lamp"), "Tea 2": ("pot 2", "lamp 2")}
    assert found.object("floor 2").in_group == ""
    assert edited(grouped, DuplicateObjects(("lamp", "floor"))).groups == {"Tea": ("pot", "lamp", "lamp 2")}


def test_groups_are_those_of_all_looks(grouped: Document, tmp_path: Path) -> None:
    found = edited(grouped, AddLook("Day"), AddLook("Night"), SetTransform("pot", (0.0, 1.0, 0.0)))
    found = edited(found, SetGroup(("floor",), "Tea"), DuplicateObjects(("pot", "floor", "lamp")))
    groups = {"Tea": ("pot", "floor", "lamp"), "Tea 2": ("pot 2", "floor 2", "lamp 2")}
    assert found.groups == in_look(found, "Day").groups == groups
    assert edited(found, RenameGroup("Tea", ""), SetLook("Day")).groups == {"Tea 2": groups["Tea 2"]}
    path = save_session(tmp_path / "a.insitu", found, ViewState())
    assert load_session(path).document == found


def test_what_is_refused(grouped: Document) -> None:
    for command, says in (
        (SetGroup(("cup",), "Set"), "no object 'cup'"), (SetGroup((), "Set"), "at least one object"),
        (SetGroup(("pot",), "a.b"), "expected a name"), (RenameGroup("Set", "a"), "no group 'Set'"),
        (RenameGroup("Tea", "a=b"), "expected a name"),
    ):  # fmt: skip
        with pytest.raises(InsituError, match=says):
            command.apply(grouped)
    two = edited(grouped, SetGroup(("floor",), "Ground"))
    with pytest.raises(InsituError, match="no other group"):
        RenameGroup("Ground", "Tea").apply(two)
    with pytest.raises(InsituError, match="in a group"):
        ungrouping(grouped, ("floor",))
    assert free_group_name(grouped) == "Group"
    assert free_group_name(edited(grouped, SetGroup(("floor",), "Group"))) == "Group 2"


def test_paths_set_and_read_what_groups_have(document: Document) -> None:
    for path, value in (("pot.in_group", "Tea"), ("lamp.in_group", "Tea"), ("groups.Tea.visible", False),
                        ("groups.Tea.frozen", True), ("groups.Tea.name", "Set")):  # fmt: skip
        document = set_path(document, path, value).apply(document)
    assert document.groups == {"Set": ("pot", "lamp")} and value_at(document, "pot.in_group") == "Set"
    assert [(state.visible, state.frozen) for state in document.objects] == [
        (False, True),
        (True, False),
        (False, True),
    ]
    assert value_at(document, "groups.Set.visible") is False and value_at(document, "groups.Set.frozen") is True
    for path, value, says in (
        ("groups.Tea.visible", True, "no group 'Tea'"), ("groups.Set.colour", 1, "property of the group"),
        ("groups.Set.visible", 1, "true or false"), ("groups.Set", 1, "has no value"), ("pot.in_group", 3, "a group"),
    ):  # fmt: skip
        with pytest.raises(InsituError, match=says):
            set_path(document, path, value).apply(document)


def test_sessions_and_reloads_keep_groups(document: Document, grouped: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "a.insitu", grouped, ViewState())
    assert fit_session(load_session(path), document, "a.insitu") == grouped
    assert SceneChange(document, document)(grouped) == grouped


def test_a_click_is_about_the_group_and_after_a_double_click_about_one(grouped: Document) -> None:
    view = ViewState()
    assert group_around(grouped, "pot") == ("lamp", "pot") and group_around(grouped, "floor") == ("floor",)
    assert clicked(grouped, view, "pot") == ("lamp", "pot") and clicked(grouped, view, "floor") == ("floor",)
    whole = select_in_view(grouped, view, ("lamp", "pot"))
    assert clicked(grouped, whole, "lamp") == ("pot", "lamp")
    one = select_in_view(grouped, view, "pot")
    assert clicked(grouped, one, "lamp") == ("lamp",)
    assert toggled(select_in_view(grouped, view, "floor"), "lamp", "pot") == ("floor", "lamp", "pot")
    assert toggled(whole, "pot", "lamp") == () and toggled(one, "lamp", "pot") == ("lamp", "pot")


@pytest.mark.parametrize("seed", range(3))
def test_any_sequence_gives_each_object_one_group_that_sessions_keep(
    document: Document, seed: int, tmp_path: Path
) -> None:
    rng, scene = random.Random(seed), document
    for _ in range(60):
        names = [state.name for state in document.objects]
        if not names:
            document = scene
            continue
        some = tuple(rng.sample(names, rng.randint(1, len(names))))
        group = rng.choice([*document.groups, "A", "B"])
        command: EditCommand = rng.choice((
            SetGroup(some, group), SetGroup(some), RenameGroup(group, rng.choice(("C", "D", ""))),
            DuplicateObjects(some), DeleteObject(some[0]), DeleteObject(some[0]),
            RenameObject(some[0], f"thing {rng.randrange(50)}"),
        ))  # fmt: skip
        before = document
        try:
            document = command.apply(document)
        except InsituError:
            assert document is before
        members = [name for group in document.groups.values() for name in group]
        assert len(members) == len(set(members)) and all(document.groups.values())
        if len(document.objects) > 12:
            document = scene
    path = save_session(tmp_path / "a.insitu", document, ViewState())
    assert fit_session(load_session(path), scene, "a.insitu") == document
