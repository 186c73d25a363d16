"""Several selected objects: what is selected after what, edits of all of them as one step, and random sequences."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from app.document.commands import AddLook, DeleteObject, RenameObject, SetGroup, SetLook, SetParameter
from app.document.commands.groups import group_edit
from app.document.selection import toggled
from app.editor.editor import Editor
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.operators.arrange import Move
from app.operators.registry import run_operator
from engine.scene.transform import Transform
from tests.app.fake_worker import FakeClient

BOXES = np.array([[[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]], [[-9.0, -1.0, -9.0], [9.0, 0.0, 9.0]],
                  [[3.0, 4.0, -1.0], [5.0, 4.0, 1.0]]])  # fmt: skip


@pytest.fixture
def several(client: FakeClient) -> Editor:
    """An editor with a pot, a floor and a lamp above."""
    editor = Editor(client, "shelf")
    client.open_scene(boxes=BOXES)
    editor.tick(0.0)
    return editor


def transform(editor: Editor, name: str) -> Transform:
    return editor.document.object(name).transform


def test_the_last_of_several_is_active_and_keeps_its_curve(several: Editor) -> None:
    several.select("pot.1.theta_h")
    assert several.view.selected_objects == ("pot",)
    several.select(("floor", "lamp", "pot"))
    assert several.view.selected_objects == ("floor", "lamp", "pot")
    assert several.view.selected is not None and several.view.selected.path == "pot.1.theta_h"
    assert several.select(("pot", "cup")) is not None and several.view.selected_objects == ("floor", "lamp", "pot")
    several.select("lamp")
    assert several.view.selected_objects == ("lamp",)
    several.select(())
    assert several.view.selected_objects == () and several.view.selected is None


def test_a_click_adds_makes_active_and_removes(several: Editor) -> None:
    several.select("pot")
    found = []
    for name in ("floor", "pot", "pot", "floor"):
        several.select(toggled(several.view, name))
        found.append(several.view.selected_objects)
    assert found == [("pot", "floor"), ("floor", "pot"), ("floor",), ()]


def test_all_none_and_the_others(several: Editor) -> None:
    several.select("floor")
    run_operator(several, "select_all")
    assert several.view.selected_objects == ("pot", "lamp", "floor")
    several.select("floor")
    run_operator(several, "select_others")
    assert several.view.selected_objects == ("pot", "lamp")
    run_operator(several, "set", {"lamp.visible": False})
    run_operator(several, "select_all")
    assert several.view.selected_objects == ("pot", "floor")  # what is hidden is left out
    run_operator(several, "select_none")
    assert several.view.selected_objects == ()


def test_edits_of_several_are_one_step(several: Editor) -> None:
    first = several.document
    several.select(("lamp", "pot"))
    assert run_operator(several, "duplicate") is None
    assert [state.name for state in several.document.objects] == ["pot", "pot 2", "floor", "lamp", "lamp 2"]
    assert several.view.selected_objects == ("lamp 2", "pot 2")
    assert run_operator(several, "delete_object") is None
    assert several.document == first
    labels = [step.label for step in several.history.undo_steps]
    assert labels == ["duplicate 2 objects", "delete 2 objects"]
    run_operator(several, "select_all")
    assert run_operator(several, "delete_object") is None and several.document.objects == ()
    several.undo()
    assert several.document == first


def test_a_move_of_several_goes_about_their_middle(several: Editor) -> None:
    # Centres (0, 1, 0) and (4, 4, 0): the middle (2, 2.5, 0); half a turn about Z exchanges the two.
    run_operator(several, "move", Move(objects=("pot", "lamp"), rotate=(0.0, 0.0, 180.0)))
    assert transform(several, "pot").translation == pytest.approx((4.0, 3.0, 0.0))
    assert transform(several, "lamp").translation == pytest.approx((-4.0, -3.0, 0.0))
    several.undo()
    run_operator(several, "move", Move(objects=("pot", "lamp"), scale=2.0, by=(0.0, 1.0, 0.0)))
    assert transform(several, "pot") == Transform((-2.0, -0.5, 0.0), scale=(2.0, 2.0, 2.0))
    several.undo()
    run_operator(several, "move", Move(objects=("pot", "lamp"), rotate=(0.0, 90.0, 0.0), about="own"))
    assert transform(several, "pot").translation == transform(several, "lamp").translation == (0.0, 0.0, 0.0)
    assert transform(several, "lamp").rotation == pytest.approx((0.0, 90.0, 0.0))
    several.select(("pot", "lamp"))
    run_operator(several, "put_back")
    assert several.document.poses == () and several.history.undo_label == "put back 2 objects"


def test_what_is_dropped_stands_on_the_floor_and_a_group_stays_together(several: Editor) -> None:
    several.select(("pot", "lamp"))
    run_operator(several, "move", Move(objects=("pot", "lamp"), by=(0.0, 3.0, 0.0)))
    assert run_operator(several, "drop_selected") is None
    assert transform(several, "pot").translation == pytest.approx((0.0, 0.0, 0.0))
    assert transform(several, "lamp").translation == pytest.approx((0.0, -4.0, 0.0))
    assert several.history.undo_label == "drop 2 objects"
    several.undo()
    several.do(SetGroup(("pot", "lamp"), "Tea"))
    run_operator(several, "drop", ("pot", "lamp"))
    assert transform(several, "lamp").translation == pytest.approx((0.0, 0.0, 0.0))
    assert "cup" in str(run_operator(several, "drop", "cup"))


def test_what_a_move_names_is_checked(several: Editor) -> None:
    x = (1.0, 0.0, 0.0)
    for wrong in (
        {"by": x}, {"object": "pot", "objects": ("pot",), "by": x}, {"objects": ("pot",)},
        {"object": "pot", "onto": (1, 2), "by": x}, {"object": "pot", "by": x, "align": True},
    ):  # fmt: skip
        with pytest.raises(ValidationError):
            Move(**wrong)
    assert "cup" in str(run_operator(several, "move", Move(objects=("pot", "cup"), by=(1.0, 0.0, 0.0))))
    refusal = run_operator(several, "move", Move(objects=("pot", "lamp"), by=(1e7, 0.0, 0.0)))
    assert refusal is not None and "translation" in refusal and several.document.poses == ()


def test_a_renamed_object_stays_selected_and_a_deleted_one_does_not(several: Editor) -> None:
    several.select(("lamp", "pot.1.theta_h"))
    several.do(RenameObject("pot", "mug"))
    assert several.view.selected is not None and several.view.selected.path == "mug.1.theta_h"
    several.do(RenameObject("lamp", "sun"))
    assert several.view.selected_objects == ("sun", "mug")
    several.undo()
    several.undo()
    assert several.view.selected_objects == ("lamp", "pot")
    several.do(DeleteObject("pot"))
    assert several.view.selected_objects == ("lamp",)


@pytest.mark.parametrize("seed", range(6))
def test_any_sequence_selects_only_what_is_there_and_undoes_to_the_bit(
    several: Editor, seed: int, tmp_path: Path
) -> None:
    """Objects that are linked, in groups and hidden among them; a session of what is left is a fresh start."""
    rng, first = random.Random(seed), several.document
    for _ in range(80):
        names = [state.name for state in several.document.objects]
        if not names:
            several.undo()
            continue
        chosen = rng.choice(names)
        match rng.randrange(16):
            case 0:
                several.select(toggled(several.view, chosen))
            case 1:
                several.select(chosen)
            case 2:
                run_operator(several, rng.choice(("select_all", "select_none", "select_others")))
            case 3 if len(names) < 12:
                run_operator(several, rng.choice(("duplicate", "linked_duplicate")))
            case 10 if len(names) < 12:
                run_operator(several, "linked_duplicate")
            case 11:
                run_operator(several, rng.choice(("group_selected", "group_selected", "ungroup_selected")))
            case 12:
                run_operator(several, rng.choice(("hide", "hide", "show_all", "make_single_user")))
            case 13 if several.document.object(chosen).layers:
                several.do(SetParameter(f"{chosen}.0", "albedo", rng.random()))
            case 14 if several.document.groups:
                group = rng.choice(sorted(several.document.groups))
                several.do(group_edit(several.document, "", group, "visible", rng.random() < 0.5))
            case 15:
                looks = [each.name for each in several.document.looks]
                several.do(
                    SetLook(rng.choice(looks)) if looks and rng.random() < 0.7 else AddLook(f"look {len(looks)}")
                )
            case 4:
                run_operator(several, "delete_object")
            case 5:
                several.do(RenameObject(chosen, f"thing {rng.randrange(100)}"))
            case 6:
                named = tuple(rng.sample(names, rng.randint(1, len(names))))
                run_operator(several, "move", Move(objects=named, rotate=(0.0, rng.uniform(-90, 90), 0.0)))
            case 7 | 8:
                several.undo()
            case 9:
                several.redo()
        there = [state.name for state in several.document.objects]
        selected = several.view.selected_objects
        assert len(set(selected)) == len(selected) and set(selected) <= set(there)
        for first_name, *others in several.document.object_links.values():
            shared = several.document.object(first_name).layers
            assert all(several.document.object(name).layers == shared for name in others)
    path = save_session(tmp_path / "a.insitu", several.document, several.view)
    assert fit_session(load_session(path), first, str(path)) == several.document
    while several.undo() is not None:
        pass
    assert several.document == first
