"""The editor while objects are duplicated and deleted: the mode waits, and goes on with what was traced."""

from __future__ import annotations

import random

import pytest

from app.document.commands import DeleteObject, DuplicateObject, RenameObject, SetParameter, SetTransform
from app.document.document import Document
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import SetCamera
from app.modes.deform.deform_messages import PrepareDeform
from app.modes.orbit.orbit_messages import PrepareOrbit
from app.modes.placement.placement_messages import ComputeTransport
from app.operators.registry import run_operator
from engine.scene.composition import SceneObject
from tests.app.fake_worker import FakeClient


def views(client: FakeClient) -> list[SetCamera]:
    return [each for each in client.requests if isinstance(each, SetCamera)]


def trace(client: FakeClient) -> None:
    """Answer the newest view, where one was asked for."""
    if views(client):
        client.see_scene()


def computed(client: FakeClient) -> set[str]:
    """The keys of the layers whose transport was asked for last."""
    asked = [each for each in client.requests if isinstance(each, ComputeTransport)]
    return {layer.key for layer in asked[-1].scene.layers}


def test_nothing_is_asked_of_new_objects_before_they_are_traced(settled: Editor, client: FakeClient) -> None:
    n_before = len(client.requests)
    settled.do(DuplicateObject("pot", "mug"))
    for now in (2.0, 2.1, 2.2):
        settled.tick(now)
    assert not any(isinstance(each, ComputeTransport) for each in client.requests[n_before:])
    assert views(client)[-1].composition[:2] == (SceneObject("pot", "pot"), SceneObject("mug", "pot"))
    client.see_scene()
    settled.tick(3.0)
    settled.tick(4.0)
    assert {"pot.0", "mug.0"} <= computed(client) and settled.scene_document.object("mug").source == "pot"


def test_a_new_object_may_be_selected_before_it_is_traced(settled: Editor, client: FakeClient) -> None:
    settled.do(SetView.of(n_bounces=2))
    settled.tick(2.0)
    settled.do(DuplicateObject("pot", "mug"))
    for path in ("mug", "mug.0", "mug.1.theta_h"):
        assert settled.select(path) is None
        settled.tick(2.1)
        assert not settled.status.is_error, settled.status.message
    client.see_scene()
    settled.tick(3.0)
    assert settled.view.selected is not None and settled.view.selected.path == "mug.1.theta_h"


@pytest.mark.parametrize(("mode", "kind"), [("orbit", PrepareOrbit), ("deform", PrepareDeform)])
def test_moving_pictures_are_prepared_of_the_traced_objects(
    settled: Editor, client: FakeClient, mode: str, kind: type[PrepareOrbit] | type[PrepareDeform]
) -> None:
    settled.do(SetView.of(mode=mode))
    settled.tick(2.0)
    settled.do(DuplicateObject("pot", "mug"))
    settled.do(DeleteObject("floor"))
    for now in (2.1, 2.2, 2.3):
        settled.tick(now)
    assert prepared(client, kind) == {"pot", "floor", "lamp"}
    client.see_scene()
    for now in (3.0, 4.0):
        settled.tick(now)
    assert prepared(client, kind) == {"pot", "mug", "lamp"}


def prepared(client: FakeClient, kind: type[PrepareOrbit] | type[PrepareDeform]) -> set[str]:
    """The objects of which pictures were prepared last."""
    state = client.sent(kind)[-1].scene
    return {name for name, _ in state.emission} | {layer.object for layer in state.layers}


def test_undo_before_the_answer_goes_on_as_before(settled: Editor, client: FakeClient) -> None:
    settled.do(DeleteObject("floor"))
    settled.tick(2.0)
    settled.undo()
    settled.tick(2.1)
    client.see_scene()
    for now in (2.2, 2.6, 3.0):
        settled.tick(now)
    assert views(client)[-1].composition is None
    client.see_scene()
    for now in (4.0, 5.0):
        settled.tick(now)
    assert not settled.status.is_away and "floor.0" in computed(client)


def test_objects_whose_trace_was_stopped_are_traced_when_work_goes_on(settled: Editor, client: FakeClient) -> None:
    settled.do(DuplicateObject("pot", "mug"))
    settled.tick(2.0)
    n_views, n_before = len(views(client)), len(client.requests)
    settled.cancel_work()
    settled.tick(2.5)
    settled.resume_work()
    for now in (3.0, 3.5):
        settled.tick(now)
    assert len(views(client)) == n_views + 1 and views(client)[-1].composition[1].name == "mug"
    # The mode, whose scene has no mug, asks for nothing before that.
    assert not any(isinstance(each, ComputeTransport) for each in client.requests[n_before:])
    client.see_scene()
    for now in (4.0, 5.0):
        settled.tick(now)
    assert "mug.0" in computed(client)


def test_another_object_is_selected_where_it_was_deleted(settled: Editor) -> None:
    settled.select("pot")
    assert run_operator(settled, "duplicate") is None
    assert settled.view.selected is not None and settled.view.selected.object == "pot 2"
    assert run_operator(settled, "delete_object") is None
    assert settled.view.selected is not None and settled.view.selected.object == "pot"


def test_selection_and_solo_follow_another_name(settled: Editor, client: FakeClient) -> None:
    settled.select("pot.1.theta_h")
    settled.do(SetView.of(solo="pot.1"))
    settled.do(RenameObject("pot", "mug"))
    assert settled.view.selected == ("mug", 1, "theta_h") and settled.view.solo == "mug.1"
    settled.undo()
    assert settled.view.selected == ("pot", 1, "theta_h") and settled.view.solo == "pot.1"
    settled.redo()
    settled.do(RenameObject("floor", "table"))  # another one
    assert settled.view.selected == ("mug", 1, "theta_h") and settled.view.solo == "mug.1"
    settled.do(DeleteObject("mug"))
    assert settled.view.selected is not None and settled.view.selected.object == "table"


def test_a_hidden_object_is_traced_without_its_surface_and_shown_again_as_before(
    settled: Editor, client: FakeClient
) -> None:
    settled.select("pot")
    assert run_operator(settled, "hide") is None and not settled.document.object("pot").visible
    settled.do(SetTransform("pot", (0.1, 0.0, 0.0)))  # no concern of the picture
    settled.tick(2.0)
    assert views(client)[-1].composition[0] == SceneObject("pot", "pot", is_hidden=True) and not views(client)[-1].poses
    # Shown again before the answer: the picture goes on.
    assert run_operator(settled, "hide") is None
    settled.undo()
    client.see_scene()
    for now in (3.0, 4.0):
        settled.tick(now)
    assert computed(client) == {"pot.0", "pot.1", "floor.0"} and not settled.status.is_error
    assert not any(layer.visible for layer in client.sent(ComputeTransport)[-1].scene.layers if layer.object == "pot")
    assert run_operator(settled, "show_all") is None and settled.undo_label == "show all objects"
    settled.tick(5.0)
    assert views(client)[-1].composition is None and views(client)[-1].poses
    client.see_scene()
    settled.tick(6.0)
    assert run_operator(settled, "show_all") == "hide an object first"


def test_a_comparison_with_other_objects_ends(settled: Editor) -> None:
    settled.do(SetView.of(compare=settled.document))
    settled.do(DeleteObject("floor"))
    settled.tick(2.0)
    assert settled.view.compare is None


@pytest.mark.parametrize("seed", range(6))
def test_any_sequence_of_objects_and_answers(settled: Editor, client: FakeClient, seed: int) -> None:
    """Whatever comes between: a mode is given documents with the objects of the traced scene alone, and all that was
    undone leaves the first document."""
    rng, now, first = random.Random(seed), 2.0, settled.document
    given: list[tuple[Document, object]] = []
    update = settled.controller.update

    def noted(at: float, document: Document, view: object) -> list:
        given.append((document, settled.scenes.tracing.composition))
        return update(at, document, view)

    settled.controller.update = noted
    for _ in range(40):
        now += rng.choice((0.01, 0.3))
        if not settled.document.objects:
            settled.undo()
            continue
        name = rng.choice([state.name for state in settled.document.objects])
        match rng.choice(("duplicate", "link", "edit", "delete", "move", "undo", "redo", "trace", "trace")):
            case "duplicate":
                settled.do(DuplicateObject(name))
            case "link":
                settled.do(DuplicateObject(name, linked=True))
            case "edit" if settled.document.object(name).layers:
                settled.do(SetParameter(f"{name}.0", "albedo", rng.random()))
            case "delete":
                settled.do(DeleteObject(name))
            case "move":
                settled.do(SetTransform(name, (rng.random(), 0.0, 0.0)))
            case "undo":
                settled.undo()
            case "redo":
                settled.redo()
            case "trace":
                trace(client)
        settled.tick(now)
    assert given and all(document.composition == traced for document, traced in given)
    while settled.undo() is not None:
        settled.tick(now := now + 0.3)
        trace(client)
    settled.tick(now + 1.0)
    assert settled.document == first
