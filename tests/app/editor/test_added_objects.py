"""Objects that are added in an editor: they wait for the worker, and what cannot be read or traced is taken back."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands import AddObject, DeleteObject, DuplicateObject, RenameObject, SetTransform
from app.document.commands.layers import SetParameter, SetVisible
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.session import save_session
from app.messages.file_messages import ObjectsRead, ReadObjects
from app.messages.worker_messages import OpenScene, RequestFailed, SetCamera
from app.operators.arrange import Addition
from app.operators.registry import run_operator
from engine.scene.added_objects import AddedObject
from engine.scene.composition import SceneObject
from engine.scene.description import ObjectDescription
from engine.scene.object_meshes import GREY
from tests.app.fake_worker import FakeClient

BOX = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 1.0]])


def read(what: str, name: str = "", mesh: str | None = None) -> AddedObject:
    shape: dict[str, Any] = {"primitive": "sphere"} if mesh is None else {"mesh": mesh, "part": 0}
    source = ObjectDescription(name=name or what, **shape)
    return AddedObject(source, source.model_copy(update={"layers": GREY}), BOX)


def answer(client: FakeClient, *objects: AddedObject) -> None:
    """Answer the newest request for objects."""
    client.answer(client.sent(ReadObjects)[-1], ObjectsRead(objects, ("a note",)))


def absent(editor: Editor) -> list[str]:
    return [state.name for state in editor.document.absent]


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


@pytest.mark.parametrize("ends", ["let go", "give up", "undo"])
def test_objects_that_come_during_a_drag_are_no_part_of_it(settled: Editor, client: FakeClient, ends: str) -> None:
    settled.do(AddObject("box"))
    settled.begin_drag("move pot")
    settled.do(SetTransform("pot", (0.1, 0.0, 0.0)))
    answer(client, read("box"))
    settled.tick(2.0)
    assert names(settled) == ["pot", "floor", "lamp"] and settled.exchange.is_reading
    settled.do(SetTransform("pot", (0.2, 0.0, 0.0)))
    {"let go": settled.end_drag, "give up": settled.cancel_drag, "undo": settled.undo}[ends]()
    assert names(settled) == ["pot", "floor", "lamp", "box"] and not settled.exchange.is_reading
    assert settled.document.object("pot").transform.translation[0] == (0.2 if ends == "let go" else 0.0)
    assert settled.undo() == "add box" and names(settled) == ["pot", "floor", "lamp"]
    assert settled.undo() == ("move pot" if ends == "let go" else None)


def test_a_file_that_cannot_be_read_adds_nothing(settled: Editor, client: FakeClient) -> None:
    before = settled.document
    settled.do(AddObject("/models/cup.glb"))
    client.answer(client.sent(ReadObjects)[-1], RequestFailed("/models/cup.glb: not a GLB"))
    settled.tick(2.0)
    assert settled.document is before and settled.undo_label is None and not settled.exchange.is_reading
    assert settled.status.is_error and settled.status.message == "/models/cup.glb: not a GLB"


def test_what_cannot_be_traced_waits_for_its_file_in_all_of_the_history(settled: Editor, client: FakeClient) -> None:
    """Its file has gone between the two; what was added with it is not taken along."""
    settled.do(AddObject("/models/cup.glb"))
    cup = read("cup", mesh="/models/cup.glb")
    answer(client, cup)
    settled.tick(2.0)
    settled.do(DuplicateObject("cup"))
    settled.do(SetParameter("cup 2.0", "albedo", (0.1, 0.2, 0.3)))
    settled.do(DuplicateObject("pot", "mug"))
    settled.tick(2.5)
    client.see_scene(cup.source)
    settled.tick(3.0)
    assert names(settled) == ["pot", "mug", "floor", "lamp"] and absent(settled) == ["cup", "cup 2"]
    assert settled.status.is_error and settled.status.message.startswith("/models/cup.glb: no such file; its objects")
    # The mode goes on with what is left.
    assert [each.name for each in client.sent(SetCamera)[-1].composition or ()] == names(settled)
    client.see_scene()
    settled.tick(4.0)
    assert settled.scenes.opened is not None
    assert [state.name for state in settled.scenes.opened.document.objects] == names(settled)
    assert settled.scenes.reload() is None
    assert client.sent(OpenScene)[-1].added == (cup.source,)
    client.open_scene(added=(cup,))
    settled.tick(5.0)
    client.see_scene()
    settled.tick(5.5)
    assert sorted(names(settled)) == ["cup", "cup 2", "floor", "lamp", "mug", "pot"] and not absent(settled)
    assert dict(settled.document.layer("cup 2.0").parameters)["albedo"] == (0.1, 0.2, 0.3)
    labels = [settled.undo() for _ in range(5)]
    assert labels == ["duplicate pot", "cup 2.0 albedo", "duplicate cup", "add cup.glb", None]
    assert names(settled) == ["pot", "floor", "lamp"] and not absent(settled)


def test_a_session_reads_its_added_objects_again(settled: Editor, client: FakeClient, tmp_path: Path) -> None:
    settled.do(AddObject("sphere"))
    answer(client, ball := read("sphere"))
    settled.tick(2.0)
    path = save_session(tmp_path / "with.insitu", settled.document, ViewState())
    for can_be_read in (True, False):
        settled.open(str(path))
        assert client.sent(OpenScene)[-1].added == (ball.source,)
        client.open_scene(added=(ball,) if can_be_read else ())
        # The view that is asked for at once has all that the session has; another one is where something is missing.
        n_views = len(client.sent(SetCamera))
        assert [each.name for each in client.sent(SetCamera)[-1].composition] == ["pot", "floor", "lamp", "sphere"]
        settled.tick(3.0)
        assert len(client.sent(SetCamera)) == n_views + (not can_be_read)
        client.see_scene()
        settled.tick(3.1)
        assert len(client.sent(SetCamera)) == n_views + (not can_be_read)
        assert names(settled) == ["pot", "floor", "lamp", *(["sphere"] if can_be_read else [])]
        assert absent(settled) == ([] if can_be_read else ["sphere"])


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


@pytest.mark.parametrize("seed", range(12))
def test_any_sequence_of_additions_and_answers(settled: Editor, client: FakeClient, seed: int) -> None:
    """Whatever comes between: names differ, pictures are asked of what the document has, and undo leads back."""
    rng, now, first = random.Random(seed), 2.0, settled.document
    for _ in range(40):
        now += rng.choice((0.01, 0.3))
        kinds = ("add", "read", "fail", "delete", "duplicate", "rename", "hide", "drag", "drop", "gone", "undo", "redo")
        step = rng.choice((*kinds, "trace", "trace", "trace"))
        if not names(settled) and step in ("delete", "duplicate", "rename", "hide", "drag"):
            continue
        match step:
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
            case "rename":
                settled.do(RenameObject(rng.choice(names(settled)), f"name {rng.randrange(4)}"))
            case "hide":
                name = rng.choice(names(settled))
                settled.do(SetVisible(name, not settled.document.object(name).visible))
            case "drag":
                settled.begin_drag()
                settled.do(SetTransform(rng.choice(names(settled)), (rng.random(), 0.0, 0.0)))
            case "drop":
                settled.end_drag() if rng.random() < 0.5 else settled.cancel_drag()
            case "gone" if client.sent(SetCamera) and (sources := settled.document.added_sources):
                there = [each.source for each in client.sent(SetCamera)[-1].composition]
                client.see_scene(*(each for each in sources[:1] if each in there))
            case "undo":
                settled.undo()
            case "redo":
                settled.redo()
            case "trace" if client.sent(SetCamera):
                client.see_scene()
        settled.tick(now)
        assert len(set(names(settled))) == len(names(settled))
        selected = settled.view.selected
        assert selected is None or selected.object in names(settled)
    settled.end_drag()
    while settled.undo() is not None:
        settled.tick(now := now + 0.3)
        if client.sent(SetCamera):
            client.see_scene()
    settled.tick(now + 1.0)
    assert settled.document == first and isinstance(settled.scenes.opened.document.objects, tuple)
