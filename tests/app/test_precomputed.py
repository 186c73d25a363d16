"""`insitu precompute` leaves the editor nothing to do."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from app.cli.precompute import precompute
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from app.files.session import save_session
from app.project.project import open_project
from app.worker import indirect_tasks
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.precompute.indirect.sampling_settings import ROUGH
from engine.precompute.indirect.solver import Solver
from tests.scene_text import camera, environment, facing_up, material, placed, scaled

SCENE = (
    camera((0, 0.6, 3), resolution=(24, 16), target=(0, 0.4, 0))
    + environment(0.5)
    + placed("floor", "quad", facing_up(2), material('model = "lambert", albedo = [0.6, 0.5, 0.4]'))
    + placed("ball", "sphere", scaled(0.8, (0, 0.4, 0)), material('model = "rough_conductor", alpha = 0.3'))
)


class CountingStore(ArrayCache):
    """Counts what is kept in it, which is all that takes long."""

    kept = 0

    def put(self, key, arrays):
        self.kept += 1
        return super().put(key, arrays)


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(indirect_tasks, "FINE", replace(ROUGH, name="fine"))  # quicker, and as good for this
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


def session_of(scene: Path) -> Path:
    """With another number of lights than a scene has, other bounces, and another size."""
    document = open_project(str(scene)).document
    view = SetView.of(n_lights=600, n_bounces=2, resolution=(20, 16)).apply(ViewState())
    return save_session(scene.with_suffix(".insitu"), document, view)


@pytest.mark.parametrize("is_session", [False, True])
def test_it_leaves_the_editor_nothing_to_do(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_session: bool
) -> None:
    file = str(session_of(scene) if is_session else scene)
    store = CountingStore(tmp_path / "cache")
    precompute(open_project(file), lambda progress: None, store=store)
    assert store.kept == 5  # visibility, two layers' transport and its unit, their indirect light
    monkeypatch.setattr(Solver, "solve", lambda *arguments: pytest.fail("indirect light is found once more"))
    client = InProcessClient(RequestDispatcher(store))
    editor = Editor(client, file)
    for _ in range(10_000):
        editor.tick(time.monotonic())
        if editor.scene_is_open and editor.controller.indirect.is_complete and not client.wait(0.0):
            break
    assert editor.controller._transport.delivered_final and editor.controller.indirect.picture.is_shown
    assert store.kept == 5
    editor.close()
