"""The camera is part of the view: what of it is asked of the worker, and when."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.poses import SetTransform
from app.document.view_state import Bookmark, SetView, Viewpoint
from app.editor.editor import Editor
from app.editor.view_controller import REST_SECONDS
from app.files.bookmarks import add_bookmark
from app.files.journal import Journal
from app.files.session import load_session, save_session
from app.messages.picture_events import SceneFrame
from app.messages.worker_messages import CancelRequests, OpenScene, RequestFailed, SetCamera
from app.modes.placement.placement_messages import ComputeTransport
from app.project.project import open_project
from engine.core.errors import InsituError
from engine.scene.description import Camera
from engine.scene.ground_boxes import find_ground_boxes
from engine.scene.loaders.model import ImportedCamera
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
    assert isinstance(look, SetCamera) and look.camera == ASIDE and look.resolution is None
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
    assert [type(request) for request in client.requests] == [SetCamera]


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
    assert [look.camera for look in client.sent(SetCamera)] == [ASIDE, ABOVE]


@pytest.mark.parametrize("end", [RequestFailed("shelf: no memory for it"), CancelRequests()])
def test_a_look_that_is_refused_or_stopped_leaves_the_view_before(editor: Editor, client: FakeClient, end) -> None:
    move(editor, ASIDE, 2.0)
    editor.tick(3.0)
    if isinstance(end, RequestFailed):
        client.answer(client.sent(SetCamera)[-1], end)
    else:
        editor.cancel_work()
    editor.tick(3.1)
    assert editor.view.camera is None and editor.status.picture != "preview"
    editor.do(SetParameter("pot.1", "alpha", 0.5))  # it goes on from there
    editor.tick(4.0)
    editor.tick(5.0)
    assert len(client.sent(ComputeTransport)) == 1 and len(client.sent(SetCamera)) == 1


def test_a_pose_that_was_stopped_is_traced_when_work_goes_on(editor: Editor, client: FakeClient) -> None:
    editor.do(SetTransform("pot", (1.0, 0.0, 0.0)))
    for now in (2.0, 3.0):
        editor.tick(now)
    assert len(client.sent(SetCamera)) == 1
    editor.cancel_work()
    for now in (4.0, 5.0):
        editor.tick(now)
    assert len(client.sent(SetCamera)) == 1 and editor.document.poses  # the pose is an edit, and stays
    editor.resume_work()
    for now in (6.0, 7.0):
        editor.tick(now)
    again = client.sent(SetCamera)
    assert len(again) == 2 and again[1].poses == again[0].poses == editor.document.poses
    client.see_scene()
    editor.tick(8.0)
    assert not editor.scenes.tracing.is_away


def test_a_session_has_its_camera(editor: Editor, tmp_path: Path) -> None:
    path = save_session(tmp_path / "a.insitu", editor.document, SetView.of(camera=ASIDE).apply(editor.view))
    assert load_session(path).view.camera == ASIDE
    plain = save_session(tmp_path / "b.insitu", editor.document, editor.view)
    assert load_session(plain).view.camera is None


def test_a_session_opens_with_its_camera(editor: Editor, client: FakeClient, tmp_path: Path) -> None:
    view = SetView.of(camera=ASIDE, resolution=(20, 10)).apply(editor.view)
    editor.open(str(save_session(tmp_path / "a.insitu", editor.document, view)))
    (look,) = client.sent(SetCamera)
    assert (look.scene, look.camera, look.resolution) == (client.sent(OpenScene)[0].id, ASIDE, (20, 10))
    client.open_scene()
    (frame,) = editor.tick(2.0)
    assert isinstance(frame, SceneFrame) and frame.description.camera.position == ASIDE.position
    assert editor.view.viewpoint == (ASIDE, (20, 10))
    editor.tick(3.0)
    assert len(client.sent(SetCamera)) == 1  # it is the one that was asked for
    editor.open("shelf")
    client.open_scene()
    editor.tick(4.0)
    assert editor.view.viewpoint == (None, None)  # another scene has another first camera


def test_commands_take_the_camera_from_a_session(tmp_path: Path) -> None:
    editor = Editor(FakeClient(), "teatray")
    project = open_project("teatray", (16, 12))
    view = SetView.of(camera=ASIDE).apply(editor.view)
    path = save_session(tmp_path / "a.insitu", project.document, view)
    kept_view = Bookmark("Above", Viewpoint(ABOVE, (20, 10)))
    view = SetView.of(bookmarks=(kept_view,)).apply(view)
    path = save_session(tmp_path / "a.insitu", project.document, view)
    above = open_project(str(path), camera="Above").scene
    assert above.description.camera.position == ABOVE.position and above.resolution == (20, 10)
    with pytest.raises(InsituError, match="no view 'Below'; saved views: Above"):
        open_project(str(path), camera="Below")
    with pytest.raises(InsituError, match="no view 'Above'; saved views: none yet"):
        open_project("teatray", (16, 12), camera="Above")
    seen = open_project(str(path), (16, 12)).scene
    assert seen.description.camera.position == ASIDE.position and seen.description.camera.fov_y == 30.0


def looking(editor: Editor, camera: Camera | None, label: str = "orbit") -> None:
    editor.camera_history.set_viewpoint(Viewpoint(camera), label)


def test_the_view_has_an_undo_of_its_own(editor: Editor) -> None:
    editor.do(SetParameter("pot.1", "alpha", 0.5))
    edited = editor.document
    looking(editor, ASIDE)
    editor.camera_history.begin_drag("pan")
    for step in range(4):
        looking(editor, ABOVE.model_copy(update={"fov_y": 30.0 + step}))
    editor.camera_history.end_drag()
    for notch in (0.9, 0.8):  # one turn of the wheel
        editor.camera_history.set_viewpoint(
            Viewpoint(ABOVE.model_copy(update={"fov_y": 30.0 * notch})), "dolly", "wheel 1"
        )
    assert [editor.camera_history.undo(), editor.view.viewpoint] == [
        "dolly",
        (ABOVE.model_copy(update={"fov_y": 33.0}), None),
    ]
    assert [editor.camera_history.undo(), editor.view.viewpoint] == ["pan", (ASIDE, None)]
    assert [editor.camera_history.undo(), editor.camera_history.undo(), editor.view.viewpoint] == [
        "orbit",
        None,
        (None, None),
    ]
    assert editor.document is edited and editor.history.undo_label is not None
    assert editor.camera_history.redo() == "orbit" and editor.view.camera == ASIDE
    editor.undo()
    assert editor.view.camera == ASIDE and editor.camera_history.redo() == "pan"  # the document's undo leaves it alone


def test_a_drag_of_the_camera_that_is_cancelled_leaves_no_step(editor: Editor, client: FakeClient) -> None:
    editor.camera_history.begin_drag("orbit")
    looking(editor, ASIDE)
    editor.cancel_drag()
    editor.tick(2.0)
    assert editor.view.camera is None and editor.camera_history.undo() is None and client.sent(SetCamera) == []


def test_the_scenes_own_camera_is_no_other_one(editor: Editor) -> None:
    looking(editor, editor.camera_history.own_camera)
    assert editor.view.camera is None and editor.camera_history.undo() is None
    looking(editor, ASIDE)
    editor.camera_history.set_viewpoint(Viewpoint(editor.camera_history.own_camera, (8, 6)), "reset")
    assert editor.view.viewpoint == (None, None)


def test_a_refused_look_leaves_no_step_and_a_hand_that_moved_on_its_view(editor: Editor, client: FakeClient) -> None:
    looking(editor, ASIDE)
    editor.tick(2.0)
    editor.tick(3.0)
    assert editor.status.is_away
    client.answer(client.sent(SetCamera)[-1], RequestFailed("shelf: no memory for it"))
    editor.tick(3.1)
    assert editor.view.camera is None and editor.camera_history.undo() is None and not editor.status.is_away
    looking(editor, ASIDE)
    editor.tick(4.0)
    editor.tick(5.0)
    looking(editor, ABOVE)  # before the answer comes
    client.answer(client.sent(SetCamera)[-1], RequestFailed("shelf: no memory for it"))
    editor.tick(5.1)
    assert editor.view.camera == ABOVE
    editor.tick(6.0)
    assert client.sent(SetCamera)[-1].camera == ABOVE


def test_another_scene_begins_with_no_steps(editor: Editor, client: FakeClient) -> None:
    looking(editor, ASIDE)
    editor.do(SetView.of(bookmarks=add_bookmark((), editor.view.viewpoint)))
    editor.open("shelf")
    client.open_scene()
    editor.tick(4.0)
    assert editor.camera_history.undo() is None and editor.view.bookmarks == ()


def test_a_kept_view_is_worth_a_question_and_a_journal(client: FakeClient, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    editor = Editor(client, "shelf", journal=journal)
    client.open_scene()
    editor.tick(0.0)
    assert not editor.session.is_unsaved
    looking(editor, ASIDE)
    assert not editor.session.is_unsaved  # to look around is no edit
    editor.do(SetView.of(bookmarks=add_bookmark((), editor.view.viewpoint)))
    assert editor.session.is_unsaved
    editor.tick(1.0)
    assert editor.save(tmp_path / "a.insitu") is None and not editor.session.is_unsaved
    editor.do(SetView.of(bookmarks=add_bookmark(editor.view.bookmarks, editor.view.viewpoint, "Two")))
    editor.tick(2.0)
    editor.close()
    assert [each.name for each in load_session(journal.path).view.bookmarks] == ["View 1", "Two"]


def test_a_view_of_more_pixels_than_there_is_memory_is_refused(editor: Editor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.system.memory.memory_bytes", lambda: (2**33, 2**33))
    refusal = editor.camera_history.set_viewpoint(Viewpoint(ASIDE, (16384, 16384)), "a saved view")
    assert refusal is not None and "8.0 GiB are free; choose fewer" in refusal
    assert editor.view.viewpoint == (None, None) and editor.camera_history.undo() is None


def test_boxes_of_objects_are_framed(editor: Editor, client: FakeClient) -> None:
    boxes = np.array([[[-1, -1, -1], [1, 1, 1]], [[-5, -1, -5], [5, -1, 5]], [[np.nan] * 3] * 2])
    editor.open("shelf")
    client.open_scene(boxes=boxes)
    editor.tick(2.0)
    assert editor.camera_history.box_of("pot").tolist() == boxes[0].tolist()
    assert editor.camera_history.box_of("floor").tolist() == boxes[1].tolist()
    assert editor.camera_history.box_of(None).tolist() == boxes[0].tolist()  # what stands on the floor
    editor.do(SetVisible("pot", False))
    assert editor.camera_history.box_of(None).tolist() == boxes[1].tolist()  # the floor is all there is
    editor.undo()
    with pytest.raises(InsituError, match="'lamp'.*pot, floor"):  # it has no surface
        editor.camera_history.box_of("lamp")


POT, TRAY, LAMP = [[-1, 0, -1], [1, 2, 1]], [[-1.5, -0.1, -1.5], [1.5, 0, 1.5]], [[3, 5, 3], [3.5, 5.5, 3.5]]
FLOOR, WALL, SIDE = [[-9, 0, -9], [9, 0, 9]], [[-9, 0, -9], [9, 9, -8.9]], [[-9, 0, -9], [-8.9, 9, 9]]
LOW_CEILING, CUBE_WALL = [[-2, 2.1, -2], [1.5, 2.2, 1.5]], [[-1.5, 0, -1.5], [-1.4, 3, 1.5]]


@pytest.mark.parametrize(
    ("boxes", "grounds"),
    [
        ([POT], []),
        ([FLOOR], []),
        ([FLOOR, WALL], []),
        ([POT, FLOOR], [1]),
        ([POT, TRAY], []),
        ([FLOOR, WALL, SIDE, POT], [0, 1, 2]),
        ([POT, LOW_CEILING, CUBE_WALL], []),
        ([[[0, 0, 0], [0, 0, 0]], POT], []),
    ],
)
def test_what_all_stand_on_or_before_is_no_part_of_all(boxes: list[object], grounds: list[int]) -> None:
    assert np.flatnonzero(find_ground_boxes(np.array(boxes, np.float64))).tolist() == grounds


def test_lamps_are_no_part_of_all(editor: Editor, client: FakeClient) -> None:
    boxes = np.array([POT, FLOOR, LAMP], np.float64)
    editor.open("shelf")
    client.open_scene(boxes=boxes)
    editor.tick(2.0)
    assert [state.emits for state in editor.document.objects] == [False, False, True]
    assert editor.camera_history.box_of(None).tolist() == POT
    assert editor.camera_history.box_of("lamp").tolist() == LAMP


def test_cameras_of_a_file_are_saved_views_of_its_scene(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene(cameras=(ImportedCamera("Above", ABOVE, 2.0), ImportedCamera("Aside", ASIDE)))
    editor.tick(0.0)
    views = {each.name: each.viewpoint for each in editor.view.bookmarks}
    assert list(views) == ["Above", "Aside"] and views["Aside"] == Viewpoint(ASIDE)
    assert not editor.session.is_unsaved
    editor.camera_history.set_viewpoint(views["Aside"], "Aside")
    assert editor.view.camera == ASIDE
