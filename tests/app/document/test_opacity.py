"""Opacity as an edit: by path, with undo, in sessions, and what the worker traces for it."""

from pathlib import Path

import pytest

from app.document.commands.maps import SetOpacity
from app.document.targets import resolve
from app.document.view_state import ViewState
from app.files.session import save_session
from app.messages.worker_messages import OpenScene, SetCamera, ViewTraced
from app.project.project import open_project
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError
from engine.material.opacity import Opacity
from tests.scene_text import LAMBERT, camera, placed


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene of a card that a cutoff leaves out, before a wall."""
    own = 'smooth = false\nopacity = { mode = "mask", factor = 0.4 }\n' + LAMBERT
    wall = placed("wall", "quad", "4,0,0,0, 0,4,0,0, 0,0,1,-1, 0,0,0,1", LAMBERT)
    (tmp_path / "scene.toml").write_text(camera((0, 0, 5), 10, (6, 6)) + placed("card", "quad", "", own) + wall)
    return tmp_path / "scene.toml"


def test_a_path_sets_what_a_still_shows(scene: Path) -> None:
    own = open_project(str(scene))
    assert own.document.object("card").opacity == Opacity("mask", 0.5, 0.4) and own.scene.cutouts.passable.any()
    lower = open_project(str(scene), values=[("card.opacity_cutoff", 0.3)])
    assert lower.scene.description.objects[0].opacity == Opacity("mask", 0.3, 0.4)
    assert not lower.scene.cutouts.passable.any() and resolve(lower.document, "card.opacity_mode").kind == "opacity"
    back = lower.edited(own.document, ViewState().viewpoint)
    assert back.scene.cutouts.passable.any()
    for path, value in (("card.opacity_mode", "glass"), ("card.opacity_cutoff", 2), ("card.opacity_map", "gone.png")):
        with pytest.raises(InsituError, match=r"opaque|0 to 1|gone\.png"):
            open_project(str(scene), values=[("card.opacity_mode", "mask"), (path, value)])


def test_sessions_keep_what_differs_from_the_scene(scene: Path) -> None:
    document = open_project(str(scene)).document
    path = scene.parent / "a.insitu"
    changed = SetOpacity("card", "opacity_mode", "blend").apply(document)
    assert changed.new_opacities == (("card", Opacity("blend", 0.5, 0.4)),)
    save_session(path, changed, ViewState())
    assert open_project(str(path)).document == changed
    again = SetOpacity("card", "opacity_mode", "mask").apply(changed)
    assert again == document and again.new_opacities == ()


def test_the_worker_traces_what_is_there(scene: Path) -> None:
    client = InProcessClient(RequestDispatcher())
    id = client.send(OpenScene(str(scene)))
    seen = []
    for opacities in ((), (("card", Opacity("mask", 0.3, 0.4)),), ()):
        client.send(SetCamera(id, opacities=opacities, n_edge_rays=0))
        traced: list[ViewTraced] = []
        while not traced:
            traced = [each for each in client.poll(0.1) if isinstance(each, ViewTraced)]
        seen.append(int(traced[-1].frame.object_image[3, 3]))
    assert seen == [1, 0, 1]  # the wall, the card, the wall
