"""The camera is part of the view: what of it is asked of the worker, and when."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands import SetParameter
from app.editor import Editor
from app.jobs.messages import Cancel, Failed, LookFrom, OpenScene
from app.looking import REST_SECONDS
from app.picture import SceneFrame
from app.placement.messages import ComputeTransport
from app.project import open_project
from app.session import load_session, save_session
from app.view_state import SetView
from engine.scene.description import Camera
from tests.app.fake_worker import FakeClient

ASIDE = Camera(position=(3.0, 1.0, 2.0), target=(0.0, 0.0, 0.0), fov_y=30.0)
ABOVE = Camera(position=(0.0, 5.0, 1.0), target=(0.0, 0.0, 0.0))


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """An editor at time 1 with all of its picture delivered."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    client.requests.clear()
    return editor


def move(editor: Editor, camera: Camera | None, now: float) -> None:
    editor.do(SetView.of(camera=camera))
    editor.tick(now)


def test_a_camera_that_moves_is_traced_once_it_rests(editor: Editor, client: FakeClient) -> None:
    document = editor.document
    for step in range(5):
        move(editor, ABOVE.model_copy(update={"fov_y": 30.0 + step}), 2.0 + 0.8 * REST_SECONDS * step)
    move(editor, ASIDE, 3.0)
    assert client.requests == [] and editor.status.picture == "preview"  # what is seen is of another view
    editor.tick(3.0 + REST_SECONDS)
    (look,) = client.requests
    assert isinstance(look, LookFrom) and look.camera == ASIDE and look.resolution is None
    client.see_scene()
    (frame,) = editor.tick(3.5)
    assert isinstance(frame, SceneFrame) and frame.description.camera.position == ASIDE.position
    assert frame.description.camera.resolution == (8, 6)
    editor.tick(4.0)
    assert len(client.sent(ComputeTransport)) == 1 and client.sent(OpenScene) == []
    assert editor.document is document and editor.view.camera == ASIDE


def test_a_released_hand_need_not_rest(editor: Editor, client: FakeClient) -> None:
    editor.begin_drag()
    move(editor, ASIDE, 2.0)
    editor.end_drag()
    editor.tick(2.01)
    assert [type(request) for request in client.requests] == [LookFrom]


def test_a_camera_that_comes_back_asks_for_nothing(editor: Editor, client: FakeClient) -> None:
    move(editor, ASIDE, 2.0)
    move(editor, None, 2.1)
    editor.tick(3.0)
    assert client.requests == [] and editor.status.picture != "preview"


def test_a_camera_that_moved_on_is_not_thrown_back(editor: Editor, client: FakeClient) -> None:
    move(editor, ASIDE, 2.0)
    editor.tick(3.0)
    move(editor, ABOVE, 3.1)
    client.see_scene()
    (frame,) = editor.tick(3.2)
    assert isinstance(frame, SceneFrame) and frame.description.camera.position == ASIDE.position
    assert editor.view.camera == ABOVE
    editor.tick(4.0)
    assert [look.camera for look in client.sent(LookFrom)] == [ASIDE, ABOVE]


@pytest.mark.parametrize("end", [Failed("shelf: camera = sees no surface"), Cancel()])
def test_a_look_that_is_refused_or_stopped_leaves_the_view_before(editor: Editor, client: FakeClient, end) -> None:
    move(editor, ASIDE, 2.0)
    editor.tick(3.0)
    if isinstance(end, Failed):
        client.answer(client.sent(LookFrom)[-1], end)
    else:
        editor.cancel_work()
    editor.tick(3.1)
    assert editor.view.camera is None and editor.status.picture != "preview"
    editor.do(SetParameter("pot.1", "alpha", 0.5))  # it goes on from there
    editor.tick(4.0)
    editor.tick(5.0)
    assert len(client.sent(ComputeTransport)) == 1 and len(client.sent(LookFrom)) == 1


def test_a_session_has_its_camera(editor: Editor, tmp_path: Path) -> None:
    path = save_session(tmp_path / "a.insitu", editor.document, SetView.of(camera=ASIDE).apply(editor.view))
    assert load_session(path).view.camera == ASIDE
    plain = save_session(tmp_path / "b.insitu", editor.document, editor.view)
    assert load_session(plain).view.camera is None


def test_a_session_opens_with_its_camera(editor: Editor, client: FakeClient, tmp_path: Path) -> None:
    view = SetView.of(camera=ASIDE, resolution=(20, 10)).apply(editor.view)
    editor.open(str(save_session(tmp_path / "a.insitu", editor.document, view)))
    (look,) = client.sent(LookFrom)
    assert (look.scene, look.camera, look.resolution) == (client.sent(OpenScene)[0].id, ASIDE, (20, 10))
    client.open_scene()
    (frame,) = editor.tick(2.0)
    assert isinstance(frame, SceneFrame) and frame.description.camera.position == ASIDE.position
    assert editor.view.look == (ASIDE, (20, 10))
    editor.tick(3.0)
    assert len(client.sent(LookFrom)) == 1  # it is the one that was asked for
    editor.open("shelf")
    client.open_scene()
    editor.tick(4.0)
    assert editor.view.look == (None, None)  # another scene has another first camera


def test_commands_take_the_camera_from_a_session(tmp_path: Path) -> None:
    editor = Editor(FakeClient(), "teatray")
    project = open_project("teatray", (16, 12))
    view = SetView.of(camera=ASIDE).apply(editor.view)
    path = save_session(tmp_path / "a.insitu", project.document, view)
    seen = open_project(str(path), (16, 12)).scene
    assert seen.description.camera.position == ASIDE.position and seen.description.camera.fov_y == 30.0
