"""Painting in documents: strokes as steps of the history, layers that are blended, sessions; and what the window shows
while a stroke goes on."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands.layers import SetFrozen
from app.document.commands.maps import BlendByMap, ClearMap, Paint, SetMap, blended_with, without_strokes
from app.document.document import Document
from app.document.history import History
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.session import load_session, save_session
from app.modes.placement.placement_events import LayerMapsChanged
from app.modes.placement.placement_messages import MapsSampled, SampleMaps
from engine.core.errors import InsituError
from engine.material.layer_maps import LayerMaps, MapMeans
from engine.material.strokes import MAX_DABS, Stroke, pack_dabs
from tests.app.fake_worker import FakeClient


def dabs(n: int = 1, x: float = 0.0) -> bytes:
    return pack_dabs(np.c_[np.full(n, x), np.arange(n), np.zeros(n)], np.tile([0.0, 0.0, 1.0], (n, 1)))


STROKE = Stroke(0.1, 1.0, 1.0, 0.5, dabs())


def test_one_drag_is_one_step_and_undo_takes_the_stroke(document: Document, tmp_path: Path) -> None:
    history = History(document)
    for _ in range(2):
        history.begin_drag()
        history.do(Paint("pot.1", STROKE))
        history.do(Paint("pot.1", replace(STROKE, dabs=dabs(2, 1.0)), begins=False))
        history.end_drag()
    (one, two) = history.document.layer("pot.1").maps.strokes.strokes
    assert one == two == Stroke(0.1, 1.0, 1.0, 0.5, dabs() + dabs(2, 1.0))
    assert history.undo() == "paint pot.1" and len(history.document.layer("pot.1").maps.strokes.strokes) == 1
    history.undo()
    assert history.document == document
    history.redo()
    painted = history.document
    assert load_session(save_session(tmp_path / "mine.insitu", painted, ViewState())).document == painted


def test_layers_blended_by_a_map_are_painted_together(document: Document) -> None:
    document = SetMap("pot.1", "weight_start", 0.0).apply(document)
    assert blended_with(document, "pot.1") == ("pot.1",)
    document = BlendByMap("pot.1", "pot.0").apply(document)
    assert document.layer("pot.0").maps == LayerMaps(weight_invert=True, weight_start=0.0)
    for key, value in (("pot.1", 1.0), ("pot.0", 0.0)):  # bringing the one is taking the other
        painted = Paint(key, replace(STROKE, value=value)).apply(document)
        first, second = (painted.layer(each).maps for each in ("pot.0", "pot.1"))
        assert first.strokes == second.strokes and first.strokes.strokes[0].value == 1.0
        assert first.images == second.images and first.inverts and not second.inverts
    alone = SetMap("pot.0", "weight_invert", False).apply(document)
    assert blended_with(alone, "pot.1") == ("pot.1",)  # alike by chance: nothing is blended


def test_what_refuses_the_brush(document: Document) -> None:
    with pytest.raises(InsituError, match="frozen"):
        Paint("pot.1", STROKE).apply(SetFrozen("pot.1", True).apply(document))
    full = Paint("pot.1", replace(STROKE, dabs=dabs(MAX_DABS))).apply(document)
    with pytest.raises(InsituError, match="full"):
        Paint("pot.1", STROKE, begins=False).apply(full)
    assert ClearMap("pot.1").apply(full) == document


def test_strokes_stay_with_their_object(document: Document) -> None:
    painted = Paint("pot.1", STROKE).apply(SetMap("pot.1", "texture", "oak.png").apply(document))
    (_, left) = without_strokes(painted.object("pot").layers)
    assert left.maps == LayerMaps(texture="oak.png")
    filed = SetMap("pot.1", "weight", "mask.png").apply(painted)
    assert without_strokes(filed.object("pot").layers)[1].maps.weight == "mask.png"


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.1)
    return editor


def answer(editor: Editor, client: FakeClient, request: SampleMaps, level: float) -> list[LayerMapsChanged]:
    for key, images in pickle.loads(pickle.dumps(request.layers)):
        means = MapMeans(weight=level, both=(level, level, level))
        client.answer(request, MapsSampled(key, images, np.full((4, 4), level, np.float16), means, {}))
    return [event for event in editor.tick(0.1) if isinstance(event, LayerMapsChanged)]


def test_a_stroke_is_seen_while_it_goes_on(editor: Editor, client: FakeClient) -> None:
    """Answers that the hand has left behind are shown, and their mean stands for the newest, until that is here."""
    plain = editor.controller.curves.outgoing_gain(editor.document, "pot.1")
    editor.begin_drag()
    editor.do(Paint("pot.1", STROKE))
    editor.tick(0.1)
    first = client.sent(SampleMaps)[-1]
    editor.do(Paint("pot.1", STROKE, begins=False))
    assert [event for event in editor.tick(0.1) if isinstance(event, LayerMapsChanged)] == []
    assert client.sent(SampleMaps) == [first]  # one after the other, or no answer would count
    (event,) = answer(editor, client, first, 0.25)
    assert (event.samples == 0.25).all() and event.has_weight and not editor.controller.maps.is_complete
    np.testing.assert_allclose(editor.controller.curves.outgoing_gain(editor.document, "pot.1"), 0.25 * plain)
    (event,) = answer(editor, client, client.sent(SampleMaps)[-1], 0.5)
    assert (event.samples == 0.5).all() and editor.controller.maps.is_complete
    editor.end_drag()
    ((_, images),) = editor.controller.curves.map_means  # of the stroke as it went on nothing is kept
    assert images.strokes is editor.document.layer("pot.1").maps.strokes  # nor a copy of the document's strokes
    editor.undo()
    (event,) = [event for event in editor.tick(0.1) if isinstance(event, LayerMapsChanged)]
    assert event.samples is None
    editor.redo()
    n_asked = len(client.sent(SampleMaps))
    (event,) = [event for event in editor.tick(0.1) if isinstance(event, LayerMapsChanged)]
    assert (event.samples == 0.5).all() and len(client.sent(SampleMaps)) == n_asked
