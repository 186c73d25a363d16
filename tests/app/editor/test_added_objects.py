"""Objects that are added in an editor: they wait for the worker, and what cannot be read or traced is taken back."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import AddObject, DeleteObject, DuplicateObject
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.session import save_session
from app.messages.worker_messages import ObjectsRead, OpenScene, ReadObjects, RequestFailed, SetCamera
from app.operators.arrange import Addition
from app.operators.registry import run_operator
from engine.scene.added_objects import AddedObject
from engine.scene.composition import SceneObject
from engine.scene.description import ObjectDescription
from engine.scene.object_meshes import GREY
from tests.app.fake_worker import FakeClient

BOX = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 1.0]])


def read(what: str, name: str = "") -> AddedObject:
    source = ObjectDescription(name=name or what, primitive="sphere")
    return AddedObject(source, source.model_copy(update={"layers": GREY}), BOX)


def answer(client: FakeClient, *objects: AddedObject) -> None:
    """Answer the newest request for objects."""
    client.answer(client.sent(ReadObjects)[-1], ObjectsRead(objects, ("a note",)))


def names(editor: Editor) -> list[str]:
    return [state.name for state in editor.document.objects]


def test_a_shape_is_added_once_it_is_read_and_traced(settled: Editor, client: FakeClient) -> None:
    addition = Addition(shape="sphere", name="ball", at=(1.0, 0.0, 0.0), size=0.2)
    assert run_operator(settled, "add", addition) is None
    (request,) = client.sent(ReadObjects)
    assert (request.what, request.at, request.size) == ("sphere", (1.0, 0.0, 0.0), 0.2)
    assert settled.exchange.is_reading and names(settled) == ["pot", "floor", "lamp"]
    answer(client, ball := read("sphere"))
    for now in (2.0, 2.1):
        settled.tick(now)
    assert names(settled) == ["pot", "floor", "lamp", "ball"] and not settled.exchange.is_reading
    assert settled.view.selected is not None and settled.view.selected.object == "ball"
    assert client.sent(SetCamera)[-1].composition[-1] == SceneObject("ball", ball.source)
    assert np.array_equal(settled.camera_history.box_of("ball"), BOX)
    client.see_scene()
    settled.tick(3.0)
    # The scene's own document has it as it was read, so that its values can be put back.
    assert settled.scene_document.object("ball").layers == settled.document.object("ball").layers
    assert settled.undo() == "add sphere" and names(settled) == ["pot", "floor", "lamp"]
    settled.redo()
    settled.tick(4.0)
    client.see_scene()
    settled.tick(5.0)
    assert settled.scene_document.object("ball").added == ball.source


def test_additions_at_once_all_come(settled: Editor, client: FakeClient) -> None:
    for shape in ("box", "cone"):
        run_operator(settled, f"add_{shape}")
    # One after the other: a newer request would replace the one before it.
    for shape in ("box", "cone"):
        assert client.sent(ReadObjects)[-1].what == shape
        answer(client, read(shape))
        settled.tick(2.0)
    assert names(settled) == ["pot", "floor", "lamp", "box", "cone"] and not settled.exchange.is_reading


def test_a_file_that_cannot_be_read_adds_nothing(settled: Editor, client: FakeClient) -> None:
    before = settled.document
    settled.do(AddObject("/models/cup.glb"))
    client.answer(client.sent(ReadObjects)[-1], RequestFailed("/models/cup.glb: not a GLB"))
    settled.tick(2.0)
    assert settled.document is before and settled.undo_label is None and not settled.exchange.is_reading
    assert settled.status.is_error and settled.status.message == "/models/cup.glb: not a GLB"


def test_what_cannot_be_traced_is_taken_back_for_good(settled: Editor, client: FakeClient) -> None:
    """Its file has gone between the two."""
    settled.do(AddObject("/models/cup.glb"))
    answer(client, read("cup"))
    settled.tick(2.0)
    settled.do(DuplicateObject("cup"))
    settled.do(DuplicateObject("pot", "mug"))
    settled.tick(2.5)
    client.answer(client.sent(SetCamera)[-1], RequestFailed("/models/cup.glb: no such file"))
    settled.tick(3.0)
    assert names(settled) == ["pot", "mug", "floor", "lamp"]
    assert settled.status.is_error and settled.status.message == "/models/cup.glb: no such file"
    settled.tick(4.0)
    assert all(each.name != "cup" for each in client.sent(SetCamera)[-1].composition)
    client.see_scene()
    settled.tick(5.0)
    assert settled.undo() == "duplicate pot" and settled.undo_label is None
    assert names(settled) == ["pot", "floor", "lamp"]


def test_a_session_reads_its_added_objects_again(settled: Editor, client: FakeClient, tmp_path: Path) -> None:
    settled.do(AddObject("sphere"))
    answer(client, ball := read("sphere"))
    settled.tick(2.0)
    path = save_session(tmp_path / "with.insitu", settled.document, ViewState())
    for can_be_read in (True, False):
        settled.open(str(path))
        assert client.sent(OpenScene)[-1].added == (ball.source,)
        client.open_scene(added=(ball,) if can_be_read else ())
        settled.tick(3.0)
        assert names(settled) == ["pot", "floor", "lamp", *(["sphere"] if can_be_read else [])]
        assert [each.name for each in settled.document.absent] == ([] if can_be_read else ["sphere"])


def test_files_read_again_keep_added_objects_and_those_that_redo_brings(settled: Editor, client: FakeClient) -> None:
    for name in ("sphere", "cone"):
        settled.do(AddObject(name))
        answer(client, read(name))
        settled.tick(2.0)
    settled.undo()
    assert settled.scenes.reload() is None
    assert [each.name for each in client.sent(OpenScene)[-1].added] == ["sphere", "cone"]
    client.open_scene(added=(read("sphere"), read("cone")))
    settled.tick(3.0)
    assert names(settled) == ["pot", "floor", "lamp", "sphere"]
    settled.redo()
    assert names(settled) == ["pot", "floor", "lamp", "sphere", "cone"]


@pytest.mark.parametrize("seed", range(4))
def test_any_sequence_of_additions_and_answers(settled: Editor, client: FakeClient, seed: int) -> None:
    """Whatever comes between: names differ, pictures are asked of what the document has, and undo leads back."""
    rng, now, first = random.Random(seed), 2.0, settled.document
    for _ in range(40):
        now += rng.choice((0.01, 0.3))
        match rng.choice(("add", "read", "fail", "delete", "duplicate", "undo", "redo", "trace", "trace")):
            case "add":
                settled.do(AddObject("box"))
            case "read" if settled.exchange.is_reading:
                answer(client, read("box", f"box {rng.randrange(3)}"))
            case "fail" if settled.exchange.is_reading:
                client.answer(client.sent(ReadObjects)[-1], RequestFailed("no"))
            case "delete":
                settled.do(DeleteObject(rng.choice(names(settled))))
            case "duplicate":
                settled.do(DuplicateObject(rng.choice(names(settled))))
            case "undo":
                settled.undo()
            case "redo":
                settled.redo()
            case "trace" if client.sent(SetCamera):
                client.see_scene()
        settled.tick(now)
        assert len(set(names(settled))) == len(names(settled)) >= 1
    while settled.undo() is not None:
        settled.tick(now := now + 0.3)
        if client.sent(SetCamera):
            client.see_scene()
    settled.tick(now + 1.0)
    assert settled.document == first and isinstance(settled.scenes.opened.document.objects, tuple)
