"""The coarse shadows of what bends: against a sphere's in closed form, against those of rays, where there are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.realtime.zonal_harmonics.shading import CLUSTER_ROW, N_CLUSTERS, add_shadows
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import camera, placed

SIZE = (64, 48)
RADIUS, HEIGHT = 0.5, 0.8  # of the ball, and of its middle over the floor
WHITE = SkyState(constant_environment((1.0, 1.0, 1.0)))
MATT = make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)})


def sun() -> SkyState:
    sky = np.full((32, 64, 3), 0.1, np.float32)
    sky[5:7, 20:22] = 60.0
    return SkyState(Environment(sky, "sun"))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A ball over a floor."""
    path = Path(tmp_path_factory.mktemp("scene")) / "ball.toml"
    path.write_text(
        camera((0.5, 2.0, 4.0), 40, SIZE)
        + "[environment]\nradiance = [1, 1, 1]\n"
        + placed("ball", "sphere", f"1,0,0,0, 0,1,0,{HEIGHT}, 0,0,1,0, 0,0,0,1")
        + placed("floor", "quad", "3,0,0,0, 0,0,3,0, 0,-3,0,0, 0,0,0,1", "smooth = false\n")
    )
    return load_scene(path)


@pytest.fixture
def deform(scene: Scene) -> Deform:
    made = Deform(scene, n_points=1500, n_rays=100)
    made.set_layers({0: (MATT,), 1: (MATT,)})
    made.set_bounces(1)
    made.set_light(WHITE)
    return made


def share_left(made: Deform) -> np.ndarray:
    """Of white points' light."""
    subject, pictures = made._shading_state()
    places, frames = pictures.posed.at(())
    white = np.ones((len(frames), 3), np.float32)
    rows = pictures.blockers.rows(subject.casting_objects)
    normals = np.ascontiguousarray(frames[:, 2])
    add_shadows(rows, subject.casts, made._points, places, normals, subject.bands, white)
    return white[:, 0]


def test_a_ball_takes_what_its_cone_takes_of_an_even_light(deform: Deform) -> None:
    deform.set_bending(["ball"])
    left = share_left(finish_deform(deform))
    floor = deform._points.points_of(1)
    front = floor[deform._points.frames[floor, 2, 1] > 0.5]
    place = deform._points.places[front]
    square = place[:, 0] ** 2 + place[:, 2] ** 2 + (HEIGHT - place[:, 1]) ** 2
    truth = RADIUS**2 / square * (HEIGHT - place[:, 1]) / np.sqrt(square)  # sin^2 of its half angle, times the cosine
    is_whole = (HEIGHT - place[:, 1]) > RADIUS  # it stands above the horizon
    assert is_whole.all() and truth.max() > 0.35
    assert np.abs(1.0 - left[front] - truth).max() < 0.12
    assert np.abs(1.0 - left[front] - truth).mean() < 0.03
    assert left[front][truth < 0.002].min(initial=1.0) > 0.99


def test_it_shades_neither_itself_nor_backs_nor_twice(deform: Deform) -> None:
    deform.set_bending(["ball"])
    left = share_left(finish_deform(deform))
    floor = deform._points.points_of(1)
    backs = floor[deform._points.frames[floor, 2, 1] < -0.5]
    assert (left[deform._points.points_of(0)] == 1.0).all() and len(backs) and (left[backs] == 1.0).all()
    deform.set_bending([])
    assert (share_left(finish_deform(deform)) == 1.0).all()  # at rest its shadow is in the floor's transfer
    deform.set_bending(["ball"])
    assert (share_left(deform) == 1.0).all()  # and still is, until that is found anew


@pytest.mark.parametrize(("sky", "share"), [(WHITE, 0.2), (sun(), 0.6)], ids=["even", "sun"])
def test_the_floor_is_nearer_to_what_rays_find(deform: Deform, sky: SkyState, share: float) -> None:
    """The shadow of a sun is as dark on the whole, but wider."""
    deform.set_light(sky)
    eye = deform.scene.description.camera
    truth = finish_deform(deform).draw(eye, SIZE)
    deform.set_bending(["ball"])
    finish_deform(deform)
    coarse = deform.draw(eye, SIZE)
    subject, pictures = deform._shading_state()
    bare = pictures.draw(replace(subject, casters=(frozenset[int](),) * 2), eye, SIZE)
    is_floor = Placement(deform.scene).hits.object_image == 1
    errors = [(each - truth)[is_floor] for each in (coarse, bare)]
    off, was_off = (np.sqrt((each**2).mean()) for each in errors)
    assert off < share * was_off and abs(errors[0].mean()) < 0.3 * errors[1].mean()
    assert (coarse <= bare + 1e-6).all() and coarse.min() >= 0.0


def test_the_shadow_goes_along(deform: Deform) -> None:
    deform.set_bending(["ball"])
    finish_deform(deform)
    subject, pictures = deform._shading_state()
    for poses in ((), (("ball", (Deformation("bend", 90.0),)),)):
        places, _ = pictures.posed.at(poses)
        rows = pictures.blockers.rows(subject.casting_objects)
        assert rows.shape == (N_CLUSTERS, CLUSTER_ROW) and np.isfinite(rows).all()
        corners = places[deform._points.surface.corners[deform._points.surface.i_object == 0]].astype(np.float64)
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
        middle = (areas[:, None] * corners.mean(axis=1)).sum(axis=0) / areas.sum()
        found = (rows[:, 3:4] * rows[:, :3]).sum(axis=0) / rows[:, 3].sum()
        assert found == pytest.approx(middle, abs=0.02) and rows[:, 3].sum() == pytest.approx(areas.sum(), rel=0.05)


def test_without_anything_that_casts_there_is_no_row(deform: Deform) -> None:
    subject, pictures = finish_deform(deform)._shading_state()
    bare = replace(subject, casters=())
    assert bare.casts.shape == (2, 0) and np.isfinite(pictures.draw(bare, deform.scene.description.camera, SIZE)).all()
