"""Matching a material: what is refused, one undo step, sessions, drags, and random sequences of all of it."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands.layers import SetParameter
from app.document.document import Document
from app.document.material_match import MaterialMatch
from app.editor.editor import Editor
from app.files.session import load_session
from app.files.session_fitting import fit_session
from app.messages.match_messages import MatchErrors, MatchMaterial, MatchProgress, MaterialMatched
from app.messages.worker_messages import CancelRequests, RequestFailed
from app.operators.matches import Match
from app.operators.registry import run_operator
from engine.curve.tables import TabulatedCurve
from engine.material import MODELS, make_layer
from engine.planner import band_counts
from tests.app.fake_worker import FakeClient

ERRORS = MatchErrors(0.5, 0.0125, 0.034)


def matched(scale: float = 1.0) -> MaterialMatched:
    """An answer: Ward's model with a change of its curve."""
    change = TabulatedCurve((0.0, 1.0), ((scale,) * 3, (0.0,) * 3), kind="change")
    layer = make_layer(MODELS["ward"], {"alpha": 0.2}).with_operators("theta_h", (change,))
    return MaterialMatched(layer, ERRORS, band_counts(layer))


def ask(editor: Editor, **changes: object) -> str | None:
    return run_operator(
        editor, "match_material", Match(**{"object": "pot", "source": "floor", "model": "ward", **changes})
    )


def answer(editor: Editor, client: FakeClient, response: object, now: float = 1.0) -> None:
    client.answer(client.sent(MatchMaterial)[-1], response)
    editor.tick(now)


def test_a_match_is_one_edit_with_both_errors(editor: Editor, client: FakeClient) -> None:
    before = editor.document
    assert ask(editor) is None
    (request,) = client.sent(MatchMaterial)
    assert request.match.layers == before.object("floor").layers and request.match.parameters == ("reflectance",)
    answer(editor, client, MatchProgress(0.25, "fitting curves"))
    assert editor.status.matching == "matching floor 25 %" and editor.document is before
    answer(editor, client, matched())
    (layer,) = editor.document.object("pot").layers
    assert layer.model.name == "ward" and [each.kind for each in layer.operators("theta_h")] == ["change"]
    words = "Ward, as floor: error 1.2 % of the BRDF, 3.4 % in the picture"
    assert editor.status.message == words and editor.status.match_note == ("pot", words)
    assert editor.undo() is not None
    assert editor.document == before and editor.status.match_note == ("", "")
    editor.redo()
    assert editor.status.match_note == ("pot", words)  # the document has it again


def test_a_session_has_the_match(editor: Editor, client: FakeClient, tmp_path: Path) -> None:
    ask(editor)
    answer(editor, client, matched(0.3))
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
    editor: Editor, client: FakeClient, changes: dict[str, object], line: str
) -> None:
    assert line in str(ask(editor, **changes)) and not client.sent(MatchMaterial)
    assert line in editor.status.message and editor.status.is_error


def test_an_unread_measurement_goes_to_the_worker(editor: Editor, client: FakeClient, tmp_path: Path) -> None:
    assert ask(editor, source=str(tmp_path / "gold.binary")) is None
    (request,) = client.sent(MatchMaterial)
    assert request.match.source == "gold" and len(request.match.layers) == 2
    answer(editor, client, RequestFailed("gold.binary: no such file"))
    assert editor.status.message == "gold was not matched: gold.binary: no such file" and editor.status.is_error
    assert not editor.matching.is_under_way


@pytest.mark.parametrize("seed", range(12))
def test_random_sequences_change_the_document_by_awaited_answers_alone(
    editor: Editor, client: FakeClient, seed: int
) -> None:
    """Whatever comes in between: an answer that is awaited replaces the material in one step that undo takes back to
    the bit; one that came during a drag waits for its end; all others do nothing."""
    rng, awaited, late = random.Random(seed), False, False
    for step in range(80):
        now, before, n_sent = 1.0 + step, editor.document, len(client.sent(MatchMaterial))
        match rng.choice(
            ("ask", "progress", "answer", "old", "fail", "cancel", "edit", "begin", "end", "stop", "undo")
        ):
            case "ask":
                assert ask(editor, source=rng.choice(("floor", "pot", "Gold", "floor.0"))) is None
                awaited, late = True, False
                assert len(client.sent(MatchMaterial)) == n_sent + 1
            case "progress" if awaited:
                answer(editor, client, MatchProgress(rng.random(), ""), now)
                assert editor.document is before and editor.status.matching
            case "answer" if awaited and not late:
                answer(editor, client, matched(rng.random()), now)
                if editor.history.dragging:
                    late = True
                    assert editor.document is before
                    continue
                awaited = False
                assert has_match(editor.document) and editor.document is not before
                editor.undo()
                assert editor.document == before
            case "old" if n_sent > 1:
                client.answer(client.sent(MatchMaterial)[-2], matched())
                editor.tick(now)
                assert editor.document is before
            case "fail" if awaited and not late:
                answer(editor, client, RequestFailed("no"), now)
                awaited = False
                assert editor.document is before
            case "cancel":
                editor.matching.cancel()
                assert not awaited or client.sent(CancelRequests)[-1].of == (MatchMaterial,)
                awaited = late = False
            case "stop":
                editor.cancel_work()
                awaited = late = False
            case "edit":
                editor.do(SetParameter("floor.0", "albedo", (rng.random(), 0.5, 0.5)))
            case "begin":
                editor.begin_drag()
            case "end" if editor.history.dragging:
                editor.end_drag()
                if late:
                    assert has_match(editor.document)
                    awaited = late = False
            case "undo":
                was_dragging = editor.history.dragging
                editor.undo()
                if was_dragging and late and not editor.history.dragging:
                    awaited = late = False
        assert editor.matching.is_under_way == awaited


def has_match(document: Document) -> bool:
    return [layer.model.name for layer in document.object("pot").layers] == ["ward"]


def test_a_match_keeps_parameters_of_the_objects_own_model(document: Document) -> None:
    metal = make_layer(MODELS["rough_conductor"], {"alpha": 0.7})
    match = MaterialMatch("pot", (metal,), "metal", "rough_conductor")
    assert match.start(document).values["alpha"] == 0.15 and match.parameters == ("alpha",)
    assert replace(match, model="ward").start(document) == make_layer(MODELS["ward"])
    assert replace(match, searched=()).parameters == ()
