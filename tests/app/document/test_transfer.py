"""Transferring an edit: paths, refusals, one step, and the operators for the selected objects."""

from __future__ import annotations

import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.links import LinkCurves
from app.document.commands.transfer import TransferEdit
from app.document.described import document_from_description
from app.editor.editor import Editor
from app.operators.registry import run_operator
from engine.core.errors import InsituError
from engine.curve.operators import Operator
from engine.scene.description import parse_description
from tests.app.fake_worker import FakeClient

LIFT = Operator("amplify", "y", 0.1, 0.3, 0.6, 0.9, magnitude=3.0)
SCENE = {
    "version": 1,
    "name": "shelf",
    "bounces": 1,
    "camera": {"position": [0, 1, 4], "target": [0, 0, 0], "resolution": [8, 6]},
    "object": [
        {"name": "pot", "primitive": "sphere", "layer": [{"model": "lambert"}, {"model": "rough_conductor"}]},
        {"name": "cup", "primitive": "sphere", "layer": [{"model": "blinn_phong"}]},
        {"name": "mug", "primitive": "sphere", "layer": [{"model": "blinn_phong"}]},
        {"name": "floor", "primitive": "quad", "layer": [{"model": "lambert"}]},
    ],
}


@pytest.fixture
def document():
    bare = document_from_description("shelf", parse_description(SCENE, "shelf"))
    return AddOperator("pot.1", "theta_h", LIFT).apply(bare)


@pytest.mark.parametrize("to", ["cup", "cup.0", "cup.0.theta_h"])
def test_it_goes_to_an_object_a_layer_or_a_curve(document, to):
    after = TransferEdit("pot.1.theta_h", (to,)).apply(document)
    [operator] = after.layer("cup.0").operators("theta_h")
    assert operator.kind == "ratio" and after.layer("pot.1") == document.layer("pot.1")
    assert (
        TransferEdit("pot.1.theta_h", (to,), "relative").apply(document).layer("cup.0").edits[0][1][0].kind == "change"
    )


@pytest.mark.parametrize("curve, to, measure, words", [
    ("pot.1.theta_h", ("floor",), "ratio", "no layer with a curve theta_h"),
    ("pot.1.theta_h", ("floor.0",), "ratio", "no curve theta_h; it has"),
    ("pot.1.theta_h", (), "ratio", "transferred to nothing"),
    ("pot.1.theta_h", ("pot.1",), "ratio", "name another layer"),
    ("cup.0.theta_h", ("pot",), "ratio", "has no operators"),
    ("pot.1.theta_h", ("cup",), "twice", "measure = 'twice'"),
    ("pot.1.alpha", ("cup",), "ratio", "name a curve"),
])  # fmt: skip
def test_what_it_cannot_do_is_said_in_one_line(document, curve, to, measure, words):
    with pytest.raises(InsituError, match=words) as error:
        TransferEdit(curve, to, measure).apply(document)
    assert "\n" not in str(error.value)


def test_what_is_named_twice_or_linked_is_changed_once(document):
    twice = TransferEdit("pot.1.theta_h", ("cup", "cup.0", "cup.0.theta_h")).apply(document)
    assert twice == TransferEdit("pot.1.theta_h", ("cup",)).apply(document)
    document = LinkCurves("cup.0.theta_h", ("mug.0.theta_h",)).apply(document)
    both = TransferEdit("pot.1.theta_h", ("cup", "mug")).apply(document)
    assert len(both.layer("cup.0").operators("theta_h")) == 1
    assert both.layer("mug.0").operators("theta_h") == both.layer("cup.0").operators("theta_h")


def test_what_follows_the_source_is_refused(document):
    document = LinkCurves("pot.1.theta_h", ("cup.0.theta_h",)).apply(document)
    with pytest.raises(InsituError, match="cup shares the curve that the change is from"):
        TransferEdit("pot.1.theta_h", ("cup",)).apply(document)


def test_the_selected_objects_get_it_in_one_step():
    client = FakeClient()
    editor = Editor(client, "shelf")
    client.open_scene(SCENE)
    editor.tick(0.0)
    editor.do(AddOperator("pot.1", "theta_h", LIFT))
    editor.select("pot.1.theta_h")
    assert run_operator(editor, "transfer_ratio") is not None  # nothing else is selected
    editor.select(("cup", "pot.1.theta_h"))
    assert run_operator(editor, "transfer_ratio") is None
    assert editor.document.layer("cup.0").operators("theta_h")
    assert editor.undo() == "transfer the edit of pot.1.theta_h" and not editor.document.layer("cup.0").edits
