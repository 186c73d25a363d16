"""Linked duplicates: objects of one source whose material is one, in sessions, looks and reloads, and in any order of
edits."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands import (
    AddLook,
    AddObject,
    DeleteObject,
    DuplicateObject,
    DuplicateObjects,
    EditCommand,
    LinkCurves,
    LinkObjects,
    RenameObject,
    SetBumps,
    SetEmission,
    SetFrozen,
    SetGroup,
    SetLook,
    SetMaterial,
    SetMix,
    SetModel,
    SetOpacity,
    SetOperators,
    SetParameter,
    SetPose,
    SetSurface,
    SetTransform,
    SetVisible,
    ShowObjects,
)
from app.document.commands.linked_objects import single_users
from app.document.commands.several import Several
from app.document.described import added_state
from app.document.document import Document, Selection
from app.document.history import History
from app.document.linked_objects import SHARED_FIELDS, linked_objects
from app.document.looks import in_look
from app.document.scene_change import SceneChange
from app.document.view_state import ViewState
from app.files.session import dump_session, load_session, save_session
from app.files.session_fitting import fit_session
from app.interface.values import value_at
from app.modes.placement.edited_curves import edited_layers
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.description import ObjectDescription
from engine.scene.object_meshes import GREY

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)


def edited(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


@pytest.fixture
def two(document: Document) -> Document:
    """The pot, a linked duplicate of it, the mug, and the rest."""
    return DuplicateObject("pot", "mug", linked=True).apply(document)


def material(document: Document, name: str) -> tuple[object, ...]:
    return tuple(getattr(document.object(name), field) for field in SHARED_FIELDS)


def test_a_material_is_edited_once(two: Document) -> None:
    assert linked_objects(two, "pot") == ("mug",) and linked_objects(two, "mug") == ("pot",)
    for name in ("pot", "mug"):
        for command in (
            SetParameter(f"{name}.0", "albedo", 0.3), SetOperators(f"{name}.1", "theta_h", (LIFT,)),
            SetModel(f"{name}.1", "phong"), SetOpacity(name, "opacity_factor", 0.5), SetBumps(name, "flip_green", True),
            SetSurface(name, "membrane"), SetVisible(f"{name}.0", False),
            SetMaterial(name, two.object("floor").layers),
        ):  # fmt: skip
            found = command.apply(two)
            assert material(found, "pot") == material(found, "mug") != material(two, "pot"), command
            # Nothing is copied: both have the very same layers.
            assert found.object("pot").layers is found.object("mug").layers
            assert found.object("floor") is two.object("floor")


def test_poses_visibility_and_the_mix_are_each_one_s_own(two: Document, document: Document) -> None:
    pose = (Deformation("bend", 20.0),)
    for command in (
        SetTransform("mug", (1.0, 0.0, 0.0)), SetPose("mug", pose), SetVisible("mug", False), SetFrozen("mug", True),
        SetGroup(("mug",), "Tea"),
    ):  # fmt: skip
        found = command.apply(two)
        assert found.object("pot") is two.object("pot") and found.object("mug") != two.object("mug")
    lamps = edited(document, DuplicateObject("lamp", "key", linked=True), SetEmission("key", 3.0))
    assert lamps.object("lamp").emission == lamps.object("key").emission == (3.0, 3.0, 3.0)
    assert edited(lamps, SetMix("key", "strength", 1.0)).light.row("lamp").strength == 0.0


def test_a_full_duplicate_and_a_single_user_are_edited_alone(two: Document, document: Document) -> None:
    three = edited(two, DuplicateObject("mug"), SetParameter("mug.0", "albedo", 0.3))
    assert three.object("mug 2").layers == document.object("pot").layers and three.object("mug 2").linked == ""
    alone = edited(two, single_users(two, ("mug", "floor")), SetParameter("mug.0", "albedo", 0.3))
    assert alone.object("pot").layers is two.object("pot").layers and linked_objects(alone, "pot") == ()
    with pytest.raises(InsituError, match="none of these objects shares its material"):
        single_users(alone, ("pot", "floor"))
    again = edited(alone, LinkObjects(("mug",), "pot"))
    assert again.object_links == {"pot": ("pot", "mug")} and material(again, "mug") == material(two, "pot")
    # A further one joins them, and one of what is left alone is linked anew.
    assert edited(two, DuplicateObject("mug", "jug", linked=True)).object_links == {"pot": ("pot", "mug", "jug")}
    assert edited(two, DeleteObject("pot"), RenameObject("mug", "pot")).object_links == {}


def test_what_is_refused(two: Document) -> None:
    frozen = SetFrozen("mug", True).apply(two)
    for command in (
        SetParameter("pot.0", "albedo", 0.3), SetMaterial("pot", two.object("floor").layers),
        SetOpacity("pot", "opacity_factor", 0.5), SetSurface("pot", "membrane"),
    ):  # fmt: skip
        with pytest.raises(InsituError, match="frozen"):
            command.apply(frozen)
    with pytest.raises(InsituError, match="floor is not linked to pot: only duplicates of one object"):
        LinkObjects(("floor",), "pot").apply(two)
    with pytest.raises(InsituError, match="expected a name of"):
        LinkObjects(("pot",), "a.b").apply(two)
    lamps = edited(two, DuplicateObject("lamp", "key", linked=True), SetFrozen("key", True))
    with pytest.raises(InsituError, match="key is frozen"):
        SetEmission("lamp", 3.0).apply(lamps)


def test_an_edited_curve_is_that_of_all_and_follows_its_links(two: Document) -> None:
    assert edited_layers(two, Selection("mug", 1, "theta_h")) == ("mug.1", "pot.1")
    assert edited_layers(SetVisible("pot", False).apply(two), Selection("mug", 1, "theta_h")) == ("mug.1",)
    jug = edited(two, DuplicateObject("pot", "jug"), LinkCurves("jug.1.theta_h", ("mug.1.theta_h",)))
    assert set(edited_layers(jug, Selection("jug", 1, "theta_h"))) == {"jug.1", "pot.1", "mug.1"}
    for name in ("jug", "mug", "pot"):
        found = SetOperators(f"{name}.1", "theta_h", (LIFT,)).apply(jug)
        assert [found.layer(f"{each}.1").operators("theta_h") for each in ("jug", "mug", "pot")] == [(LIFT,)] * 3


def test_duplicates_of_a_group_are_linked_one_by_one(document: Document) -> None:
    found = edited(document, SetGroup(("pot", "lamp"), "Tea"), DuplicateObjects(("pot", "lamp"), linked=True))
    assert found.groups == {"Tea": ("pot", "lamp"), "Tea 2": ("pot 2", "lamp 2")}
    assert found.object_links == {"pot": ("pot", "pot 2"), "lamp": ("lamp", "lamp 2")}


def test_links_are_those_of_all_looks_and_materials_each_look_s_own(two: Document, tmp_path: Path) -> None:
    found = edited(
        two, AddLook("Day"), AddLook("Night"), SetParameter("mug.0", "albedo", 0.3),
        SetTransform("mug", (1.0, 0.0, 0.0)), DuplicateObject("mug", "jug", linked=True),
    )  # fmt: skip
    day = in_look(found, "Day")
    assert day.object_links == found.object_links == {"pot": ("pot", "mug", "jug")}
    assert material(day, "jug") == material(two, "pot") != material(found, "pot")
    path = save_session(tmp_path / "a.insitu", found, ViewState())
    assert load_session(path).document == found
    assert edited(found, LinkObjects(("jug",)), SetLook("Day")).object_links == {"pot": ("pot", "mug")}


def test_a_session_has_the_material_once(two: Document, document: Document, tmp_path: Path) -> None:
    found = edited(two, SetParameter("mug.0", "albedo", 0.3), SetTransform("mug", (1.0, 0.0, 0.0)))
    path = save_session(tmp_path / "a.insitu", found, ViewState())
    assert fit_session(load_session(path), document, "a.insitu") == found
    text = path.read_text()
    assert text.count("[[object.layer]]") == sum(len(state.layers) for state in document.objects)
    for was, now, says in (
        (
            'name = "mug"\noriginal = "pot"',
            'name = "mug"\noriginal = "floor"',
            "'mug': linked = .*, expected a duplicate of what 'pot' is",
        ),
        (
            'name = "mug"\n',
            'name = "mug"\nemission = [1.0, 1.0, 1.0]\n',
            "'mug': linked = .*, expected without a material, which is",
        ),
    ):
        assert was in text
        path.write_text(text.replace(was, now))
        with pytest.raises(LoadError, match=says):
            load_session(path)


def test_files_saved_again_keep_links(two: Document, document: Document) -> None:
    mine = SetParameter("mug.0", "albedo", 0.3).apply(two)
    theirs = SetParameter("pot.1", "alpha", 0.07).apply(document)
    found = SceneChange(document, theirs)(mine)
    assert found.object_links == mine.object_links and material(found, "pot") == material(found, "mug")
    assert dict(found.layer("pot.0").parameters)["albedo"] == dict(mine.layer("pot.0").parameters)["albedo"]
    assert dict(found.layer("mug.1").parameters)["alpha"] == 0.07
    # Objects that the file has no longer wait together, and come back linked.
    gone = SceneChange(document, replace(document, objects=document.objects[1:]))(mine)
    assert [each.linked for each in gone.absent] == ["pot", "pot"]
    back = SceneChange(replace(document, objects=document.objects[1:]), document)(gone)
    assert back.object_links == mine.object_links


def test_paths_make_read_and_leave_links(document: Document) -> None:
    found = set_path(document, "pot.linked_duplicate", "mug").apply(document)
    assert value_at(found, "mug.linked") == value_at(found, "pot.linked") == "pot"
    assert value_at(found, "pot.linked_duplicate") == ""
    assert set_path(found, "mug.linked", "").apply(found).object_links == {}
    for path, value, says in (
        ("pot.linked_duplicate", True, "a name"), ("pot.linked", True, "the name of a link"),
        ("floor.linked", "pot", "only duplicates"),
    ):  # fmt: skip
        with pytest.raises(InsituError, match=says):
            set_path(found, path, value).apply(found)


def test_added_objects_are_linked_in_sessions(document: Document, tmp_path: Path) -> None:
    source = ObjectDescription(name="ball", primitive="sphere")
    ball = added_state(source, source.model_copy(update={"layers": GREY}))
    found = edited(document, AddObject("sphere", objects=(ball,)), DuplicateObject("ball", "globe", linked=True))
    found = edited(found, SetParameter("globe.0", "albedo", 0.3), RenameObject("ball", "bowl"))
    path = save_session(tmp_path / "a.insitu", found, ViewState())
    assert fit_session(load_session(path), document, "a.insitu", {source: ball}) == found
    assert found.object_links == {"ball": ("bowl", "globe")}


def any_command(rng: random.Random, document: Document) -> EditCommand:
    """Any edit of which objects there are, and of what they share and do not share."""
    names = [state.name for state in document.objects]
    some = tuple(rng.sample(names, rng.randint(1, len(names))))
    one, group = some[0], rng.choice([*document.groups, "A", "B"])
    deleted = Several(tuple(map(DeleteObject, some)), "delete")
    commands: list[EditCommand] = [
        DuplicateObject(one, linked=True), DuplicateObjects(some, linked=True), DuplicateObjects(some), deleted,
        RenameObject(one, rng.choice(("pot", "floor", "lamp", f"thing {rng.randrange(9)}"))),
        SetGroup(some, group), SetGroup(some), SetVisible(one, rng.random() < 0.5), ShowObjects(),
        SetFrozen(one, rng.random() < 0.3), LinkObjects(some), LinkObjects((one,), rng.choice(names)),
        SetTransform(one, (rng.random(), 0.0, 0.0)), AddLook(f"look {rng.randrange(9)}"),
        Several(tuple(SetVisible(name, False) for name in some), "hide"),
    ]  # fmt: skip
    if document.looks:
        commands.append(SetLook(rng.choice(document.looks).name))
    if document.object(one).layers:
        key = f"{one}.{rng.randrange(len(document.object(one).layers))}"
        commands += [SetParameter(key, "albedo", rng.random())] * 2 + [SetVisible(key, rng.random() < 0.5)]
    else:
        commands.append(SetEmission(one, rng.random()))
    return rng.choice(commands)


@pytest.mark.parametrize("seed", range(6))
def test_any_sequence_keeps_materials_together_and_is_undone_to_the_bit(
    document: Document, seed: int, tmp_path: Path
) -> None:
    rng, history = random.Random(seed), History(document)
    texts, view = [dump_session(document, ViewState())], ViewState()
    for _ in range(40):
        before = history.document
        if len(before.objects) > 14:
            continue
        if not before.objects:
            history.undo()
            texts.pop()
            continue
        try:
            history.do(any_command(rng, before))
        except InsituError:
            assert history.document is before
            continue
        now = history.document
        if now is not before:
            texts.append(dump_session(now, view))
        for look in (now, *(in_look(now, each.name) for each in now.looks)):
            # Each link is of one source, in all looks alike, and of one material.
            assert look.object_links == now.object_links
            for linked in look.object_links.values():
                assert len({look.object(name).source for name in linked}) == 1
                assert all(material(look, name) == material(look, linked[0]) for name in linked)
        members = [name for group in now.groups.values() for name in group]
        assert len(members) == len(set(members)) and len({each.name for each in now.objects}) == len(now.objects)
    # A session of it is the same document, and starting from it is starting afresh.
    path = save_session(tmp_path / "a.insitu", history.document, view)
    assert fit_session(load_session(path), document, "a.insitu") == history.document
    for text in reversed(texts):
        assert dump_session(history.document, view) == text
        history.undo()
    assert history.document == document
