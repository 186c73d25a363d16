"""Objects and lamps that are moved in Orbit's pictures: what changes follows, what does not stays bit for bit, and an
Orbit that takes over what it can is that of a fresh start."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.light.cones import Cone
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.triple_product.kept_points import FormerPoints
from engine.realtime.triple_product.moved_orbit import MovedOrbit
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.posed_scene import movements_between, pose_scene
from engine.scene.description import parse_description
from engine.scene.scene_loader import Scene, build_scene
from engine.scene.transform import Transform
from tests.engine.realtime.conftest import icosphere
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled

MATT = make_layer(MODELS["lambert"], {"albedo": [0.5, 0.25, 1.0]})
GOLD = make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
WHITE = make_layer(MODELS["lambert"], {"albedo": [1.0, 1.0, 1.0]})
SKY = SkyState(constant_environment((2.0, 1.0, 0.5)))
DARK = SkyState(None)
SIZE = 48, 36
LAMP = placed("lamp", "quad", facing_down(0.3, (-0.6, 1.2, 0.2)), "emission = [9.0, 8.0, 7.0]\n")
ROOM = (
    camera((0.0, 1.6, 4.0), 35.0, target=(0.0, 0.4, 0.0))
    + environment()
    + placed("floor", "quad", facing_up(4))
    + placed("block", "cube", scaled(0.6, (0, 0.31, 0)))
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("moved")
    text = ROOM + icosphere(folder, 0.4, (0.9, 0.25, 0.3)) + LAMP
    return build_scene(parse_description(tomllib.loads(text), "room"), folder / "room.toml", SIZE)


def orbit_of(scene: Scene, **how: object) -> Orbit:
    orbit = Orbit(scene, n_points=200, n_coefficients=32, n_patches=16, **how)  # type: ignore[arg-type]
    orbit.set_light(SKY)
    orbit.set_layers({0: [MATT], 1: [GOLD], 2: [WHITE]})
    return orbit


def finished(orbit: Orbit) -> Orbit:
    for _ in orbit.work():
        pass
    assert orbit.is_done
    return orbit


def picture(orbit: Orbit, quality: str = "rest") -> np.ndarray:
    return orbit.draw(orbit.scene.description.camera, SIZE, quality)  # type: ignore[arg-type]


def off_by(found: np.ndarray, right: np.ndarray) -> float:
    """relRMSE."""
    return float(np.sqrt(np.mean((found - right) ** 2)) / right.mean())


def former(orbit: Orbit) -> FormerPoints:
    every = np.ones(len(orbit.lit.points), bool)
    return orbit.former_points(orbit.scene, orbit.caster, every, every)


def test_random_moves_are_followed_and_end_as_a_fresh_start(scene: Scene) -> None:
    chance, poses = np.random.default_rng(7), dict[str, tuple[Transform, ...]]()
    orbit = finished(orbit_of(scene))
    picture(orbit, "moving")
    moved, before, was = MovedOrbit(orbit), picture(orbit, "moving"), orbit.lit.bits.copy()
    for _ in range(4):  # the second half of them of what was moved before, or of another
        name = ("block", "ball", "lamp")[chance.integers(3)]
        by, turn = chance.uniform(-0.25, 0.25, 3), chance.uniform(-40, 40, 3)
        poses[name] = (Transform((by[0], abs(by[1]), by[2]), tuple(turn), tuple(chance.uniform(0.7, 1.4, 3))),)
        there = pose_scene(scene, tuple(poses.items()))
        movements = movements_between(scene, (), tuple(poses.items()))
        moved.move(there, movements)
        for step, _ in enumerate(moved.work()):
            if step == 3:
                assert np.isfinite(picture(orbit, "moving")).all()
                break
    for _ in moved.work():
        pass
    assert not moved.waits_in_sight
    # What no movement concerned is as it was, and not little is.
    np.testing.assert_array_equal(orbit.lit.bits[: len(was)][~moved.changed], was[~moved.changed])
    fresh = finished(orbit_of(there))
    live, right = picture(orbit, "moving"), picture(fresh, "moving")
    # Direct light at points placed for other places, seen by rays 6 degrees apart: a sixth of what the movement
    # changes. A fresh start begins with a picture without shadows.
    first = orbit_of(there)
    steps = first.work()
    while not first.is_ready:
        next(steps)
    assert off_by(live, right) < 0.5 * off_by(before, right)
    assert off_by(live, right) < 0.5 * off_by(picture(first, "moving"), right)
    # At rest: points that see none of it are kept, all others are traced; the same picture.
    after = orbit_of(there, former=moved.former_points)
    steps = after.work()
    while after.lit is None:
        next(steps)
    kept = after.lit.traced.copy()
    assert kept.any() and not kept.all()
    np.testing.assert_array_equal(after.lit.bits[kept], fresh.lit.bits[: len(kept)][kept])
    finished(after)
    np.testing.assert_allclose(picture(after), picture(fresh), rtol=1e-5, atol=1e-7)
    assert picture(fresh).std() > 0.1


def test_a_point_keeps_its_light_only_below_whose_horizon_it_happens(scene: Scene) -> None:
    orbit = finished(orbit_of(scene))
    there = pose_scene(scene, (("ball", (Transform((0.1, 0.0, 0.0)),)),))
    after = orbit_of(there, former=former(orbit))
    steps = after.work()
    while after.lit is None:
        next(steps)
    points, lit = after.lit.points, after.lit.state > 0
    # The block's left side looks away from the ball at its right.
    left = (points.i_object == 1) & (points.normal[:, 0] < -0.9)
    right = (points.i_object == 1) & (points.normal[:, 0] > 0.9)
    assert lit[left].all() and not lit[right].any()


def test_what_hides_a_movement_keeps_all_behind_it(tmp_path: Path) -> None:
    # A ball moves on one side of a wall; nothing of it is seen from the middle of the floor's other half.
    wall = placed("wall", "cube", scaled((0.05, 3.0, 9.0), (0.0, 1.5, 0.0)))
    text = camera((0.5, 4.0, 4.0), 35.0) + environment() + placed("floor", "quad", facing_up(1.5)) + wall
    text += icosphere(tmp_path, 0.3, (0.6, 0.3, 0.0))
    scene = build_scene(parse_description(tomllib.loads(text), "wall"), tmp_path / "wall.toml", SIZE)
    orbit = finished(orbit_of(scene))
    there = pose_scene(scene, (("ball", (Transform((-0.1, 0.0, 0.1)),)),))
    after = orbit_of(there, former=former(orbit))
    steps = after.work()
    while after.lit is None:
        next(steps)
    floor = after.lit.points.i_object == 0
    behind, beside = (floor & (side * after.lit.points.position[:, 0] > 0.1) for side in (-1.0, 1.0))
    assert after.lit.traced[behind].mean() > 0.9 and not after.lit.traced[beside].any()


def test_a_cone_that_is_opened_is_followed(tmp_path: Path) -> None:
    # A small spot 2 m above a floor, whose light falls off sharply at the angle of its cone.
    turned = "0.02,0,0,0, 0,0,-0.02,2, 0,0.02,0,0, 0,0,0,1"
    spot = placed("spot", "sphere", turned, "emission = [9000, 9000, 9000]\ncone = { inner = 10, outer = 11 }\n")
    text = camera((0.0, 6.0, 0.01), 45.0) + placed("floor", "quad", facing_up(4)) + spot
    scene = build_scene(parse_description(tomllib.loads(text), "spot"), tmp_path / "spot.toml", SIZE)
    orbit = Orbit(scene, n_points=1500, n_coefficients=20, n_patches=4)
    orbit.set_light(DARK)
    orbit.set_layers({0: [WHITE]})
    orbit.set_bounces(1)
    finished(orbit)
    picture(orbit, "moving")
    moved = MovedOrbit(orbit)
    for cone in (Cone(10.0, 11.0), Cone(30.0, 31.0), Cone(20.0, 21.0)):
        poses = (("spot", (cone,)),)
        moved.move(pose_scene(scene, poses), movements_between(scene, (), poses))
        for _ in moved.work():
            pass
        lit = orbit.lit
        at = lit.points.position.astype(np.float64)[lit.points.i_object == 0]
        irradiance = lit.incident.irradiance[lit.points.i_object == 0][:, 1]
        distance = np.linalg.norm(at - (0.0, 2.0, 0.0), axis=1)
        cosine = (2.0 - at[:, 1]) / distance
        angle = np.degrees(np.arccos(cosine))
        # E = L π r² cos / d² within the cone, of a ball of r = 1 cm; half a degree is the ball's own width.
        inside, outside = angle < cone.inner - 0.5, angle > cone.outer + 0.5
        expected = 9000.0 * np.pi * 0.01**2 * cosine / distance**2
        assert inside.sum() > 10 and (irradiance[outside] == 0.0).all()
        off = np.abs(irradiance[inside] / expected[inside] - 1.0)
        assert np.median(off) < 0.01 and off.max() < 0.1  # of four patches a point may miss a part


def test_the_shadow_of_a_ball_moves_to_where_a_small_lamp_throws_it(tmp_path: Path) -> None:
    # A lamp 2 m above the floor; a ball half as high throws its shadow twice as far from the point below the lamp.
    lamp = placed("lamp", "quad", facing_down(0.02, (0, 2, 0)), "emission = [9000.0, 9000.0, 9000.0]\n")
    text = camera((0.0, 6.0, 0.01), 45.0) + placed("floor", "quad", facing_up(4)) + lamp
    text += icosphere(tmp_path, 0.2, (0.0, 1.0, 0.0))
    scene = build_scene(parse_description(tomllib.loads(text), "lamp"), tmp_path / "lamp.toml", SIZE)
    orbit = Orbit(scene, n_points=6000, n_coefficients=20, n_patches=4)
    orbit.set_light(DARK)
    orbit.set_layers({0: [WHITE], 2: [WHITE]})
    orbit.set_bounces(1)
    finished(orbit)
    picture(orbit, "moving")
    moved, floor = MovedOrbit(orbit), np.flatnonzero(orbit.lit.points.i_object == 0)
    at = orbit.lit.points.position[floor].astype(np.float64)
    for by_ball, by_lamp, middle in (
        ((0.3, 0.0, 0.1), (0.0, 0.0, 0.0), (0.6, 0.2)),
        ((0.3, 0.0, 0.1), (-0.2, 0.0, 0.0), (0.8, 0.2)),  # lamp + 2 (ball - lamp)
        ((0.0, 0.0, 0.0), (-0.2, 0.0, 0.0), (0.2, 0.0)),
    ):
        poses = (("ball", (Transform(by_ball),)), ("lamp", (Transform(by_lamp),)))
        moved.move(pose_scene(scene, poses), movements_between(scene, (), poses))
        for _ in moved.work():
            pass
        dark = (orbit.lit.incident.irradiance[floor] == 0.0).all(axis=1)
        # A point is dark whose line to the lamp passes the ball's middle within its radius of 0.1 m; its triangles and
        # the lamp's width leave 2 cm of doubt.
        ball, lamp_at = np.add((0.0, 1.0, 0.0), by_ball), np.add((0.0, 2.0, 0.0), by_lamp)
        towards = (lamp_at - at) / np.linalg.norm(lamp_at - at, axis=1, keepdims=True)
        apart = np.linalg.norm(np.cross(ball - at, towards), axis=1)
        assert dark[apart < 0.08].all() and not dark[apart > 0.12].any()
        nearest = np.linalg.norm(at[:, [0, 2]] - middle, axis=1).argmin()
        assert dark[nearest] and (apart < 0.08).sum() > 4
