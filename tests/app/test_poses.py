"""Poses are a part of the document: their commands, their steps, what is kept of them, and what the worker is asked."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands import AddDeformer, EditCommand, MoveDeformer, RemoveDeformer, SetDeformer, SetPose
from app.commands.poses import MAX_DEFORMERS
from app.document import Document
from app.editor import Editor
from app.files.session import load_session, save_session
from app.looking import REST_SECONDS
from app.messages import Failed, LookFrom
from app.script import DeformObject, load_script
from app.set_path import set_path
from app.view_state import ViewState
from engine.deform.pose import Deformation
from engine.errors import InsituError, LoadError
from tests.app.fake_worker import FakeClient

BEND, TWIST = Deformation("bend", 40.0), Deformation("twist", -90.0, "x")


@pytest.fixture
def bent(document: Document) -> Document:
    return SetPose("pot", (BEND, TWIST)).apply(document)


@pytest.mark.parametrize(
    ("command", "row"),
    [
        (AddDeformer("pot", "taper", 0.5), (BEND, TWIST, Deformation("taper", 0.5))),
        (SetDeformer("pot", 0, amount=-720.0), (Deformation("bend", -720.0), TWIST)),
        (SetDeformer("pot", 1, axis="z"), (BEND, Deformation("twist", -90.0, "z"))),
        (MoveDeformer("pot", 0, 1), (TWIST, BEND)),
        (RemoveDeformer("pot", 0), (TWIST,)),
        (SetPose("pot"), ()),
    ],
)
def test_each_command_changes_the_row(bent: Document, command: EditCommand, row: tuple[Deformation, ...]) -> None:
    assert command.apply(bent).object("pot").deformations == row


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (SetDeformer("pot", 0, amount=721.0), "bend 721, expected -720 to 720"),
        (SetDeformer("pot", 0, amount=float("nan")), "bend nan"),
        (SetDeformer("pot", 2), "2 deformers, none at 2"),
        (SetDeformer("pot", 0, axis="w"), "axis 'w', expected one of x, y, z"),
        (AddDeformer("pot", "melt"), "deformer 'melt', expected one of bend"),
        (RemoveDeformer("floor", 0), "no deformers"),
        (AddDeformer("cup", "bend"), "no object 'cup'"),
        (SetPose("pot", (BEND,) * (MAX_DEFORMERS + 1)), f"{MAX_DEFORMERS} deformers"),
    ],
)
def test_what_makes_no_sense_is_refused(bent: Document, command: EditCommand, said: str) -> None:
    with pytest.raises(InsituError, match=said):
        command.apply(bent)


def test_a_pose_is_set_by_path(bent: Document) -> None:
    changed = set_path(bent, "pot.twist", 30).apply(bent)
    assert changed.object("pot").deformations == (BEND, Deformation("twist", 30.0, "x"))
    assert set_path(bent, "floor.wave", 0.25).apply(bent).object("floor").deformations == (Deformation("wave", 0.25),)
    for value in ("a lot", True, 1e9, [1.0]):
        with pytest.raises(InsituError, match="-720"):
            set_path(bent, "pot.bend", value)


def test_deformers_of_no_amount_are_no_pose(document: Document) -> None:
    assert document.poses == ()
    assert AddDeformer("pot", "bend").apply(document).poses == ()
    assert SetPose("pot", (Deformation("wave", 0.0), BEND)).apply(document).poses == (("pot", (BEND,)),)


def test_a_session_keeps_poses(bent: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "bent.insitu", bent, ViewState())
    assert load_session(path).document == bent
    path.write_text(path.read_text().replace('"bend"', '"melt"'))
    with pytest.raises(LoadError, match="deformer 'melt', expected one of bend"):
        load_session(path)


def test_a_script_deforms(tmp_path: Path) -> None:
    script = tmp_path / "script.toml"
    script.write_text('[[step]]\ndeform = {object = "vase", bend = 40.0, taper = 1}\n')
    assert load_script(script) == (DeformObject("vase", (("bend", 40.0), ("taper", 1.0))),)
    for wrong in ('{object = "vase"}', '{object = "vase", melt = 1.0}', "{bend = 1.0}", '{object = "v", bend = "x"}'):
        script.write_text(f"[[step]]\ndeform = {wrong}\n")
        with pytest.raises(LoadError, match="deform"):
            load_script(script)


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """An editor at time 1 with its scene open, whose worker has nothing to do."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.tick(1.0)
    client.requests.clear()
    return editor


def test_a_drag_is_one_step_and_is_traced_once_it_rests(editor: Editor, client: FakeClient) -> None:
    editor.do(AddDeformer("pot", "bend"))
    editor.begin_drag()
    for step in range(1, 5):
        editor.do(SetDeformer("pot", 0, amount=10.0 * step))
        editor.tick(2.0 + 0.5 * REST_SECONDS * step)
    assert client.sent(LookFrom) == [] and editor.status.is_away
    editor.end_drag()
    editor.tick(4.0)
    (look,) = client.sent(LookFrom)
    assert look.poses == (("pot", (BEND,)),) and look.camera is None
    client.see_scene()
    editor.tick(4.1)
    assert not editor.status.is_away and len(client.sent(LookFrom)) == 1
    editor.undo()
    assert editor.document.object("pot").deformations == (Deformation("bend", 0.0),)
    editor.tick(5.0)
    editor.tick(6.0)
    assert client.sent(LookFrom)[1].poses == ()


def test_a_pose_that_cannot_be_traced_is_asked_for_once(editor: Editor, client: FakeClient) -> None:
    editor.do(AddDeformer("pot", "bend", 40.0))
    editor.tick(2.0)
    editor.tick(3.0)
    (look,) = client.sent(LookFrom)
    client.answer(look, Failed("no memory"))
    for step in range(5):
        editor.tick(4.0 + step)
    assert len(client.sent(LookFrom)) == 1 and editor.document.poses
    editor.do(SetDeformer("pot", 0, amount=20.0))
    editor.tick(10.0)
    editor.tick(11.0)
    assert len(client.sent(LookFrom)) == 2
