"""Shadows of bending objects at rest, by rays: closed forms, a slow twin, and paths."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import Environment
from engine.light.triangle_lights import cut_lights
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.stills import PathReference
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.realtime.zonal_harmonics.picture_renderer import Quality
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.realtime.zonal_harmonics.posed_shadows import N_LIGHTS, blocked_light
from tests.engine.realtime.conftest import icosphere
from tests.engine.realtime.zonal_harmonics.test_deform_engine import SIZE, seen
from tests.engine.realtime.zonal_harmonics.test_neighbours import FLOOR, GREY, WHITE_SKY, made
from tests.scene_text import facing_up, placed, scaled

CENTRE = (0.0, 0.5, 0.0)  # of a ball of radius 0.5
BENT: Poses = (("ball", (Deformation("bend", 20.0),)),)


def side_lit() -> SkyState:
    """A bright window on one side of a grey sky."""
    radiance = np.full((32, 64, 3), 0.2, np.float32)
    radiance[8:16, 6:14] = 12.0
    return SkyState(Environment(radiance, "window"))


def blocked(deform: Deform, poses: Poses, sky: SkyState) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What all points lack of sky and lamps (S, 3) each, their places in the file's coordinates, and normals."""
    state, pictures = deform._shading_state()
    places, frames = pictures.posed.at(poses)
    normals = np.ascontiguousarray(frames[:, 2])
    of_sky, of_lamps = blocked_light(
        pictures._points, sky, state.lamps, state.lights, (), state.casts, state.casting_objects, places, normals
    )
    return of_sky, of_lamps.sum(axis=1), (places[: len(normals)] + deform.scene.origin).astype(np.float32), normals


def test_a_ball_on_a_floor_blocks_what_it_covers_of_an_even_sky(tmp_path: Path) -> None:
    """A sphere of radius r whose centre is d away, at an angle θ from the normal, all of it above the horizon, covers
    (r / d)² cos θ of a white sky's irradiance."""
    deform = made(tmp_path, FLOOR + icosphere(tmp_path, 1.0, CENTRE), bends=("ball",))
    of_sky, _, places, normals = blocked(deform, (), WHITE_SKY)
    centre, floor = np.array(CENTRE), deform.scene.object_index("floor")
    to = centre - places
    distance = np.linalg.norm(to, axis=1)
    up = normals[:, 1] > 0.5
    far = (deform._points.owners == floor) & (distance > 0.8) & up  # type: ignore[union-attr]
    expected = (0.5 / distance) ** 2 * np.einsum("pc,pc->p", to, normals) / distance
    assert far.sum() > 20 and expected[far].max() > 0.1
    # 400 lights resolve a cover of a tenth of the sky within the size of a few of them.
    assert np.abs(of_sky[far, 0] - expected[far]).mean() < 0.006
    assert of_sky[deform._points.owners != floor].max() == 0.0  # type: ignore[union-attr]


def test_it_is_what_a_slow_twin_finds(tmp_path: Path) -> None:
    sky = side_lit()
    deform = made(tmp_path, FLOOR + icosphere(tmp_path, 1.0, CENTRE), sky, ("ball",))
    of_sky, _, places, normals = blocked(deform, BENT, sky)
    points, floor = deform._points, deform.scene.object_index("floor")
    assert points is not None and sky.environment is not None
    lights = cut_lights(sky.environment, N_LIGHTS)
    corners = points.places[points.surface.corners[points.surface.i_object != floor]] + deform.scene.origin
    for p in points.points_of(floor)[::17]:
        expected = np.zeros(3)
        for m in range(len(lights)):
            cosine = float(normals[p] @ lights.centre[m])
            if cosine > 0.0 and meets_any(places[p] + 1e-5 * normals[p], lights.centre[m].astype(np.float64), corners):
                expected += cosine / math.pi * lights.power[m]
        np.testing.assert_allclose(of_sky[p], expected, rtol=1e-3, atol=1e-5)
    assert of_sky.max() > 0.3


def meets_any(origin: np.ndarray, direction: np.ndarray, corners: np.ndarray) -> bool:
    """Whether a ray meets any of the triangles (T, 3, 3), by the signs of volumes."""
    a, b, c = (corners[:, k] - origin for k in range(3))
    volumes = [np.einsum("tc,c->t", np.cross(x, y), direction) for x, y in ((a, b), (b, c), (c, a))]
    same = (np.stack(volumes) >= 0.0).all(axis=0) | (np.stack(volumes) <= 0.0).all(axis=0)
    normal = np.cross(b - a, c - a)
    ahead = np.einsum("tc,tc->t", a, normal) * (normal @ direction) > 0.0
    return bool((same & ahead).any())


def test_a_lamp_behind_a_ball_is_lacked_whole_and_one_above_not_at_all(tmp_path: Path) -> None:
    small = "emission = [5, 4, 3]\n"
    lamp = placed("lamp", "quad", "0,0,-0.2,3, 0.2,0,0,0.5, 0,-0.2,0,0, 0,0,0,1", small)
    floor = placed("floor", "quad", facing_up(6))
    deform = made(tmp_path, floor + icosphere(tmp_path, 1.0, CENTRE) + lamp, SkyState(None), ("ball",))
    state, _ = deform._shading_state()
    assert state.added is not None and len(state.lamps) == 1
    _, of_lamps, places, normals = blocked(deform, (), SkyState(None))
    behind = (np.abs(places[:, 2]) < 0.2) & (places[:, 0] < -0.6) & (places[:, 0] > -2.0) & (normals[:, 1] > 0.5)
    before = (places[:, 0] > 1.0) & (places[:, 0] < 1.9)
    behind, before = (each & (deform._points.owners == deform.scene.object_index("floor")) for each in (behind, before))  # type: ignore[union-attr]
    assert behind.any() and before.any()
    np.testing.assert_array_equal(of_lamps[before], 0.0)
    assert (of_lamps[behind] > 0.0).all()
    # All that reaches such a point by the lamp is lacked; what is left of `added` is a bounce of the ball.
    white = deform.draw(deform.scene.description.camera, SIZE, (), "rest")
    assert np.isfinite(white).all() and white.min() >= 0.0


@pytest.fixture(scope="module")
def by_a_window(tmp_path_factory: pytest.TempPathFactory) -> Deform:
    """A ball on a floor, in the light of one side."""
    text = placed("floor", "quad", facing_up(4)) + placed("ball", "sphere", scaled(1.4, (-0.3, 0.7, 0.0)))
    return made(tmp_path_factory.mktemp("window"), text, side_lit(), ("ball",), n_points=1500)


@pytest.mark.parametrize("poses", [(), BENT])
def test_a_picture_at_rest_is_nearer_to_paths_than_one_in_motion(by_a_window: Deform, poses: Poses) -> None:
    """In means of blocks of the floor, by which the noise of paths is small."""
    deform, sky = by_a_window, side_lit()
    reference = PathReference(deform.scene, poses)
    for _ in range(3):
        for _ in reference.trace({0: (GREY,), 1: (GREY,)}, sky, 2):
            pass
    assert reference.picture is not None
    camera, is_floor = deform.scene.description.camera, seen(deform, 0)
    qualities: tuple[Quality, ...] = ("moving", "rest")
    found = [deform.draw(camera, SIZE, poses, each) - reference.picture for each in qualities]
    off = [np.abs(blocks(np.where(is_floor[..., None], each, 0.0))).mean() for each in found]
    assert off[1] < 0.5 * off[0]


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means of blocks of 6 x 6 pixels."""
    height, width = picture.shape[0] // 6, picture.shape[1] // 6
    return np.asarray(picture[: 6 * height, : 6 * width].reshape(height, 6, width, 6, 3).mean(axis=(1, 3)))
