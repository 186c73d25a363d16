"""Shadow catchers that Deform draws while lamps are dragged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.scene_state import scene_state
from app.document.shadow_catchers import CatchersAlone, moving_catchers
from app.document.view_state import ViewState
from app.messages.worker_messages import OpenScene, SetCamera
from app.modes.deform.deform_drawing import DeformDrawing
from app.modes.deform.deform_messages import DrawDeform, PrepareDeform
from app.modes.orbit.orbit_messages import OrbitPictureDrawn
from app.project.project import open_project
from app.worker.deform_worker import DeformWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.transform import Transform
from tests.app.test_deform import SIZE, answers
from tests.scene_text import LAMBERT, camera, facing_up, placed, scaled


def test_a_dragged_lamp_moves_the_shadow_on_a_catcher_without_another_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(DeformWorker, "n_points", 400)
    path = tmp_path / "caught.toml"
    path.write_text(
        camera((0.0, 1.5, 4.0), 40, SIZE)
        + placed("floor", "quad", facing_up(3), LAMBERT)
        + placed("ball", "sphere", scaled(0.8, (0.0, 0.5, 0.0)), LAMBERT)
        + placed("lamp", "sphere", scaled(0.3, (0.0, 2.5, 0.0)), "emission = [20, 20, 20]\n")
    )
    project = open_project(str(path), values=[("floor.shadow_catcher", True)])
    eye, document = project.scene.description.camera, project.document
    there = (("lamp", (Transform((0.8, 0.0, 0.0)),)),)
    alone = moving_catchers(document, ViewState())
    assert alone is not None
    alone = alone.with_posed_lamps()
    # It stays as the lamp is moved.
    moved = replace(document.object("lamp"), transform=there[0][1][0])
    also = moving_catchers(document.with_object(moved), ViewState())
    assert also is not None and also.with_posed_lamps() == alone

    def client_of() -> tuple[InProcessClient, RequestDispatcher]:
        tasks = RequestDispatcher()
        client = InProcessClient(tasks)
        client.send(SetCamera(client.send(OpenScene(str(path)))))
        answers(client)
        return client, tasks

    def prepare(client: InProcessClient, lamps: Poses) -> None:
        client.send(PrepareDeform(scene_state(document), 1, n_rays=200, lamps=lamps, catchers=alone))
        answers(client)

    def picture(client: InProcessClient, poses: Poses) -> np.ndarray:
        client.send(DrawDeform(eye, SIZE, "rest", poses))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
        assert drawn.are_caught
        return drawn.radiance

    client, tasks = client_of()
    prepare(client, ())
    (worker,) = [each for each in tasks._workers if isinstance(each, DeformWorker)]
    engine = worker._catchers.engine
    at_rest, dragged = picture(client, ()), picture(client, there)
    prepare(client, there)
    released = picture(client, there)
    assert worker._catchers.engine is engine
    fresh, _ = client_of()
    prepare(fresh, there)
    assert released == pytest.approx(picture(fresh, there), rel=1e-3, abs=1e-4)
    error = np.abs(dragged - released).mean()
    assert error < 0.3 * np.abs(at_rest - released).mean()  # few rays while it moves


def test_a_catcher_that_was_moved_is_an_object_in_deform(tmp_path: Path) -> None:
    # Of the shadow of others a moved floor has one share everywhere, which is none to be caught.
    path = tmp_path / "caught.toml"
    path.write_text(
        camera((0.0, 1.5, 4.0), 40, SIZE)
        + "[environment]\nradiance = [1, 1, 1]\n"
        + placed("floor", "quad", facing_up(6), LAMBERT)
        + placed("ball", "sphere", scaled(0.8, (0.0, 0.42, 0.0)), LAMBERT)
    )
    document, view = open_project(str(path), values=[("floor.shadow_catcher", True)]).document, ViewState(mode="deform")

    def catchers(name: str, transform: Transform) -> CatchersAlone | None:
        drawing = DeformDrawing()
        drawing.scene_opened()
        moved = document.with_object(replace(document.object(name), transform=transform))
        found = drawing.desired_state(moved, view).catchers
        # A graphics card draws moving pictures where nothing is caught.
        assert drawing._catches == (found is not None)
        return found

    assert catchers("floor", Transform((0.3, 0.0, 0.0))) is None
    assert catchers("floor", Transform()) is not None and catchers("ball", Transform((0.3, 0.0, 0.0))) is not None
