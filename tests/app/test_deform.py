"""Deform from a scene file to pictures, as the worker serves it; and what its talk asks."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import AddDeformer, MoveObject, SetDeformer, SetSurface, SetTime
from app.document.document import Document
from app.document.scene_state import scene_state
from app.messages.editor_status import Status
from app.messages.worker_messages import OpenScene, RequestFailed, Response, SetCamera
from app.modes.deform.deform_controller import DeformController
from app.modes.deform.deform_events import PoseArrived
from app.modes.deform.deform_messages import (
    DeformLoss,
    DrawDeform,
    GlossDecided,
    PathPreview,
    PathsTraced,
    PoseExported,
    PrepareDeform,
)
from app.modes.mode import OpenedScene
from app.modes.orbit.orbit_messages import DrawOrbit, OrbitNotReady, OrbitPictureDrawn, OrbitProgress, PrepareOrbit
from app.project.project import open_project
from app.stills import stills
from app.stills.stills import render_project
from app.worker.deform_worker import DeformWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.realtime.core.gpu_parts import NO_PARTS, PictureExport, PosedPart
from engine.realtime.zonal_harmonics import patches
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.render.error_estimate import interior_points
from engine.scene.rig import Animation
from engine.scene.surface_kinds import DeformSurface
from engine.scene.transform import Transform
from tests.app.modes.orbit.test_orbit_controller import Table
from tests.few_points import use_few_points
from tests.pictures import write_exr
from tests.scene_text import LAMBERT, camera, environment, facing_up, material, placed, scaled

POSES = (("box", (Deformation("bend", 60.0),)),)
SIZE = (24, 18)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(DeformWorker, "n_rays", 16)
    monkeypatch.setattr("engine.realtime.zonal_harmonics.deform_engine.N_POINTS", 60)
    path = tmp_path / "box.toml"
    path.write_text(
        camera((1.5, 1.2, 3.0), 40, SIZE)
        + environment((1, 2, 3))
        + placed("box", "cube", more=material('model = "lambert"', 'model = "rough_conductor"'))
    )
    return path


def answers(client: InProcessClient) -> list[Response]:
    return client.poll(budget_s=float("inf"))


def test_a_scene_is_made_ready_once_and_drawn_in_any_pose(file: Path) -> None:
    client = InProcessClient(RequestDispatcher())
    client.send(SetCamera(client.send(OpenScene(str(file)))))
    answers(client)
    project = open_project(str(file))
    eye, scene = project.scene.description.camera, scene_state(project.document)
    client.send(DrawDeform(eye, SIZE, "moving"))
    assert isinstance(answers(client)[0], OrbitNotReady)
    prepared = client.send(PrepareDeform(scene, 1, ("box",)))
    told = answers(client)
    known = [each for each in told if isinstance(each, OrbitProgress)]
    assert known[-1].is_done and not known[0].is_done and known[-1].n_bytes
    (lost,) = [each.lost for each in told if isinstance(each, DeformLoss)]
    assert [name for name, _ in lost] == ["box"] and 0.0 < lost[0][1] < 1.0
    (plans,) = [each.plans for each in told if isinstance(each, GlossDecided)]
    assert [each.key for each in plans] == ["box.1"] and "at a pilot's points" in plans[0].reason
    assert (plans[0].n_bytes > 0) == (plans[0].value != "one lobe")
    pictures = []
    for poses in ((), POSES):
        client.send(DrawDeform(eye, SIZE, "rest", poses))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
        assert drawn.prepared == prepared and drawn.is_done and drawn.radiance.shape == (*SIZE[::-1], 3)
        pictures.append(drawn.radiance)
    assert np.abs(pictures[0] - pictures[1]).max() > 0.1
    # Seen in a pose by the other modes, it is the same scene at rest to this one.
    client.send(SetCamera(client.send(OpenScene(str(file))), poses=POSES))
    answers(client)
    client.send(PrepareDeform(scene, 1, ("box",)))
    assert [each.is_done for each in answers(client) if isinstance(each, OrbitProgress)][-1]
    client.send(DrawDeform(eye, SIZE, "rest", POSES))
    (again,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
    assert again.radiance == pytest.approx(pictures[1], abs=1e-4)


def test_a_window_that_draws_is_sent_what_moves_and_the_rest_once(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(patches.PATTERNS, "bumps", partial(patches.bumps, 8))
    client = InProcessClient(RequestDispatcher())
    client.send(SetCamera(client.send(OpenScene(str(file)))))
    answers(client)
    project = open_project(str(file))
    eye, scene = project.scene.description.camera, scene_state(project.document)
    client.send(PrepareDeform(scene, 1, ("box",)))
    answers(client)
    known, sent = NO_PARTS, []
    for poses in ((), POSES):
        client.send(DrawDeform(eye, SIZE, "moving", poses, sent_parts=known))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
        assert isinstance(drawn, PoseExported) and drawn.is_done and not drawn.radiance.size
        sent.append(drawn.export)
        known = sent[0].numbers
    assert not any((sent[1].shape, sent[1].appearance, sent[1].cover, sent[1].backdrop))
    assert np.abs(sent[1].posed.places - sent[0].posed.places).max() > 0.1
    # What lies between points is told as it is looked up.
    grooves = DeformSurface.model_validate({"patch": {"kind": "bumps"}})
    client.send(PrepareDeform(scene, 1, ("box",), (("box", grooves),)))
    answers(client)
    client.send(DrawDeform(eye, SIZE, "moving", POSES, sent_parts=known))
    (drawn,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
    assert isinstance(drawn, PoseExported) and drawn.export.cover.lobes.size and len(drawn.export.appearance.terms) == 2


def test_a_moving_picture_is_the_windows_where_it_draws_and_one_at_rest_the_workers() -> None:
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    controller.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    controller.draw_in_window(1 << 27)
    table.update()
    controller.receive(OrbitProgress(1, False, id=table.id_of(PrepareDeform)))
    (asked,) = [each for each in table.update() if isinstance(each, DrawDeform)]
    assert (asked.quality, asked.sent_parts) == ("moving", NO_PARTS)
    pose = PosedPart(*(np.zeros((0, n), np.float32) for n in (12, 9, 14, 3)), (0.0, 0.0, 0.0))
    told, radiance = PictureExport(pose, (3, 4, 5, 6), None, None, None, None), np.zeros((0, 0, 3), np.float32)
    (came,) = controller.receive(PoseExported(radiance, 1, 1, False, 0.01, export=told, id=table.id_of(DrawDeform)))
    assert isinstance(came, PoseArrived) and came.export is told and came.resolution == asked.resolution
    controller.receive(OrbitProgress(2, False, id=table.id_of(PrepareDeform)))
    table.now += 0.1
    (asked,) = [each for each in table.update() if isinstance(each, DrawDeform)]
    assert asked.sent_parts == (3, 4, 5, 6)  # before the window has drawn them
    controller.receive(PoseExported(radiance, 1, 2, False, 0.01, export=told, id=table.id_of(DrawDeform)))
    controller.resend_parts((3, 0, 0, 0))  # which it could not
    (asked,) = [each for each in table.update() if isinstance(each, DrawDeform)]
    assert asked.sent_parts == (3, 0, 0, 0)
    controller.receive(PoseExported(radiance, 1, 2, False, 0.01, export=told, id=table.id_of(DrawDeform)))
    controller.receive(OrbitProgress(3, True, id=table.id_of(PrepareDeform)))
    table.now += 1.0
    (asked,) = [each for each in table.update() if isinstance(each, DrawDeform)]
    assert (asked.quality, asked.sent_parts) == ("rest", None)


def test_a_split_picture_is_traced_pass_by_pass(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.realtime.stills.N_PASSES", 2)
    client = InProcessClient(RequestDispatcher())
    client.send(SetCamera(client.send(OpenScene(str(file)))))
    answers(client)
    project = open_project(str(file))
    eye, scene = project.scene.description.camera, scene_state(project.document)
    prepare = PrepareDeform(scene, 1, ("box",), traced=PathPreview(eye, SIZE, POSES))
    client.send(prepare)
    told = answers(client)
    versions = [each.version for each in told if isinstance(each, OrbitProgress) and each.is_done]
    assert len(set(versions)) == 3  # ready, and two passes
    assert [(each.n_passes, each.of) for each in told if isinstance(each, PathsTraced)] == [(0, 2), (1, 2), (2, 2)]
    pictures = []
    for split, poses in ((None, POSES), ((0.5, 0.5), POSES), ((0.5, 0.5), ())):
        client.send(DrawDeform(eye, SIZE, "moving", poses, split))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
        pictures.append(drawn.radiance)
    whole, parted, other = pictures
    assert np.array_equal(parted[:, 12:], whole[:, 12:])
    # The sky is the same on both sides; where another pose than was traced is asked for, it waits in the dark.
    assert parted[0, 0] == pytest.approx(whole[0, 0], rel=1e-3) and other[0, 0] == pytest.approx(0.2 * whole[0, 0])
    client.send(prepare)  # nothing is traced a second time
    assert len({each.version for each in answers(client) if isinstance(each, OrbitProgress)}) == 1


def test_what_is_split_and_rests_is_traced_and_not_handed_over() -> None:
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    controller.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    table.view = replace(table.view, split=(0.3, 0.6))
    (asked,) = table.update()
    assert isinstance(asked, PrepareDeform) and asked.traced is not None and asked.traced.poses == ()
    controller.receive(OrbitProgress(1, True, id=table.id_of(PrepareDeform)))
    (drawn,) = [each for each in table.update() if isinstance(each, DrawDeform)]
    assert drawn.split == (0.3, 0.6)
    take_picture(table)
    for _ in range(3):
        table.now += 1.0
        table.update()
    assert not controller.is_placement_active
    for n_passes, picture in ((0, "refining"), (31, "refining"), (32, "finished")):
        controller.receive(PathsTraced(n_passes, 32, id=table.id_of(PrepareDeform)))
        status = controller.status(Status())
        assert status.picture == picture and controller.is_running == (n_passes < 32)
        assert f"{n_passes / 32:.0%}" in status.missing_note or picture == "finished"
    table.view = replace(table.view, split=None)
    (asked,) = [each for each in table.update() if isinstance(each, PrepareDeform)]
    assert asked.traced is None


def test_a_hand_that_bends_has_one_picture_a_frame_and_nothing_made_ready_anew() -> None:
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    controller.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    (first,) = table.update()
    assert isinstance(first, PrepareDeform) and first.posed == ()
    name = table.document.objects[0].name
    table.history.do(AddDeformer(name, "bend"))
    (second,) = table.update()
    assert isinstance(second, PrepareDeform) and second.posed == (name,)  # it is about to bend: its shadows are its own
    controller.receive(OrbitProgress(1, True, id=table.id_of(PrepareDeform)))
    assert [type(each) for each in table.update()] == [DrawDeform]
    take_picture(table)
    table.history.begin_drag()
    for amount in (10.0, 20.0):
        table.history.do(SetDeformer(name, 0, amount=amount))
        (asked,) = table.update()
        assert isinstance(asked, DrawDeform) and asked.poses == ((name, (Deformation("bend", amount),)),)
        assert not controller.shows_viewpoint  # what is selected has no outline over the pose of before
        take_picture(table)
        assert controller.shows_viewpoint
    assert not any(isinstance(each, PrepareOrbit | DrawOrbit) for each in table.sent)


@pytest.mark.parametrize("catches", [False, True])
def test_a_hand_that_drags_a_lamp_has_one_picture_a_frame_and_its_rays_at_rest(catches: bool) -> None:
    """Each picture has the lamp where its poses say; what rays are to find of it is asked once it rests."""
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    name = table.document.objects[0].name
    lamp = replace(table.document.object(name), layers=(), emission=(1.0, 1.0, 1.0))
    other = replace(table.document.objects[1], shadow_catcher=catches)
    table.history.document = document = table.document.with_object(lamp).with_object(other)
    controller.scene_opened(OpenedScene(1, (), table.description, document, document))
    table.update()
    controller.receive(OrbitProgress(1, True, id=table.id_of(PrepareDeform)))
    table.update()
    take_picture(table)
    table.now += 1.0
    table.history.begin_drag()
    for step in range(1, 4):
        table.history.do(MoveObject(name, (0.1, 0.0, 0.0)))
        (asked,) = table.update()
        assert isinstance(asked, DrawDeform) and asked.quality == "moving"
        ((moved, (transform,)),) = asked.poses
        assert moved == name and isinstance(transform, Transform)
        assert transform.translation == pytest.approx((0.1 * step, 0.0, 0.0))
        take_picture(table)
    table.history.end_drag()
    table.now += 1.0
    (asked, *_) = table.update()
    assert isinstance(asked, PrepareDeform) and asked.lamps == ((name, (transform,)),)
    assert (asked.catchers is not None) == catches
    assert asked.posed == asked.moved == ()


def test_what_only_has_an_animation_rests_among_the_others_until_it_plays() -> None:
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    table.history.document = document = animated(table.document)
    controller.scene_opened(OpenedScene(1, (), table.description, document, document))
    table.update()
    posed = [table.sent[-1].posed]
    for view, command in (({"playing": 0.2}, None), ({"playing": None}, None), ({}, SetTime(0.4)), ({}, SetTime(None))):
        table.view = replace(table.view, **view)
        if command:
            table.history.do(command)
        table.update()
        posed.append([each for each in table.sent if isinstance(each, PrepareDeform)][-1].posed)
    assert posed == [(), (NAME,), (), (NAME,), ()]


NAME = "teapot"


def animated(document: Document) -> Document:
    return document.with_object(replace(document.object(NAME), animations=(Animation("flap", 1.2),)))


def test_a_surface_is_the_documents_and_deforms_alone() -> None:
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    controller.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    table.update()
    table.history.do(SetSurface(NAME, "membrane"))
    (asked,) = table.update()
    assert asked.surfaces == ((NAME, DeformSurface.model_validate({"membrane": {"translucency": 0.5}})),)
    controller.receive(OrbitProgress(1, True, id=table.id_of(PrepareDeform)))
    table.now += 1.0
    table.update()
    take_picture(table)
    table.update()
    status = controller.status(Status())
    assert status.deform_only == (NAME,) and status.picture == "finished" and not controller.is_placement_active
    assert NAME in status.no_estimate_reason  # nobody finds out where it is off
    table.view = replace(table.view, split=(0.3, 0.6))
    table.history.do(SetSurface(NAME, ""))
    table.update()
    assert "beside path-traced parts" in controller.status(Status()).no_estimate_reason
    table.view = replace(table.view, split=None)
    table.update()
    assert not controller.status(Status()).no_estimate_reason


def test_an_image_that_cannot_be_read_leaves_the_document_and_the_picture_as_they_were() -> None:
    """As if it had never been chosen, where that was the last step; else what was there takes its place."""
    table = Table()
    controller = DeformController(table)
    table.controller = controller
    controller.scene_opened(OpenedScene(1, (), table.description, table.document, table.document))
    table.history.do(SetSurface(NAME, "membrane"))
    table.update()
    controller.receive(OrbitProgress(1, True, id=table.id_of(PrepareDeform)))
    table.update()
    before, steps = table.history.document, len(table.history.undo_steps)
    for goes_on in (False, True):
        table.history.do(SetSurface(NAME, "membrane", (("translucency", "leaf.png"),)))
        table.update()
        if goes_on:
            table.history.do(AddDeformer(NAME, "bend"))
        controller.receive(RequestFailed("leaf.png: broken", id=table.id_of(PrepareDeform)))
        assert table.history.document.object(NAME).surface == before.object(NAME).surface
        assert len(table.history.undo_steps) == steps + (3 if goes_on else 0)
        (asked,) = [each for each in table.update() if isinstance(each, PrepareDeform)]  # it does not stand still
        assert asked.surfaces == before.new_surfaces


def test_a_scene_goes_on_as_it_was_where_an_image_is_broken(file: Path, tmp_path: Path) -> None:
    client = InProcessClient(RequestDispatcher())
    client.send(SetCamera(client.send(OpenScene(str(file)))))
    answers(client)
    scene = scene_state(open_project(str(file)).document)
    (tmp_path / "leaf.png").write_bytes(b"no image")
    for name in ("leaf.png", str(tmp_path / "none.png")):
        says = DeformSurface.model_validate({"patch": {"file": name}})
        client.send(PrepareDeform(scene, 1, (), (("box", says),)))
        (failed,) = [each for each in answers(client) if isinstance(each, RequestFailed)]
        assert Path(name).name in failed.line and "\n" not in failed.line and "nothing was changed" in failed.line
    client.send(PrepareDeform(scene, 1))
    assert [each.is_done for each in answers(client) if isinstance(each, OrbitProgress)][-1]


def test_the_error_of_the_fit_is_a_picture_of_its_own_and_a_membrane_has_none(file: Path) -> None:
    client = InProcessClient(RequestDispatcher())
    client.send(SetCamera(client.send(OpenScene(str(file)))))
    answers(client)
    project = open_project(str(file))
    eye, scene = project.scene.description.camera, scene_state(project.document)
    pictures = []
    for surfaces in ((), SetSurface("box", "membrane").apply(project.document).new_surfaces):
        client.send(PrepareDeform(scene, 1, (), surfaces))
        answers(client)
        client.send(DrawDeform(eye, SIZE, "moving", fit_error=True))
        (drawn,) = [each for each in answers(client) if isinstance(each, OrbitPictureDrawn)]
        pictures.append(drawn.radiance)
    fitted, exact = pictures
    assert fitted.max() > 0.0 and (fitted[..., 0] == fitted[..., 2]).all() and not exact.any()


def take_picture(table: Table) -> None:
    """The worker's answer to the newest picture asked for."""
    radiance, prepared = np.ones((2, 2, 3), np.float32), table.id_of(PrepareDeform)
    table.controller.receive(OrbitPictureDrawn(radiance, prepared, 1, True, 0.01, id=table.id_of(DrawDeform)))


def test_a_still_is_of_the_pose_that_is_set(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "STILL_SETTINGS", replace(stills.STILL_SETTINGS, n_rays=16))
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


def standing(folder: Path, more: str = "") -> Path:
    """A box that stands on a floor, under a sky that is bright straight above."""
    sky = np.full((16, 32, 3), 0.05, np.float32)
    sky[:3] = 5.0
    write_exr(folder / "sky.exr", sky)
    path = folder / "standing.toml"
    path.write_text(
        camera((0.0, 2.5, 5.0), 40, (36, 27))
        + environment(file="sky.exr")
        + placed("box", "cube", scaled(0.5, (0, 0.9, 0)), LAMBERT + more)
        + placed("floor", "quad", facing_up(4), LAMBERT)
    )
    return path


def test_a_still_of_a_pose_has_the_shadows_between_objects_and_tells_what_it_is_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its shadow the floor beneath the box was 1.6 times too bright, and nobody told."""
    use_few_points(monkeypatch)
    monkeypatch.setattr(stills, "REFERENCE_LEVEL", stills.REFERENCE_LEVEL - 1)  # the sky has 16 rows
    project = open_project(str(standing(tmp_path)), values=[("box.taper", 0.6)])
    series = BounceSeries(1)
    still = render_project(project, lambda _: None, series=series, mode="deform", estimates_error=True)
    truth = render_project(project, lambda _: None, series=series, reference=True).picture
    hits = Placement(project.scene).hits
    is_floor = hits.object_image == 1
    beneath = is_floor & (truth.mean(axis=2) < 0.75 * np.percentile(truth[is_floor], 90.0))
    assert beneath.sum() > 15
    assert still.picture[beneath].mean() == pytest.approx(truth[beneath].mean(), rel=0.1)
    shown = hits.pixel[interior_points(hits)]
    picture, truth = (each.reshape(-1, 3)[shown] for each in (still.picture, truth))
    off = np.sqrt(((picture - truth) ** 2).mean()) / truth.mean()
    assert still.error is not None and still.error.overall == pytest.approx(off, rel=0.7, abs=0.01)


def test_a_still_of_what_deform_alone_knows_says_that_nobody_knows_how_far_it_is_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_few_points(monkeypatch, n_rays=16)
    project = open_project(str(standing(tmp_path, "deform = { membrane = { translucency = 0.5 } }\n")), (12, 9))
    still = render_project(project, lambda _: None, series=BounceSeries(1), mode="deform", estimates_error=True)
    assert still.error is None and "does not support the surface of box" in still.warning
