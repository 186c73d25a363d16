"""Duplicated, deleted and renamed objects: commands, sessions, reloads, and random sequences of all of them."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands import (
    AddObject,
    DeleteObject,
    DuplicateObject,
    EditCommand,
    RenameObject,
    SetMix,
    SetTransform,
)
from app.document.commands.layers import SetParameter
from app.document.commands.plan import OverrideLine
from app.document.described import added_state
from app.document.document import Document, ObjectState
from app.document.scene_change import SceneChange
from app.document.scene_objects import with_objects_of, without_sources
from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session, session_notes
from app.interface.values import value_at
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.scene.composition import SceneObject
from engine.scene.description import ObjectDescription
from engine.scene.object_meshes import GREY

LAST = (0.0, 0.0, 0.0, 1.0)


def edited(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


def names(document: Document) -> list[str]:
    return [state.name for state in document.objects]


def test_a_duplicate_stands_behind_its_original_and_is_edited_alone(document: Document) -> None:
    found = edited(document, DuplicateObject("pot"), SetParameter("pot 2.0", "albedo", 0.3))
    assert names(found) == ["pot", "pot 2", "floor", "lamp"] and document.composition is None
    assert found.composition[:2] == (SceneObject("pot", "pot"), SceneObject("pot 2", "pot"))
    assert found.object("pot") == document.object("pot") and found.object("pot 2") != found.object("pot")
    assert names(edited(found, DuplicateObject("pot 2"), DuplicateObject("pot", "mug"))) == [
        "pot", "mug", "pot 2", "pot 3", "floor", "lamp"
    ]  # fmt: skip
    assert edited(found, DeleteObject("pot 2")) == document


def test_what_was_deleted_is_gone_with_its_row_in_the_mix(document: Document) -> None:
    found = edited(document, SetMix("lamp", "strength", 1.0), DeleteObject("lamp"))
    assert found.deleted == ("lamp",) and found.light.mix == () and names(found) == ["pot", "floor"]
    assert found.composition == (SceneObject("pot", "pot"), SceneObject("floor", "floor"))


def names_absent(document: Document) -> list[str]:
    return [state.name for state in document.absent]


def ball(name: str = "ball", **more: object) -> ObjectState:
    """An object that was added."""
    source = ObjectDescription(name=name, primitive="sphere", **more)
    return added_state(source, source.model_copy(update={"layers": GREY}))


def test_what_is_added_stands_behind_all_others_under_free_names(document: Document) -> None:
    two = AddObject("/models/toy.glb", objects=(ball(), ball("pot")))
    found = edited(document, two, two, DeleteObject("ball"))
    assert names(found) == ["pot", "floor", "lamp", "pot 2", "ball 2", "pot 3"] and found.deleted == ()
    assert found.composition[-1] == SceneObject("pot 3", ball("pot").added)
    renamed = edited(found, RenameObject("pot 2", "mug"), DuplicateObject("mug"))
    assert renamed.object("mug 2").source == ball("pot").added and renamed.deleted == ()
    assert renamed.added_sources == (ball("pot").added, ball().added)
    gone = without_sources(renamed, {ball("pot").added}, document)
    assert names(gone) == ["pot", "floor", "lamp", "ball 2"]
    assert names_absent(gone) == ["mug", "mug 2", "pot 3"]
    # Where none are left it has those of the file.
    alone = edited(found, *(DeleteObject(name) for name in ("floor", "lamp", "pot", "ball 2", "pot 3")))
    left = without_sources(alone, {ball("pot").added}, document)
    assert names(left) == names(document) and left.composition is None and names_absent(left) == ["pot 2"]
    with pytest.raises(InsituError, match="size = -1.0, expected metres"):
        edited(document, AddObject("box", size=-1.0, objects=(ball(),)))
    with pytest.raises(InsituError, match="name = 'pot', expected one that no other object has"):
        edited(document, AddObject("box", "pot", objects=(ball(),)))


def test_added_objects_survive_sessions_beside_their_file(document: Document, tmp_path: Path) -> None:
    file = tmp_path / "toy.ply"
    toy = ObjectDescription(
        name="toy", mesh=str(file), part=0, transform=(*range(1, 5), 0, 1, 0, 9, 0, 0, 1, 0.1, *LAST)
    )
    spot = ObjectDescription(name="spot", primitive="disc", emission=(1.0, 2.0, 3.0), cone={"outer": 30.0})
    states = (added_state(toy, toy.model_copy(update={"layers": GREY})), added_state(spot, spot))
    here = edited(document, AddObject(str(file), objects=states), RenameObject("toy", "cup"), DuplicateObject("cup"))
    path = save_session(tmp_path / "objects.insitu", here, ViewState())
    assert 'mesh = "toy.ply"' in path.read_text()
    session, added = load_session(path), {toy: states[0], spot: states[1]}
    assert fit_session(session, document, str(path), added) == here
    assert session_notes(session, document, added) == ()
    # What cannot be read waits for its file.
    found = fit_session(session, document, str(path), {spot: states[1]})
    assert names(found) == ["pot", "floor", "lamp", "spot"]
    assert [each.name for each in found.absent] == ["cup", "cup 2"]
    assert "cup, cup 2: no longer in the scene" in session_notes(session, document, {spot: states[1]})[0]
    for wrong, said in (("part = 0", "part = -1"), ('mesh = "toy.ply"', 'mesh = "toy.ply", primitive = "cube"')):
        path.write_text(save_session(path, here, ViewState()).read_text().replace(wrong, said))
        with pytest.raises(LoadError, match="added"):
            load_session(path)


def test_files_saved_again_leave_added_objects_and_take_other_names(document: Document) -> None:
    box, own = ball("box"), ball()
    mine = edited(document, AddObject("box", objects=(box, own)), DeleteObject("floor"))
    more = replace(document, objects=(*document.objects, replace(document.objects[0], name="box")))
    states = {box.added: box, own.added: own}
    found = SceneChange(document, more, None, states, {box.added: box})(mine)
    # The file has a box of its own now, which is called "box 2" here; the ball's file has gone.
    assert names(found) == ["pot", "lamp", "box 2", "box"] and found.object("box 2").original == "box"
    assert names_absent(found) == ["ball"] and set(found.deleted) == {"floor", "box"}
    again = SceneChange(more, more, None, states, states)(found)
    assert names(again) == ["pot", "lamp", "box 2", "ball", "box"]


def test_materials_of_added_objects_follow_their_file_where_they_are_not_edited(document: Document) -> None:
    toy = ball("toy")
    mine = edited(
        document, AddObject("toy.glb", objects=(toy,)), RenameObject("toy", "cup"), DuplicateObject("cup"),
        SetParameter("cup 2.0", "albedo", (0.9, 0.1, 0.1)), SetTransform("cup 2", (0.5, 0.0, 0.0)),
    )  # fmt: skip
    now = replace(toy, layers=(toy.layers[0].with_parameter("albedo", (0.0, 0.0, 1.0)),))
    found = SceneChange(document, document, None, {toy.added: toy}, {toy.added: now})(mine)
    assert names(found) == names(mine)
    assert dict(found.layer("cup.0").parameters)["albedo"] == (0.0, 0.0, 1.0)
    assert dict(found.layer("cup 2.0").parameters)["albedo"] == (0.9, 0.1, 0.1)
    assert found.object("cup 2").transform.translation == (0.5, 0.0, 0.0)


def test_a_light_that_excludes_an_object_excludes_its_duplicate(document: Document) -> None:
    found = edited(document, SetMix("lamp", "excludes", ["pot"]), DuplicateObject("pot", "mug"))
    assert found.light.row("lamp").excludes == ("mug", "pot")
    assert edited(found, DeleteObject("pot")).light.row("lamp").excludes == ("mug",)


def test_another_name_takes_the_row_of_the_mix_and_the_plan_along(document: Document) -> None:
    found = edited(
        document, SetMix("lamp", "strength", 1.0), OverrideLine("pot.1.theta_h", 64),
        RenameObject("lamp", "key"), RenameObject("pot", "mug"),
    )  # fmt: skip
    assert found.light.row("key").strength == 1.0 and found.overrides == (("mug.1.theta_h", 64),)
    assert found.composition[0] == SceneObject("mug", "pot") and set(found.deleted) == {"lamp", "pot"}
    back = edited(found, RenameObject("key", "lamp"), RenameObject("mug", "pot"))
    assert back.composition is None and back.deleted == () and back.objects == document.objects


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (DuplicateObject("cup"), "no object 'cup'"),
        (DuplicateObject("pot", "floor"), "name = 'floor', expected one that no other object has"),
        (RenameObject("pot", "a.b"), "name = 'a.b', expected a name of 1 to 64 characters without"),
        (RenameObject("pot", ""), "name = '', expected"),
        (DeleteObject("cup"), "no object 'cup'"),
    ],
)
def test_what_makes_no_sense_is_refused(document: Document, command: EditCommand, said: str) -> None:
    with pytest.raises(InsituError, match=said):
        command.apply(document)


def test_the_last_object_can_be_deleted(document: Document, tmp_path: Path) -> None:
    bare = edited(document, DeleteObject("lamp"), DeleteObject("floor"), DeleteObject("pot"))
    assert bare.objects == () and set(bare.deleted) == {"lamp", "floor", "pot"}
    path = save_session(tmp_path / "bare.insitu", bare, ViewState())
    assert fit_session(load_session(path), document, str(path)) == bare


def test_a_session_keeps_which_objects_there_are(document: Document, tmp_path: Path) -> None:
    here = edited(
        document, DuplicateObject("pot", "mug"), SetTransform("mug", (1.0, 0.0, 0.0)), DeleteObject("floor"),
        RenameObject("lamp", "key"),
    )  # fmt: skip
    path = save_session(tmp_path / "objects.insitu", here, ViewState())
    session = load_session(path)
    assert fit_session(session, document, str(path)) == here and session_notes(session, document) == ()
    # Of a file that has lost the pot both wait; what it has besides is there.
    other = replace(document, objects=(*document.objects[1:], replace(document.objects[1], name="shelf")))
    found = fit_session(session, other, str(path))
    assert names(found) == ["key", "shelf"] and [each.name for each in found.absent] == ["pot", "mug"]
    path.write_text(path.read_text().replace('name = "mug"', 'name = "pot"'))
    with pytest.raises(LoadError, match="pot"):
        load_session(path)


def test_files_saved_again_keep_which_objects_there_are(document: Document) -> None:
    mine = edited(document, DuplicateObject("pot", "mug"), SetParameter("mug.0", "albedo", 0.3), DeleteObject("floor"))
    theirs = SetParameter("pot.0", "albedo", 0.7).apply(document)
    found = SceneChange(document, theirs)(mine)
    assert names(found) == ["pot", "mug", "lamp"] and found.deleted == ("floor",)
    assert found.layer("pot.0") == theirs.layer("pot.0")
    assert found.layer("mug.0") == mine.layer("mug.0")
    gone = SceneChange(document, replace(document, objects=document.objects[1:]))(mine)
    assert names(gone) == ["lamp"] and "mug" in [each.name for each in gone.absent]


def test_the_scene_s_own_document_has_the_same_objects(document: Document) -> None:
    mine = edited(document, DuplicateObject("pot", "mug"), SetParameter("mug.0", "albedo", 0.3), DeleteObject("floor"))
    own = with_objects_of(document, mine)
    assert names(own) == names(mine) and own.layer("mug.0") == document.layer("pot.0")


def test_any_sequence_survives_sessions_and_undo(document: Document, tmp_path: Path) -> None:
    for seed in range(12):
        rng = random.Random(seed)
        states = [document]
        for _ in range(25):
            here = states[-1]
            name = rng.choice(names(here))
            what = rng.choice(("add", "duplicate", "duplicate", "delete", "rename", "edit", "undo", "session"))
            if what == "undo" and len(states) > 1:
                states.pop()
            elif what == "session":
                path = save_session(tmp_path / "any.insitu", here, ViewState())
                assert fit_session(load_session(path), document, str(path), {ball().added: ball()}) == here
            elif what == "add":
                states.append(AddObject("sphere", objects=(ball(),)).apply(here))
            elif what == "delete" and len(here.objects) > 1:
                states.append(DeleteObject(name).apply(here))
            elif what == "rename":
                taken = rng.choice(("pot", "floor", "lamp", f"name {rng.randint(1, 99)}"))
                if taken not in names(here):
                    states.append(RenameObject(name, taken).apply(here))
            elif what == "duplicate":
                states.append(DuplicateObject(name).apply(here))
            elif what == "edit":
                states.append(SetTransform(name, (rng.random(), 0.0, 0.0)).apply(here))
            here = states[-1]
            assert len(set(names(here))) == len(here.objects)
            assert {each.source for each in here.objects} <= {"pot", "floor", "lamp", ball().added}
            # Undone to the file's objects there is nothing to compose.
            own = not here.deleted and all(each.is_of_file for each in here.objects)
            assert (here.composition is None) == own


def test_paths_rename_duplicate_and_delete(document: Document) -> None:
    found = document
    for path, value in (("pot.duplicate", "mug"), ("floor.name", "table"), ("lamp.deleted", True)):
        found = set_path(found, path, value).apply(found)
    assert names(found) == ["pot", "mug", "table"] and value_at(found, "mug.name") == "mug"
    for path, value in (("pot.deleted", False), ("pot.name", 3), ("pot.duplicate", True)):
        with pytest.raises(LoadError, match=path.replace(".", r"\.")):
            set_path(document, path, value)
