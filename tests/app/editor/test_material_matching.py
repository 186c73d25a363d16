"""Matching a material in the editor: what is refused, one undo step, edits meanwhile, sessions, random sequences."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.objects import DeleteObject
from app.document.document import Document
from app.document.material_match import MaterialAnswer, MaterialMatch, MaterialMatchErrors, load_match
from app.editor.editor import Editor
from app.editor.material_matching import MaterialMatching
from app.files.session import load_session
from app.files.session_fitting import fit_session
from app.operators.material_matches import MatchMaterial
from app.operators.registry import run_operator
from engine.curve.tables import TabulatedCurve
from engine.material import MODELS, make_layer
from tests.app.fake_matcher import FakeMatcher
from tests.app.fake_worker import FakeClient

Matcher = FakeMatcher[MaterialMatch, MaterialAnswer]
ERRORS = MaterialMatchErrors(0.5, 0.0125, 0.034)


def found(scale: float = 1.0) -> MaterialAnswer:
    """An answer: Ward's model with a change of its curve."""
    change = TabulatedCurve((0.0, 1.0), ((scale,) * 3, (0.0,) * 3), kind="change")
    return MaterialAnswer(make_layer(MODELS["ward"], {"alpha": 0.2}).with_operators("theta_h", (change,)), ERRORS)


def ask(editor: Editor, **changes: object) -> str | None:
    return run_operator(
        editor, "match_material", MatchMaterial(**{"object": "pot", "source": "floor", "model": "ward", **changes})
    )


@pytest.fixture
def matcher(editor: Editor) -> Matcher:
    made = Matcher("matching floor 25% fitting curves")
    editor.material_matching = MaterialMatching(editor, made)
    return made


def test_a_match_is_one_edit_with_both_errors(editor: Editor, matcher: Matcher) -> None:
    before = editor.document
    assert ask(editor) is None
    match = matcher.settings
    assert match is not None and match.layers == before.object("floor").layers and match.parameters == ("reflectance",)
    editor.tick(1.0)
    assert editor.status.material_match == "matching floor 25% fitting curves" and editor.document is before
    matcher.end(found())
    editor.tick(1.1)
    (layer,) = editor.document.object("pot").layers
    assert layer.model.name == "ward" and [each.kind for each in layer.operators("theta_h")] == ["change"]
    words = "Ward, as floor: error 1.2 % of the BRDF, 3.4 % in the picture"
    assert editor.status.message == words and editor.status.material_match_note == ("pot", words)
    assert not editor.status.material_match
    assert editor.undo() is not None
    assert editor.document == before and editor.status.material_match_note == ("", "")
    editor.redo()
    assert editor.status.material_match_note == ("pot", words)  # the document has it again


def test_a_session_has_the_match(editor: Editor, matcher: Matcher, tmp_path: Path) -> None:
    ask(editor)
    matcher.end(found(0.3))
    editor.tick(1.0)
    assert editor.save(tmp_path / "a.insitu") is None
    session = load_session(tmp_path / "a.insitu")
    assert fit_session(session, editor.scene_document, "shelf").objects == editor.document.objects


@pytest.mark.parametrize(
    "changes, line",
    [
        ({"model": "glass"}, "there is no model 'glass'"),
        ({"model": "measured"}, "its samples are in a file"),
        ({"model": "homomorphic"}, "one curve for two angles"),
        ({"source": "nowhere"}, "no material 'nowhere' in the library, and no object or layer"),
        ({"source": "floor.3"}, "floor has no layer"),
        ({"object": "lamp"}, "lamp"),
        ({"object": "nobody"}, "nobody"),
        ({"curves": ("theta_x",)}, "Ward has no curve"),
        ({"search": ("scale",)}, "Ward has no scalar parameter"),
    ],
)
def test_what_cannot_be_matched_is_one_line(
    editor: Editor, matcher: Matcher, changes: dict[str, object], line: str
) -> None:
    assert line in str(ask(editor, **changes)) and not matcher.n_begun
    assert line in editor.status.message and editor.status.is_error


def test_one_match_at_a_time(editor: Editor, matcher: Matcher) -> None:
    assert ask(editor) is None
    assert "still being matched; wait, or stop it" in str(ask(editor, source="Gold"))
    assert matcher.n_begun == 1 and matcher.settings is not None and matcher.settings.source == "floor"


def test_a_failure_is_one_line(editor: Editor, matcher: Matcher, tmp_path: Path) -> None:
    before = editor.document
    assert ask(editor, source=str(tmp_path / "gold.binary")) is None  # a measurement is read by the process
    assert matcher.settings is not None and len(matcher.settings.layers) == 2 and matcher.settings.title == "gold"
    matcher.end(None, "gold was not matched: gold.binary: no such file")
    editor.tick(1.0)
    assert editor.status.message == "gold was not matched: gold.binary: no such file" and editor.status.is_error
    assert not editor.material_matching.progress and editor.document is before


def test_edits_of_the_object_drop_the_answer_and_those_of_others_stay(editor: Editor, matcher: Matcher) -> None:
    ask(editor)
    editor.do(SetParameter("floor.0", "albedo", (0.1, 0.2, 0.3)))  # the source: what it was is matched
    matcher.end(found())
    editor.tick(1.0)
    assert has_match(editor.document) and editor.document.layer("floor.0").values["albedo"] == (0.1, 0.2, 0.3)
    editor.undo()
    ask(editor)
    editor.do(SetParameter("pot.1", "alpha", 0.7))
    edited = editor.document
    matcher.end(found())
    editor.tick(2.0)
    assert editor.document is edited and editor.status.is_error
    assert editor.status.message == "what was found is dropped: pot was edited while it was matched; match it again"
    ask(editor)
    editor.do(DeleteObject("pot"))
    matcher.end(found())
    editor.tick(3.0)
    assert editor.status.message == "what was found is dropped: pot is no longer in the scene"
    editor.undo()
    editor.tick(4.0)
    assert editor.document == edited


def test_an_edit_that_was_undone_meanwhile_is_none(editor: Editor, matcher: Matcher) -> None:
    ask(editor)
    editor.do(SetParameter("pot.1", "alpha", 0.7))
    editor.undo()
    matcher.end(found())
    editor.tick(1.0)
    assert has_match(editor.document)


def test_another_scene_and_the_end_of_the_editor_stop_it(client: FakeClient, editor: Editor, matcher: Matcher) -> None:
    ask(editor)
    editor.open("bunny")
    editor.tick(0.1)
    assert matcher.settings is not None  # the present scene stays until the new one is there
    client.open_scene()
    editor.tick(0.2)
    before, said = editor.document, editor.status.message
    editor.tick(0.3)
    assert editor.status.message == said
    assert matcher.settings is None and not editor.material_matching.progress and editor.document == before
    ask(editor)
    editor.close()
    assert matcher.is_closed and matcher.settings is None and not editor.material_matching.progress


def test_the_errors_of_another_scenes_match_are_not_shown(client: FakeClient, editor: Editor, matcher: Matcher) -> None:
    ask(editor, object="floor", source="floor", model="lambert")
    matcher.end(MaterialAnswer(editor.document.layer("floor.0"), ERRORS))  # what any opening of the scene has
    editor.tick(0.1)
    assert editor.status.material_match_note[0] == "floor"
    editor.open("shelf")
    client.open_scene()
    editor.tick(0.2)
    editor.tick(0.3)
    assert editor.status.material_match_note == ("", "")


@pytest.mark.parametrize("seed", range(12))
def test_random_sequences_change_the_document_by_awaited_answers_alone(
    editor: Editor, matcher: Matcher, seed: int
) -> None:
    """Whatever comes in between: an answer that is awaited replaces the material that it was found for, in one step
    that undo takes back to the bit; one that comes during a drag waits for its end; all others do nothing."""
    rng = random.Random(seed)
    asked_for = None  # the layers that the awaited answer is for
    for step in range(80):
        before, dragging = editor.document, editor.history.dragging
        match rng.choice(
            ("ask", "answer", "fail", "stop", "stop all", "edit", "edit pot", "begin", "end", "undo", "redo")
        ):
            case "ask":
                refusal = ask(editor, source=rng.choice(("floor", "pot", "Gold", "floor.0")))
                assert (refusal is None) == (asked_for is None)
                asked_for = asked_for or before.object("pot").layers
            case "answer":
                matcher.end(found(rng.random()))
            case "fail":
                matcher.end(None, "it cannot be read")
            case "stop":
                editor.material_matching.stop()
                assert matcher.settings is None and not matcher.ended
                asked_for = None
            case "stop all":
                editor.cancel_work()  # the worker's: a match goes on
            case "edit":
                editor.do(SetParameter("floor.0", "albedo", (rng.random(), 0.5, 0.5)))
            case "edit pot" if editor.document.object("pot").layers[0].model.name == "lambert":
                editor.do(SetParameter("pot.0", "albedo", (rng.random(), 0.5, 0.5)))
            case "begin":
                editor.begin_drag()
            case "end":
                editor.end_drag()
            case "undo" if not dragging:
                editor.undo()
            case "redo" if not dragging:
                editor.redo()
        before, waiting = editor.document, matcher.ended[:1]
        editor.tick(1.0 + step)
        if not waiting or editor.history.dragging:
            assert editor.document is before
        else:
            (ended,) = waiting
            if ended.answer is not None and before.object("pot").layers == asked_for:
                assert editor.document.object("pot").layers == (ended.answer.layer,)
                after = editor.document
                editor.undo()
                assert editor.document == before
                editor.redo()
                assert editor.document == after
            else:
                assert editor.document is before and editor.status.is_error
            asked_for = None
        assert bool(editor.material_matching.progress) == (asked_for is not None)
        assert (asked_for is not None) == (matcher.settings is not None or bool(matcher.ended))


def has_match(document: Document) -> bool:
    return [layer.model.name for layer in document.object("pot").layers] == ["ward"]


def test_a_match_keeps_parameters_of_the_objects_own_model(document: Document) -> None:
    metal = make_layer(MODELS["rough_conductor"], {"alpha": 0.7})
    match = MaterialMatch("pot", "metal", "rough_conductor", title="metal", layers=(metal,))
    assert match.start(document).values["alpha"] == 0.15 and match.parameters == ("alpha",)
    assert replace(match, model="ward").start(document) == make_layer(MODELS["ward"])
    assert replace(match, searched=()).parameters == ()


def test_a_match_survives_its_journey_but_for_its_layers() -> None:
    match = MaterialMatch("pot", 'a "b".binary', "ward", ("theta_h",), (), "b")
    assert load_match(match.dump()) == match
    assert load_match(replace(match, curves=None, layers=(make_layer(MODELS["ward"]),)).dump()).curves is None
