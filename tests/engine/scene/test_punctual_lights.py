"""Lamps for lights without size: their irradiance against closed forms."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import insitu
from engine.light.cones import cone_row, cone_shares
from engine.light.emitters import solid_angles
from engine.scene.description import ObjectDescription
from engine.scene.import_report import report_scene
from engine.scene.loaders.model import ImportedLight, ImportedModel, ImportedPart
from engine.scene.mesh import place_copies
from engine.scene.primitives import PRIMITIVES, cube
from engine.scene.punctual_lights import LAMP_RADIUS, lamps_of, suns_of
from engine.scene.scene_loader import load_scene
from tests.few_points import use_few_points
from tests.scene_text import camera, facing_up, material, placed

INTENSITY = (10.0, 20.0, 30.0)
AXIS = np.array([0.2, -1.0, -0.1]) / np.linalg.norm([0.2, -1.0, -0.1])
POINT = ImportedLight("Bulb", "point", INTENSITY, (0.3, 1.5, 0.2))
CONES = [
    (0.0, 2.0),
    (0.0, 12.0),
    (0.0, 30.0),
    (0.0, 45.0),
    (15.0, 35.0),
    (17.0, 34.0),
    (29.0, 45.0),
    (40.0, 45.0),
    (0.0, 90.0),
]


def spot(inner: float, outer: float) -> ImportedLight:
    cone = math.radians(inner), math.radians(outer)
    x, y, z = AXIS.tolist()
    return ImportedLight("Spot", "spot", INTENSITY, (0.3, 1.5, 0.2), (x, y, z), *cone)


def lamps(*lights: ImportedLight) -> list[ObjectDescription]:
    return lamps_of(lights, np.eye(4), np.zeros(3), 1.0)[0]


def extension_intensity(cosine: np.ndarray, inner: float, outer: float) -> np.ndarray:
    """Relative to that along the axis, as KHR_lights_punctual has it."""
    inner, outer = math.radians(inner), math.radians(outer)
    scale = 1.0 / max(0.001, math.cos(inner) - math.cos(outer))
    return np.clip(cosine * scale - math.cos(outer) * scale, 0.0, 1.0) ** 2


def test_a_point_is_a_sphere_of_the_same_irradiance() -> None:
    (lamp,) = lamps(POINT)
    mesh = place_copies(PRIMITIVES["sphere"](), np.reshape(lamp.transform, (1, 4, 4)))
    assert np.linalg.norm(mesh.vertices - POINT.position, axis=1).max() == pytest.approx(
        LAMP_RADIUS * np.linalg.norm(POINT.position)
    )
    places = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 3)) * (1.0, 0.0, 1.0)
    corners = mesh.vertices[mesh.triangles]
    towards = corners.mean(axis=1)[None] - places[:, None]
    cosine = towards[..., 1] / np.linalg.norm(towards, axis=2)
    found = lamp.emission * np.sum(solid_angles(corners, places) * cosine, axis=1)[:, None]
    # E = I cos / d², exactly, because all of the sphere is above the horizon.
    away = np.subtract(POINT.position, places)
    distance = np.linalg.norm(away, axis=1)
    np.testing.assert_allclose(found, np.outer(away[:, 1] / distance**3, INTENSITY), rtol=1e-3)


@pytest.mark.parametrize(("inner", "outer"), CONES)
def test_a_spot_is_a_sphere_of_the_same_irradiance(inner: float, outer: float) -> None:
    (lamp,) = lamps(spot(inner, outer))
    assert (lamp.name, lamp.primitive, lamp.is_lamp) == ("Spot", "sphere", True)
    mesh = place_copies(PRIMITIVES["sphere"](), np.reshape(lamp.transform, (1, 4, 4)))
    # Places on the floor around where the axis meets it, out to a few of them beyond the cone.
    middle = POINT.position - POINT.position[1] / AXIS[1] * AXIS
    reach = 1.3 * 1.5 * math.tan(math.radians(min(outer, 60.0)))
    places = middle + np.random.default_rng(1).uniform(-reach, reach, (60, 3)) * (1.0, 0.0, 1.0)
    corners = mesh.vertices[mesh.triangles]
    towards = corners.mean(axis=1)[None] - places[:, None]
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    assert lamp.cone is not None
    row = cone_row(
        np.reshape(lamp.transform, (4, 4))[:3, 2], math.radians(lamp.cone.inner), math.radians(lamp.cone.outer)
    )
    sent = solid_angles(corners, places) * towards[..., 1] * cone_shares(row, towards)
    found = lamp.emission * np.sum(sent, axis=1)[:, None]
    # E = I(theta) cos / d²: the lamp is small, so that theta hardly varies over it.
    away = np.subtract(POINT.position, places)
    distance = np.linalg.norm(away, axis=1)
    shape = extension_intensity(-(away @ AXIS) / distance, inner, outer) * away[:, 1] / distance**3
    # The lamp's own width, 1 % of its distance, blurs the edges of narrow cones.
    narrow = 0.01 / math.radians(outer - inner)
    np.testing.assert_allclose(found, np.outer(shape, INTENSITY), atol=(0.002 + narrow**2) * INTENSITY[2] * shape.max())


def test_lamps_follow_the_transform_of_their_model() -> None:
    turned = np.array([[0, 0, 3.0, 1], [0, 3.0, 0, 2], [-3.0, 0, 0, 3], [0, 0, 0, 1]])
    sun = ImportedLight("Sun", "directional", INTENSITY, direction=(0.0, -0.6, -0.8))
    (lamp, source), _ = lamps_of((POINT, spot(0, 45), sun), turned, np.zeros(3), 1.0)
    for each in (lamp, source):
        np.testing.assert_allclose(np.reshape(each.transform, (4, 4))[:3, 3], turned[:3] @ (0.3, 1.5, 0.2, 1.0))
    axis = np.reshape(source.transform, (4, 4))[:3, 2]
    np.testing.assert_allclose(axis / np.linalg.norm(axis), turned[:3, :3] @ AXIS / 3.0, atol=1e-12)
    # Three times as large in a model three times as large, and no brighter at three times the distance.
    (plain,) = lamps(POINT)
    np.testing.assert_allclose(np.array(lamp.emission) * 9.0, plain.emission)
    (found,) = suns_of((POINT, sun), turned)
    np.testing.assert_allclose(found.direction, turned[:3, :3] @ (0.0, 0.6, 0.8) / 3.0, atol=1e-12)
    assert found.irradiance == INTENSITY


def test_lamps_that_cannot_be_placed_are_named() -> None:
    far = ImportedLight("Far", "point", INTENSITY, (2e8, 0.0, 0.0))
    near = ImportedLight("Near", "spot", INTENSITY, outer=0.5)
    assert lamps_of((far, near), np.eye(4), np.zeros(3), 1e-6) == ([], ["Far", "Near"])
    lit, left_out = lamps_of((near,), np.eye(4), np.zeros(3), 1e-5)
    assert len(lit) == 1 and not left_out


def text_of(lamp: ObjectDescription) -> str:
    more = f"emission = {list(lamp.emission or ())}\n"
    if lamp.cone is not None:
        more += f"cone = {{ inner = {lamp.cone.inner}, outer = {lamp.cone.outer} }}\n"
    return placed(lamp.name, str(lamp.primitive), ", ".join(map(str, lamp.transform)), more)


@pytest.mark.parametrize("kind", ["point", "spot", "edited spot", "sun"])
@pytest.mark.parametrize("mode", ["placement", "orbit", "deform", "paths"])
def test_a_floor_is_lit_as_by_the_light_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, mode: str
) -> None:
    """Albedo over pi times the closed form of the irradiance, through all of Insitu; of a spot also with a cone that is
    edited, after a picture of the one that its file has, and aimed there."""
    use_few_points(monkeypatch, 4000, 800)
    towards = np.array([0.4, 1.0, 0.3])
    if kind == "sun":
        sun = f"direction = {towards.tolist()}, irradiance = {list(INTENSITY)}"
        light = f"[environment]\nradiance = 0\nsun = [{{ {sun} }}]\n"
    else:
        in_file = {
            "point": POINT,
            "spot": spot(15, 45),
            "edited spot": replace(spot(2, 20), direction=(0.6, -0.8, 0.0)),
        }
        light = "".join(map(text_of, lamps(in_file[kind])))
    floor = placed("floor", "quad", facing_up(4), material('model = "lambert", albedo = 0.5'))
    path = tmp_path / "scene.toml"
    # An orthogonal look down: pixels are squares of the floor.
    text = camera((0, 100, 0), 1.0, (12, 12), head="bounces = 1\n").replace("[camera]\n", "[camera]\nup = [0, 0, -1]\n")
    path.write_text(text + light + floor)
    scene = insitu.open(str(path))
    if kind == "edited spot":
        before = np.asarray(scene.image(mode, samples=4) if mode == "paths" else scene.image(mode))
        assert np.isfinite(before).all()
        scene["Spot"].inner_angle, scene["Spot"].outer_angle = 15, 45
        scene["Spot"].target = POINT.position + 1.5 * AXIS
    found = np.asarray(scene.image(mode, samples=1024) if mode == "paths" else scene.image(mode))
    half = 100.0 * math.tan(math.radians(0.5))
    x, z = np.meshgrid(*[half * ((2 * np.arange(12) + 1) / 12 - 1)] * 2)
    if kind == "sun":
        shape = np.full((12, 12), towards[1] / np.linalg.norm(towards))
    else:
        away = np.subtract(POINT.position, np.stack([x, 0 * x, z], axis=2))
        distance = np.linalg.norm(away, axis=2)
        shape = away[..., 1] / distance**3
        if kind.endswith("spot"):
            shape *= extension_intensity(-(away @ AXIS) / distance, 15, 45)
    expected = 0.5 / np.pi * shape[..., None] * INTENSITY
    error = np.sqrt(np.mean((found - expected) ** 2)) / expected.mean()
    # Paths have noise, and Deform a lamp in 64 parts.
    assert error < {"paths": 0.08, "deform": 0.02}.get(mode, 0.01)
    assert found.mean() == pytest.approx(expected.mean(), rel={"paths": 0.02, "deform": 0.01}.get(mode, 0.003))


@pytest.fixture
def model_with_lights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cube of a file that has three lights."""
    sun = ImportedLight("Sun", "directional", INTENSITY, direction=(0.0, -1.0, 0.0))
    model = ImportedModel((ImportedPart(cube()),), lights=(POINT, spot(0, 45), sun, POINT))
    monkeypatch.setattr("engine.scene.object_meshes.read_model", lambda file, variants: model)
    path = tmp_path / "box.glb"
    path.write_bytes(b"glTF")
    return path


def test_lights_of_a_file_become_objects_beside_its_parts(model_with_lights: Path) -> None:
    scene = load_scene(model_with_lights)
    assert scene.object_names == ("box", "Bulb", "Spot", "Bulb+", "floor")
    assert scene.emitters.tolist() == [False, True, True, True, False]
    (sun,) = scene.description.environment.suns
    assert sun.direction == (0.0, 1.0, 0.0) and sun.irradiance == INTENSITY
    assert report_scene(scene).lights == ("Bulb", "Spot", "Bulb+", "Sun")
    # The camera frames the cube: lamps do not move it away.
    assert np.linalg.norm(scene.camera_position) < 5.0


def test_a_scene_file_places_them_with_its_object(model_with_lights: Path, tmp_path: Path) -> None:
    head = camera((0, 2, 5)) + "[environment]\nradiance = 1\nrotation = 90\nscale = 2\n"
    move = "2,0,0,5, 0,2,0,0, 0,0,2,0, 0,0,0,1"
    path = tmp_path / "scene.toml"
    path.write_text(head + placed("thing", "box.glb", move))
    scene = load_scene(path)
    assert scene.object_names == ("thing", "Bulb", "Spot", "Bulb+")
    np.testing.assert_allclose(scene.bounds[1].mean(axis=0), (5.6, 3.0, 0.4), atol=1e-3)
    # Half the irradiance, because the environment's scale multiplies its suns.
    assert scene.description.environment.suns[0].irradiance == (5.0, 10.0, 15.0)
    # With a material of its own the object is geometry alone.
    path.write_text(head + placed("thing", "box.glb", move, material('model = "lambert"')))
    assert load_scene(path).object_names == ("thing",)
