"""Deform's moving pictures in shaders against those of compiled code: bent, glossy, seen from behind, with lamps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from benchmarks.deform import DeformEffort
from benchmarks.programs.deform import frame_rates
from engine.light.environment import Environment, constant_environment
from engine.light.suns import Sun, with_suns
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import LightLink, SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.scene.camera_moves import orbit_camera
from engine.scene.description import Camera
from engine.scene.scene_loader import Scene, load_scene
from engine.sphere.geodesic import geodesic
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled
from ui.gl.context import MOVING_VARIABLE, GraphicsError, shader_bytes
from ui.gl.gpu_memory import read_texture
from ui.modes.deform.gl.posed_picture import PosedPicture

pytestmark = pytest.mark.gl

SIZE = (96, 72)
# The leaf is open, and both are over a floor.
BALL_AND_LEAF = (
    camera((1.5, 1.2, 3.0), 40, SIZE)
    + environment()
    + placed("ball", "sphere", scaled((0.6, 0.8, 0.6)))
    + placed("leaf", "quad", facing_up(0.5, (-0.8, 0, 0.4)))
    + placed("floor", "quad", facing_up(4, (0, -0.6, 0)))
)
MATT = make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)})
GLOSS = make_layer(MODELS["rough_conductor"], {"alpha": 0.4})
BRUSHED = make_layer(MODELS["ward"], {})
BENT: Poses = (
    ("ball", (Deformation("bend", 60.0), Deformation("twist", 40.0))),
    ("leaf", (Deformation("bend", 90.0),)),
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A ball of few triangles and a leaf that is open over a floor, and a lamp."""
    path = Path(tmp_path_factory.mktemp("scene")) / "ball.toml"
    cone = "cone = { inner = 20, outer = 85 }\n"
    text = BALL_AND_LEAF + placed("lamp", "quad", facing_up(0.3, (0.8, 0.9, 0)), "emission = [3, 2, 1]\n" + cone)
    path.write_text(text.replace('primitive = "sphere"', 'mesh = "ball.obj"'))
    ball = geodesic(3)
    corners = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in ball.vertices]
    faces = [f"f {a} {b} {c}" for a, b, c in ball.triangles + 1]
    path.with_name("ball.obj").write_text("\n".join([*corners, *faces]) + "\n")
    return load_scene(path)


@pytest.fixture(scope="module")
def deform(scene: Scene) -> Deform:
    made = Deform(scene, n_points=1500, n_rays=32)
    image = np.random.default_rng(2).uniform(0.2, 2.0, (16, 32, 3)).astype(np.float32)
    made.set_light(SkyState(Environment(image, "noise"), 30.0, 1.2))
    made.set_layers({0: (MATT, GLOSS), 1: (MATT,), 2: (MATT, GLOSS, GLOSS)})
    made.set_bending(["ball", "leaf"])
    made.set_effort(64, 2, 0)
    return finish_deform(made)


@pytest.fixture
def picture(context: moderngl.Context) -> Iterator[PosedPicture]:
    """Without smoothed edges."""
    made = PosedPicture(context, 0)
    for _ in made.warm_up():
        pass
    yield made
    made.release()
    assert made.memory_bytes == 0


@pytest.mark.parametrize(("poses", "turn"), [((), 0.0), (BENT, 0.0), (BENT, 140.0), (BENT, -75.0)])
def test_it_is_the_picture_of_compiled_code(deform: Deform, picture: PosedPicture, poses: Poses, turn: float) -> None:
    eye = orbit_camera(deform.scene.description.camera, np.radians(turn), 0.2)
    expected = deform.draw(eye, SIZE, poses)
    found = shown(picture, deform, eye, poses)
    off = np.abs(found - expected).max(axis=2)
    assert (off > 0.01).mean() < 0.01  # pixels on edges may go to either side
    assert np.median(off) < 1e-4 and expected.std() > 0.1


@pytest.mark.parametrize(("poses", "turn"), [((), 0.0), (BENT, 140.0), (BENT, -75.0)])
def test_gloss_by_rows_is_that_of_compiled_code(
    deform: Deform, picture: PosedPicture, poses: Poses, turn: float
) -> None:
    """Of one layer and of two on an object; it is another picture than that of lobes."""
    eye = orbit_camera(deform.scene.description.camera, np.radians(turn), 0.2)
    by_lobe = shown(picture, deform, eye, poses)
    layers = {0: (MATT, GLOSS), 1: (MATT,), 2: (MATT, GLOSS, GLOSS)}
    deform.set_layers({**layers, 2: (MATT, GLOSS, BRUSHED)})
    deform.set_effort(64, 2, 6)
    expected = finish_deform(deform).draw(eye, SIZE, poses)
    found = shown(picture, deform, eye, poses)
    deform.set_effort(64, 2, 0)
    deform.set_layers(layers)
    finish_deform(deform)
    off = np.abs(found - expected).max(axis=2)
    assert (off > 0.01).mean() < 0.01 and np.median(off) < 1e-4
    assert np.abs(found - by_lobe).max() > 0.05


@pytest.fixture(scope="module")
def under_lamps(tmp_path_factory: pytest.TempPathFactory) -> Deform:
    file = tmp_path_factory.mktemp("lamps") / "lamps.toml"
    lamps = placed("bulb", "sphere", scaled(0.05, (1.2, 1.6, 0.9)), "emission = [900, 700, 500]\n")
    lamps += placed("board", "quad", facing_down(0.8, (-0.6, 1.5, 0.4)), "emission = [6, 7, 8]\n")
    file.write_text(BALL_AND_LEAF + lamps)
    deform = Deform(load_scene(file), n_points=1500, n_rays=32)
    deform.set_light(SkyState(constant_environment((0.2, 0.2, 0.2))))
    deform.set_layers({0: (MATT, GLOSS), 1: (MATT,), 2: (MATT, GLOSS)})
    deform.set_bending(["ball", "leaf"])
    deform.set_effort(64, 2, 0)
    return finish_deform(deform)


@pytest.mark.parametrize("poses", [(), BENT])
def test_gloss_of_lamps_is_that_of_compiled_code(under_lamps: Deform, picture: PosedPicture, poses: Poses) -> None:
    """Of a lamp that is narrow and one that is wide, on a ball that bends and a floor that rests."""
    deform, eye = under_lamps, under_lamps.scene.description.camera
    expected, found = deform.draw(eye, SIZE, poses), shown(picture, deform, eye, poses)
    off = np.abs(found - expected).max(axis=2)
    assert (off > 0.01).mean() < 0.01 and np.median(off) < 1e-4
    assert np.abs(deform.export_picture(eye, poses).posed.of_lamps[:, 3:]).max() > 0.1


def test_linked_lights_are_those_of_compiled_code(tmp_path: Path, picture: PosedPicture) -> None:
    """The leaf and the floor have skies of their own, of which the ball that bends hides a part."""
    lamp = placed("board", "quad", facing_down(0.8, (-0.6, 1.5, 0.4)), "emission = [6, 7, 8]\n")
    (tmp_path / "lamps.toml").write_text(BALL_AND_LEAF + lamp)
    deform = Deform(load_scene(tmp_path / "lamps.toml"), n_points=1500, n_rays=32)
    sun = with_suns(constant_environment((0.3, 0.1, 0.1)), (Sun((0.2, 0.9, 0.4), (3.0, 3.0, 3.0)),))
    links = LightLink(frozenset({1}), SkyState(sun)), LightLink(frozenset({2}), SkyState(sun, 90.0), frozenset({3}))
    deform.set_light(SkyState(constant_environment((0.2, 0.2, 0.9)), links=links))
    deform.set_layers({0: (MATT, GLOSS), 1: (MATT,), 2: (MATT, GLOSS)})
    deform.set_bending(["ball", "leaf"])
    deform.set_effort(64, 2, 0)
    eye = finish_deform(deform).scene.description.camera
    expected, found = deform.draw(eye, SIZE, BENT), shown(picture, deform, eye, BENT)
    off = np.abs(found - expected).max(axis=2)
    assert (off > 0.01).mean() < 0.01 and np.median(off) < 1e-4
    # The floor, without the lamp and the blue sky, is red.
    assert expected[-1, :, 0].mean() > 1.2 * expected[-1, :, 2].mean()


def test_gloss_under_a_small_sun_is_the_same_and_has_no_rings(deform: Deform, picture: PosedPicture) -> None:
    light, eye = deform._light, deform.scene.description.camera
    sky = np.full((32, 64, 3), 0.05, np.float32)
    sky[8, 20] = 600.0
    deform.set_light(SkyState(Environment(sky, "sun")))
    deform.set_layers({0: (GLOSS,), 1: (GLOSS,), 2: (MATT, GLOSS, GLOSS)})
    expected, found = deform.draw(eye, SIZE, BENT), shown(picture, deform, eye, BENT)
    deform.set_light(light)
    deform.set_layers({0: (MATT, GLOSS), 1: (MATT,), 2: (MATT, GLOSS, GLOSS)})
    off = np.abs(found - expected).max(axis=2)
    assert (off > 0.01 * expected.max()).mean() < 0.01 and expected.max() > 0.5
    assert np.percentile(found, 1.0) > 0.2 * 0.05  # of the even part of the sky


def shown(picture: PosedPicture, deform: Deform, eye: Camera, poses: Poses) -> np.ndarray:
    export = deform.export_picture(eye, poses, picture.part_numbers)
    return read_texture(picture.draw(export, eye, SIZE), np.float32)[..., :3].astype(np.float32)


def test_known_parts_are_not_sent_again(deform: Deform, picture: PosedPicture) -> None:
    eye = deform.scene.description.camera
    before = shown(picture, deform, eye, BENT)
    export = deform.export_picture(eye, BENT, picture.part_numbers)
    assert export.shape is None and export.appearance is None
    light = deform._light
    deform.set_light(SkyState(light.environment, 120.0, 0.3))
    export = deform.export_picture(eye, BENT, picture.part_numbers)
    assert export.appearance is not None and not any(
        (export.shape, export.cover, export.backdrop)
    )  # the sky's image stays where it is
    assert not np.allclose(shown(picture, deform, eye, BENT), before, atol=0.1)
    deform.set_light(light)
    assert shown(picture, deform, eye, BENT) == pytest.approx(before, abs=1e-6)


def test_a_pose_of_nothing_is_refused(context: moderngl.Context, deform: Deform) -> None:
    bare = PosedPicture(context)
    export = deform.export_picture(deform.scene.description.camera, ())
    with pytest.raises(GraphicsError, match="without its mesh"):
        bare.draw(replace(export, shape=None), deform.scene.description.camera, SIZE)
    bare.release()


def test_edges_are_smooth(context: moderngl.Context, deform: Deform, picture: PosedPicture) -> None:
    eye, smooth = deform.scene.description.camera, PosedPicture(context)
    soft, hard = (shown(each, deform, eye, BENT) for each in (smooth, picture))
    fine = deform.draw(eye, (2 * SIZE[0], 2 * SIZE[1]), BENT)
    expected = fine.reshape(SIZE[1], 2, SIZE[0], 2, 3).mean(axis=(1, 3))
    rim = np.abs(soft - hard).max(axis=2) > 0.02
    assert 0.01 < rim.mean() < 0.3
    assert np.abs(soft - expected)[rim].mean() < 0.5 * np.abs(hard - expected)[rim].mean()
    smooth.release()


def test_frames_are_timed(context: moderngl.Context) -> None:
    effort = DeformEffort(24, 14, n_frames=2, resolution=(48, 36))
    for is_glossy in (False, True):
        rates = frame_rates(context, effort, is_glossy)
        assert len(rates) == 2 and min(rates) > 0.0


def test_software_leaves_it_to_the_worker_unless_asked(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.gl.context.is_software", lambda context: True)
    monkeypatch.delenv(MOVING_VARIABLE, raising=False)
    assert shader_bytes(context) == 0
    monkeypatch.setenv(MOVING_VARIABLE, "shader")
    assert shader_bytes(context) > 0
