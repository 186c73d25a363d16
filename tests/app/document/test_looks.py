"""Looks: commands, what they share, sessions, reloads, and random sequences held against one document for each look."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.background import Background
from app.document.commands import (
    AddDeformer,
    AddLook,
    AddObject,
    DeleteLook,
    DeleteObject,
    DuplicateObject,
    EditCommand,
    MoveLook,
    RenameLook,
    RenameObject,
    SetBackground,
    SetEditable,
    SetFirstBands,
    SetLook,
    SetMix,
    SetOperators,
    SetParameter,
    SetRotation,
    SetTransform,
    SetVisible,
)
from app.document.described import added_state
from app.document.document import Document
from app.document.history import History
from app.document.looks import Look, in_look, look_names, state_of
from app.document.named_files import files_of_document
from app.document.scene_change import SceneChange
from app.document.view_state import ViewState
from app.files.session import dump_session, load_session, save_session
from app.files.session_fitting import fit_session
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.scene.description import ObjectDescription
from engine.scene.object_meshes import GREY

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)


def edited(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


def alone(document: Document) -> Document:
    """The document of its current look, without any."""
    return replace(document, looks=())


def test_edits_go_to_the_current_look_and_to_no_other(document: Document) -> None:
    brass = edited(
        document, AddLook("Brass"), SetParameter("pot.1", "eta", 1.5), SetOperators("pot.1", "theta_h", (LIFT,)),
        SetTransform("pot", (1.0, 0.0, 0.0)), SetRotation(40.0), SetBackground("colour"), SetVisible("lamp", False),
        AddDeformer("pot", "bend", 20.0), SetMix("lamp", "strength", 1.0),
    )  # fmt: skip
    assert look_names(brass) == ("Look 1", "Brass") and brass.look == "Brass"
    before = SetLook("Look 1").apply(brass)
    assert alone(before) == document and before.look == "Look 1"
    # There and back is the same document, to the bit: a look is a value.
    assert SetLook("Brass").apply(before) == brass
    assert in_look(brass, "Brass") is brass


def test_looks_share_which_objects_there_are(document: Document) -> None:
    two = edited(document, AddLook(), SetParameter("pot.0", "albedo", 0.3))
    assert look_names(two) == ("Look 1", "Look 2")
    shared = edited(
        two, DuplicateObject("pot", "mug"), RenameObject("floor", "table"), SetEditable("mug", False), SetFirstBands(8)
    )
    for name in ("Look 1", "Look 2"):
        found = in_look(shared, name)
        assert [each.name for each in found.objects] == ["pot", "mug", "table", "lamp"]
        assert found.deleted == ("floor",) and found.first_bands == 8 and not found.object("mug").editable
    # The duplicate is like its original in each look.
    assert in_look(shared, "Look 1").layer("mug.0") == document.layer("pot.0") != shared.layer("mug.0")
    assert [each.name for each in in_look(DeleteObject("pot").apply(shared), "Look 1").objects] == [
        "mug", "table", "lamp"
    ]  # fmt: skip


def test_looks_are_renamed_moved_and_deleted(document: Document) -> None:
    three = edited(
        document, AddLook("B"), SetRotation(10.0), AddLook("C"), SetRotation(20.0), RenameLook("Look 1", "A")
    )
    assert look_names(three) == ("A", "B", "C")
    assert look_names(MoveLook("C", 0).apply(three)) == ("C", "A", "B")
    assert look_names(MoveLook("A", 99).apply(three)) == ("B", "C", "A")
    assert edited(three, DeleteLook("A")).light.rotation == 20.0
    current = DeleteLook("C").apply(three)  # the last one: the one before it is shown
    assert current.look == "B" and current.light.rotation == 10.0
    last = edited(current, DeleteLook("A"), DeleteLook("B"))
    assert last.looks == () and last.look == "" and last.light.rotation == 10.0
    # A new look stands behind the one that it is like.
    assert look_names(edited(three, SetLook("A"), AddLook())) == ("A", "Look 2", "B", "C")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (SetLook("Bras"), "there is no look 'Bras'; did you mean 'Brass'"),
        (AddLook("Brass"), "look = 'Brass', expected a name that no other look has"),
        (AddLook(" "), "look = ' ', expected a name of 1 to 64 characters"),
        (RenameLook("Brass", "Look 1"), "look = 'Look 1', expected a name that no other"),
        (RenameLook("Tin", "Brass"), "there is no look 'Tin'"),
        (DeleteLook("Tin"), "available: Look 1, Brass"),
        (MoveLook("Tin", 0), "there is no look 'Tin'"),
    ],
)
def test_what_makes_no_sense_is_refused(document: Document, command: EditCommand, said: str) -> None:
    with pytest.raises(InsituError, match=said):
        command.apply(AddLook("Brass").apply(document))


def test_a_path_chooses_a_look(document: Document) -> None:
    two = AddLook("Brass").apply(document)
    assert set_path(two, "look", "Look 1") == SetLook("Look 1")
    with pytest.raises(LoadError, match="the name of a look"):
        set_path(two, "look", 3)


def test_files_of_all_looks_are_known(document: Document) -> None:
    from app.document.commands import SetEnvironment

    two = edited(document, AddLook("Night"), SetEnvironment("/skies/night.exr"), SetLook("Look 1"))
    assert Path("/skies/night.exr") in files_of_document(two)
    assert files_of_document(two, document) == {Path("/skies/night.exr")}


def test_a_session_has_looks_as_differences(document: Document, tmp_path: Path) -> None:
    three = edited(
        document, AddLook("Brass"), SetParameter("pot.1", "eta", 1.5), SetTransform("floor", (0.0, 1.0, 0.0)),
        AddLook("Night"), SetBackground("colour"), SetMix("lamp", "on", False), SetLook("Brass"),
    )  # fmt: skip
    path = save_session(tmp_path / "looks.insitu", three, ViewState(looks_shown=4))
    session = load_session(path)
    assert session.view.looks_shown == 4 and fit_session(session, document, str(path)) == three
    text = path.read_text()
    # Night is Brass in another light: no object of it is written.
    night = text[text.index('name = "Night"') :]
    assert "[look.light]" in night and "[look.background]" in night and "look.object" not in night
    first = text[text.index('name = "Look 1"') : text.index('name = "Brass"\ncurrent')]
    # Only the pot has another material; the floor is written without its layers.
    assert first.count("[[look.object]]") == 2 and first.count("[[look.object.layer]]") == 2
    assert "[look.light]" not in first


def test_a_session_without_looks_is_written_as_before(document: Document) -> None:
    assert "look]]" not in dump_session(document, ViewState())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("current = true\n", ""), "exactly one that is current"),
        (lambda text: text.replace('[[look]]\nname = "Brass"', '[[look]]\nname = "Look 1"'), "names that differ"),
        (lambda text: text.replace('[[look.object]]\nname = "pot"', '[[look.object]]\nname = "pan"'), "pan"),
    ],
)
def test_a_wrong_look_is_refused_in_a_line(
    document: Document, tmp_path: Path, change: Callable[[str], str], said: str
) -> None:
    two = edited(document, AddLook("Brass"), SetParameter("pot.1", "eta", 1.5))
    path = save_session(tmp_path / "looks.insitu", two, ViewState())
    path.write_text(change(path.read_text()))
    with pytest.raises(LoadError, match=said) as refusal:
        load_session(path)
    assert "\n" not in str(refusal.value)


def test_files_saved_again_change_all_looks(document: Document) -> None:
    mine = edited(document, AddLook("Brass"), SetParameter("pot.1", "eta", 1.5), SetLook("Look 1"))
    theirs = edited(document, SetParameter("pot.0", "albedo", 0.7), SetParameter("pot.1", "alpha", 0.4))
    found = SceneChange(document, theirs)(mine)
    assert alone(found) == theirs
    brass = in_look(found, "Brass")
    assert brass.layer("pot.0") == theirs.layer("pot.0")
    values = brass.layer("pot.1").values
    assert (values["eta"], values["alpha"]) == ((1.5, 1.5, 1.5), 0.4)
    # An object that is gone waits in all looks where it was edited in one.
    gone = SceneChange(document, replace(document, objects=document.objects[1:]))(mine)
    for name in ("Look 1", "Brass"):
        assert [each.name for each in in_look(gone, name).absent] == ["pot"]
    assert SceneChange(replace(document, objects=document.objects[1:]), document)(gone) == mine


def ball() -> ObjectDescription:
    return ObjectDescription(name="ball", primitive="sphere")


def test_any_sequence_is_that_of_one_document_for_each_look(document: Document, tmp_path: Path) -> None:
    """A document for each look, which knows of no other, gets the edits of that look and those of all."""
    state = added_state(ball(), ball().model_copy(update={"layers": GREY}))
    for seed in range(12):
        rng = random.Random(seed)
        history = History(document)
        looks: list[tuple[str, Document]] = []
        past: list[tuple[list[tuple[str, Document]], str]] = []
        current = ""
        for _ in range(30):
            here = history.document
            name = rng.choice([each.name for each in here.objects])
            what = rng.choice(("new", "look", "edit", "edit", "light", "object", "object", "rename", "move", "delete",
                               "undo", "session"))  # fmt: skip
            command: EditCommand | None = None
            mirrored, now = [*looks], current
            if what == "undo" and past:
                history.undo()
                looks, current = past.pop()
            elif what == "session":
                path = save_session(tmp_path / "any.insitu", here, ViewState())
                assert fit_session(load_session(path), document, str(path), {ball(): state}) == here
            elif what == "new" and len(looks) < 5:
                command = AddLook()
                first = "Look 1"
                before = looks or [(first, here)]
                at = next((k for k, (own, _) in enumerate(before) if own == current), 0)
                now = command.apply(here).look
                mirrored = [*before[: at + 1], (now, alone(here)), *before[at + 1 :]]
            elif what == "look" and looks:
                now = rng.choice(looks)[0]
                command = SetLook(now)
            elif what == "move" and looks:
                own, at = rng.choice(looks)[0], rng.randrange(len(looks))
                command = MoveLook(own, at)
                pair = next(each for each in looks if each[0] == own)
                mirrored = [each for each in looks if each[0] != own]
                mirrored.insert(at, pair)
            elif what == "delete" and looks:
                own = rng.choice(looks)[0]
                command = DeleteLook(own)
                mirrored = [each for each in looks if each[0] != own]
                at = next(k for k, each in enumerate(looks) if each[0] == own)
                if own == current:
                    now = mirrored[min(at, len(mirrored) - 1)][0] if mirrored else ""
            elif what in ("edit", "light"):
                command = (
                    SetRotation(float(rng.randrange(360))) if what == "light"
                    else SetTransform(name, (rng.random(), 0.0, 0.0))
                )  # fmt: skip
                mirrored = [(own, command.apply(each) if own == current else each) for own, each in looks]
            elif what in ("object", "rename"):
                choices: list[EditCommand] = [DuplicateObject(name), AddObject("sphere", objects=(state,))]
                choices += [DeleteObject(name)] if len(here.objects) > 1 else []
                command = (
                    rng.choice(choices) if what == "object" else RenameObject(name, f"thing {rng.randrange(10**6)}")
                )
                mirrored = [(own, command.apply(each)) for own, each in looks]
            if command is not None and history.do(command):
                past.append((looks, current))
                looks, current = mirrored, now
            here = history.document
            assert here.look == current and look_names(here) == tuple(own for own, _ in looks)
            for own, each in looks:
                assert alone(in_look(here, own)) == alone(each)
        while history.undo() is not None:
            pass
        assert history.document == document


def test_the_current_look_has_no_state_of_its_own(document: Document) -> None:
    two = edited(document, AddLook("Brass"), SetRotation(5.0))
    assert two.looks == (Look("Look 1", state_of(document)), Look("Brass"))
    assert replace(two.looks[0].state, background=Background("transparent")) != two.looks[0].state  # type: ignore[type-var]
