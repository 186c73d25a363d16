"""Deform from a scene file to pictures, as the worker serves it; and what its talk asks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app import stills
from app.commands import AddDeformer, SetDeformer
from app.deform.messages import DeformKnown, DrawDeform, PrepareDeform, Traced
from app.deform.talk import DeformTalk
from app.jobs.deform import DeformWork
from app.jobs.in_process import InProcessClient
from app.jobs.tasks import Tasks
from app.messages import LookFrom, OpenScene, Response
from app.mode import OpenedScene
from app.orbit.messages import DrawOrbit, OrbitAdvanced, OrbitDrawn, OrbitUnknown, PrepareOrbit
from app.project import open_project
from app.scene_state import scene_state
from app.stills import render_project
from engine.deform.pose import Deformation
from engine.indirect.series import BounceSeries
from tests.app.orbit.test_talk import Table
from tests.scene_text import camera, placed

POSES = (("box", (Deformation("bend", 60.0),)),)
SIZE = (24, 18)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(DeformWork, "n_rays", 16)
    monkeypatch.setattr("engine.deform.live.N_POINTS", 60)
    path = tmp_path / "box.toml"
    sky = "[environment]\nradiance = [1, 2, 3]\n"
    layers = 'layer = [{ model = "lambert" }, { model = "rough_conductor" }]\n'
    path.write_text(camera((1.5, 1.2, 3.0), 40, SIZE) + sky + placed("box", "cube", more=layers))
    return path


def answers(client: InProcessClient) -> list[Response]:
    return client.poll(budget_s=float("inf"))


def test_a_scene_is_made_ready_once_and_drawn_in_any_pose(file: Path) -> None:
    client = InProcessClient(Tasks())
    client.send(LookFrom(client.send(OpenScene(str(file)))))
    answers(client)
    project = open_project(str(file))
    eye, scene = project.scene.description.camera, scene_state(project.document)
    client.send(DrawDeform(eye, SIZE, "moving"))
    assert isinstance(answers(client)[0], OrbitUnknown)
    prepared = client.send(PrepareDeform(scene, 1, ("box",)))
    told = answers(client)
    known = [each for each in told if isinstance(each, OrbitAdvanced)]
    assert known[-1].is_done and not known[0].is_done and known[-1].n_bytes
    (lost,) = [each.lost for each in told if isinstance(each, DeformKnown)]
    assert [name for name, _ in lost] == ["box"] and 0.0 < lost[0][1] < 1.0
    pictures = []
    for poses in ((), POSES):
        client.send(DrawDeform(eye, SIZE, "rest", poses))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitDrawn)]
        assert drawn.prepared == prepared and drawn.is_done and drawn.radiance.shape == (*SIZE[::-1], 3)
        pictures.append(drawn.radiance)
    assert np.abs(pictures[0] - pictures[1]).max() > 0.1
    # Seen in a pose by the other modes, it is the same scene at rest to this one.
    client.send(LookFrom(client.send(OpenScene(str(file))), poses=POSES))
    answers(client)
    client.send(PrepareDeform(scene, 1, ("box",)))
    assert [each.is_done for each in answers(client) if isinstance(each, OrbitAdvanced)][-1]
    client.send(DrawDeform(eye, SIZE, "rest", POSES))
    (again,) = [each for each in answers(client) if isinstance(each, OrbitDrawn)]
    assert again.radiance == pytest.approx(pictures[1], abs=1e-4)


def test_a_split_picture_is_traced_pass_by_pass(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.deform.truth.N_PASSES", 2)
    client = InProcessClient(Tasks())
    client.send(LookFrom(client.send(OpenScene(str(file)))))
    answers(client)
    project = open_project(str(file))
    eye, scene = project.scene.description.camera, scene_state(project.document)
    prepare = PrepareDeform(scene, 1, ("box",), Traced(eye, SIZE, POSES))
    client.send(prepare)
    versions = [each.version for each in answers(client) if isinstance(each, OrbitAdvanced) and each.is_done]
    assert len(set(versions)) == 3  # ready, and two passes
    pictures = []
    for split, poses in ((None, POSES), ((0.5, 0.5), POSES), ((0.5, 0.5), ())):
        client.send(DrawDeform(eye, SIZE, "moving", poses, split))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitDrawn)]
        pictures.append(drawn.radiance)
    whole, parted, other = pictures
    assert np.array_equal(parted[:, 12:], whole[:, 12:])
    # The sky is the same on both sides; where another pose than was traced is asked for, it waits in the dark.
    assert parted[0, 0] == pytest.approx(whole[0, 0], rel=1e-3) and other[0, 0] == pytest.approx(0.2 * whole[0, 0])
    client.send(prepare)  # nothing is traced a second time
    assert len({each.version for each in answers(client) if isinstance(each, OrbitAdvanced)}) == 1


def test_what_is_split_and_rests_is_traced_and_not_handed_over() -> None:
    table = Table()
    talk = DeformTalk(table)
    table.talk = talk
    talk.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    table.view = replace(table.view, split=(0.3, 0.6))
    (asked,) = table.update()
    assert isinstance(asked, PrepareDeform) and asked.traced is not None and asked.traced.poses == ()
    talk.take(OrbitAdvanced(1, True, id=table.id_of(PrepareDeform)))
    (drawn,) = [each for each in table.update() if isinstance(each, DrawDeform)]
    assert drawn.split == (0.3, 0.6)
    take_picture(table)
    for _ in range(3):
        table.now += 1.0
        table.update()
    assert not talk.hands_over
    table.view = replace(table.view, split=None)
    (asked,) = [each for each in table.update() if isinstance(each, PrepareDeform)]
    assert asked.traced is None


def test_a_hand_that_bends_has_one_picture_a_frame_and_nothing_made_ready_anew() -> None:
    table = Table()
    talk = DeformTalk(table)
    table.talk = talk
    talk.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    (first,) = table.update()
    assert isinstance(first, PrepareDeform) and first.posed == ()
    name = table.document.objects[0].name
    table.history.do(AddDeformer(name, "bend"))
    (second,) = table.update()
    assert isinstance(second, PrepareDeform) and second.posed == (name,)  # it is about to bend: its shadows are its own
    talk.take(OrbitAdvanced(1, True, id=table.id_of(PrepareDeform)))
    assert [type(each) for each in table.update()] == [DrawDeform]
    take_picture(table)
    table.history.begin_drag()
    for amount in (10.0, 20.0):
        table.history.do(SetDeformer(name, 0, amount=amount))
        (asked,) = table.update()
        assert isinstance(asked, DrawDeform) and asked.poses == ((name, (Deformation("bend", amount),)),)
        take_picture(table)
    assert not any(isinstance(each, PrepareOrbit | DrawOrbit) for each in table.sent)


def take_picture(table: Table) -> None:
    """The worker's answer to the newest picture asked for."""
    radiance, prepared = np.ones((2, 2, 3), np.float32), table.id_of(PrepareDeform)
    table.talk.take(OrbitDrawn(radiance, prepared, 1, True, 0.01, id=table.id_of(DrawDeform)))


def test_a_still_is_of_the_pose_that_is_set(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "DEFORM_RAYS", 16)
    at_rest = open_project(str(file)).scene
    for values, poses in ((), ()), ([("box.bend", 60.0)], POSES):
        project = open_project(str(file), values=values)
        assert project.document.poses == poses and np.array_equal(project.resting.vertices, at_rest.vertices)
        pictures = [
            render_project(project, lambda _: None, series=BounceSeries(1), **way).picture
            for way in ({"mode": "deform"}, {"reference": True, "n_samples": 8})
        ]
        covered = [np.abs(each - each[0, 0]).sum(axis=2) > 0.0 for each in pictures]
        assert (covered[0] != covered[1]).mean() < 0.08  # but for the silhouette
