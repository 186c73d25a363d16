"""Objects that are moved by hand: commands, paths, scripts, sessions, reloads, and random sequences of all of them."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import AddDeformer, EditCommand, MoveObject, SetTransform
from app.document.commands.layers import SetParameter
from app.document.document import Document
from app.document.scene_change import SceneChange
from app.document.scene_state import moved_objects
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.editor.view_controller import REST_SECONDS
from app.files.session import dump_session, load_session, save_session
from app.files.session_fitting import fit_session
from app.interface.values import value_at
from app.messages.worker_messages import SetCamera
from app.operators.arrange import Move
from app.operators.registry import run_operator
from app.operators.script import Step, load_script
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.transform import Transform, rotation_matrix
from tests.app.fake_worker import FakeClient


def moved(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


def test_each_part_is_set_alone(document: Document) -> None:
    found = moved(
        document, SetTransform("pot", (0.1, 0.0, -2.0)), SetTransform("pot", rotation=(0.0, 45.0, 0.0)),
        SetTransform("pot", scale=(2.0, 1.0, 0.5)),
    )  # fmt: skip
    there = Transform((0.1, 0.0, -2.0), (0.0, 45.0, 0.0), (2.0, 1.0, 0.5))
    assert found.object("pot").transform == there and found.poses == (("pot", (there,)),)
    assert SetTransform("pot").apply(found) == document and document.poses == ()
    assert [each.label for each in (SetTransform("pot", (1.0, 0.0, 0.0)), SetTransform("pot"))] == [
        "move pot", "put back pot"
    ]  # fmt: skip


def test_a_transform_is_the_last_step_of_a_pose(document: Document) -> None:
    found = moved(document, SetTransform("pot", (1.0, 0.0, 0.0)), AddDeformer("pot", "bend", 40.0))
    assert found.poses == (("pot", (Deformation("bend", 40.0), Transform((1.0, 0.0, 0.0)))),)


def test_lamps_that_were_moved_are_told_apart(document: Document) -> None:
    found = moved(document, SetTransform("lamp", (0.0, 1.0, 0.0)), SetTransform("pot", (1.0, 0.0, 0.0)))
    assert moved_objects(found) == (("pot",), (("lamp", (Transform((0.0, 1.0, 0.0)),)),))


def test_a_move_goes_on_from_where_the_object_is(document: Document) -> None:
    once = MoveObject("pot", (0.1, 0.0, 0.0), (0.0, 0.0, 90.0), (2.0, 1.0, 1.0))
    found = moved(document, once, MoveObject("pot", (0.1, 0.2, 0.0), (90.0, 0.0, 0.0), (1.0, 1.0, 3.0)))
    transform = found.object("pot").transform
    assert transform.translation == pytest.approx((0.2, 0.2, 0.0)) and transform.scale == (2.0, 1.0, 3.0)
    # First about Z, then about the world's X: not the sum of the angles.
    expected = rotation_matrix((90.0, 0.0, 0.0)) @ rotation_matrix((0.0, 0.0, 90.0))
    assert rotation_matrix(transform.rotation) == pytest.approx(expected, abs=1e-12)
    assert MoveObject("pot", (0.1, 0.0, 0.0)).apply(document) == SetTransform("pot", (0.1, 0.0, 0.0)).apply(document)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (SetTransform("cup", (1.0, 0.0, 0.0)), "no object 'cup'"),
        (SetTransform("pot", scale=(0.0, 1.0, 1.0)), r"pot: scale \[0, 1, 1\], expected three numbers from 0.001"),
        (SetTransform("pot", (float("nan"), 0.0, 0.0)), "pot: translation"),
        (MoveObject("pot", scale=(2000.0, 1.0, 1.0)), "pot: scale"),
    ],
)
def test_what_makes_no_sense_is_refused(document: Document, command: EditCommand, said: str) -> None:
    with pytest.raises(InsituError, match=said):
        command.apply(document)


def test_paths_set_and_read_the_parts(document: Document) -> None:
    found = document
    for path, value in (("pot.position", [0.1, 0, -2]), ("pot.rotation", (0, 45, 0)), ("pot.scale", 2)):
        found = set_path(found, path, value).apply(found)
    assert found.object("pot").transform == Transform((0.1, 0.0, -2.0), (0.0, 45.0, 0.0), (2.0, 2.0, 2.0))
    assert value_at(found, "pot.position") == (0.1, 0.0, -2.0) and value_at(found, "floor.scale") == (1.0, 1.0, 1.0)
    for value in ("far", True, 1.0, [1.0, 2.0], [1.0, 2.0, "x"]):
        with pytest.raises(LoadError, match=r"pot\.position: value = .*, expected three numbers, along X, Y and Z"):
            set_path(document, "pot.position", value)


def test_a_script_moves(tmp_path: Path, editor: Editor) -> None:
    script = tmp_path / "script.toml"
    script.write_text('[[step]]\nmove = {object = "pot", by = [0.1, 0, 0], rotate = [0, 45, 0], scale = 2}\n')
    (step,) = load_script(script)
    assert step == Step("move", Move(object="pot", by=(0.1, 0.0, 0.0), rotate=(0.0, 45.0, 0.0), scale=2.0))
    assert run_operator(editor, "move", step.value) is None
    transform = editor.document.object("pot").transform
    assert transform.translation == (0.1, 0.0, 0.0) and transform.scale == (2.0, 2.0, 2.0)
    assert transform.rotation == pytest.approx((0.0, 45.0, 0.0)) and len(editor.history.undo_steps) == 1
    wrong_moves = '{object = "pot"}', "{by = [1, 0, 0]}", '{object = "pot", by = [1, 0]}', '{object = "p", scale = ""}'
    for wrong in wrong_moves:
        script.write_text(f"[[step]]\nmove = {wrong}\n")
        with pytest.raises(LoadError, match="move"):
            load_script(script)


def test_a_session_keeps_transforms(document: Document, tmp_path: Path) -> None:
    here = SetTransform("lamp", (0.1, 1.0 / 3.0, 0.0), (1e-17, 0.1, 7.0), (1.0, 1.1, 1.0)).apply(document)
    path = save_session(tmp_path / "moved.insitu", here, ViewState())
    assert fit_session(load_session(path), document, str(path)) == here
    path.write_text(path.read_text().replace("1.1", "-1.1"))
    with pytest.raises(LoadError, match=r"scale \[1, -1.1, 1\], expected three numbers from 0.001 to 1000"):
        load_session(path)
    assert "transform" not in dump_session(document, ViewState())


def test_files_saved_again_keep_what_was_moved(document: Document) -> None:
    mine = SetTransform("pot", (1.0, 0.0, 0.0)).apply(document)
    theirs = SetParameter("pot.0", "albedo", 0.3).apply(document)
    assert SceneChange(document, theirs)(mine) == SetTransform("pot", (1.0, 0.0, 0.0)).apply(theirs)
    gone = replace(document, objects=document.objects[1:])
    (kept,) = SceneChange(document, gone)(mine).absent
    assert kept.transform == Transform((1.0, 0.0, 0.0))


def test_a_drag_is_one_step_and_the_worker_traces_where_it_ends(settled: Editor, client: FakeClient) -> None:
    settled.history.begin_drag("move pot")
    for x in (0.1, 0.2, 0.3):
        settled.do(SetTransform("pot", (x, 0.0, 0.0)))
        settled.tick(2.0 + x)
    settled.history.end_drag()
    assert len(settled.history.undo_steps) == 1
    settled.tick(3.0)
    settled.tick(3.0 + 2.0 * REST_SECONDS)
    (view,) = [each for each in client.requests if isinstance(each, SetCamera)]
    assert view.poses == (("pot", (Transform((0.3, 0.0, 0.0)),)),)
    settled.undo()
    assert settled.document.poses == ()


def test_what_is_framed_follows_what_was_moved(settled: Editor) -> None:
    history = settled.camera_history
    boxes = np.array([[[0, 0, 0], [1, 2, 3]], [[-9, -1, -9], [9, 0, 9]], [[0, 5, 0], [1, 5.5, 1]]], np.float64)
    history.scene_opened(settled.scenes.opened.description, boxes)
    before = history.box_of("pot")
    settled.do(SetTransform("pot", (5.0, 0.0, 0.0), scale=(2.0, 2.0, 2.0)))
    low, high = history.box_of("pot")
    assert 0.5 * (low + high) == pytest.approx(before.mean(axis=0) + (5.0, 0.0, 0.0))
    assert high - low == pytest.approx(2.0 * (before[1] - before[0]))
    assert history.resting_box("pot") == pytest.approx(before) and history.resting_box("cup") is None


def test_any_sequence_of_moves_is_that_of_a_fresh_start(document: Document, tmp_path: Path) -> None:
    """Edits, undo, redo and sessions in any order: the document is the one that the edits in force make of the scene,
    and undo goes back to the bit."""
    for seed in range(20):
        rng = random.Random(seed)
        states, at = [document], 0
        for _ in range(30):
            what = rng.choice(("edit", "edit", "edit", "undo", "redo", "session"))
            if what == "edit":
                name = rng.choice(("pot", "floor", "lamp"))
                triple = tuple(rng.uniform(0.5, 2.0) for _ in range(3))
                command = rng.choice((
                    SetTransform(name, triple), SetTransform(name, rotation=triple), SetTransform(name, scale=triple),
                    SetTransform(name), MoveObject(name, triple, triple, (1.0, rng.uniform(0.8, 1.25), 1.0)),
                    AddDeformer(name, "bend", 3.0),
                ))  # fmt: skip
                states[at + 1 :] = [command.apply(states[at])]
                at += 1
            elif what == "session":
                path = save_session(tmp_path / "any.insitu", states[at], ViewState())
                assert fit_session(load_session(path), document, str(path)) == states[at]
            else:
                at = min(max(at + (1 if what == "redo" else -1), 0), len(states) - 1)
        assert states[0] == document and states[0].poses == ()
