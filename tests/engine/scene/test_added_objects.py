"""Shapes and objects of files that are added to a scene: where they stand, and that they are read again alike."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.light.cones import cone_row
from engine.scene.added_objects import AddedObject, read_added, read_again
from engine.scene.composed_scene import compose_scene
from engine.scene.composition import ADDABLE, LIGHTS, SHAPES, Composition, SceneObject
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.engine.scene.conftest import TRIANGLE_PLY
from tests.engine.scene.loaders.test_gltf_lights import write
from tests.scene_text import camera, facing_up, material, placed, scaled

CLAY = material('model = "lambert"')
LOOKING = camera((1, 2, 5), 40, (8, 8), (0.25, 0.75, -0.5))


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """Seen by a camera that looks at (0.25, 0.75, -0.5)."""
    return scene_in(tmp_path, LOOKING)


def scene_in(folder: Path, view: str, more: str = "") -> Scene:
    """A ball of diameter 1.6 that stands on a large ground."""
    text = placed("ground", "quad", facing_up(20), CLAY) + placed("ball", "sphere", scaled(1.6, (0, 0.8, 0)), CLAY)
    (folder / "scene.toml").write_text(view + text + more)
    return load_scene(folder / "scene.toml")


def composed(scene: Scene, added: tuple[AddedObject, ...]) -> Scene:
    own: Composition = tuple(SceneObject(name, name) for name in scene.object_names)
    return compose_scene(scene, (*own, *(SceneObject(each.description.name, each.source) for each in added)))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_stands_on_the_ground_at_the_point_looked_at(scene: Scene, shape: str) -> None:
    (added,), notes, _ = read_added(shape, scene)
    # A quarter of 1.6 is 0.4, rounded to 0.5; a plane lies a thousandth of that above the ground.
    low, high = added.box
    assert notes == () and (high - low).max() == pytest.approx(0.5, abs=1e-3)
    # The ball, 0.8 around the middle, stands there: the shape is moved towards the camera, along (0.75, 5.5). A plane
    # has room below it.
    x, z = (low + high)[[0, 2]] / 2.0
    if shape == "plane":
        assert (x, z) == pytest.approx((0.25, -0.5), abs=1e-6)
    else:
        assert low[2] == pytest.approx(0.8, abs=0.04) and (x - 0.25) / (z + 0.5) == pytest.approx(0.75 / 5.5, abs=1e-3)
    assert low[1] == pytest.approx(5e-4 if shape == "plane" else 0.0, abs=1e-6)
    found = composed(scene, (added,))
    assert np.allclose(found.bounds[2], added.box, atol=1e-6)
    assert found.description.objects[2].layers  # grey, to be edited
    if shape == "plane":
        assert np.allclose(found.geometric_normals[slice(*found.triangle_ranges[2])], [0.0, 1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("light", LIGHTS)
def test_a_light_gives_the_ground_below_the_irradiance_pi(scene: Scene, light: str) -> None:
    (lamp,), _, _ = read_added(light, scene)
    # Half of the ball's 1.6 above its top at 1.6.
    assert lamp.box.mean(axis=0) == pytest.approx([0.25, 2.4, -0.5], abs=1e-6) and lamp.description.is_lamp
    found = composed(scene, (lamp,))
    own = slice(*found.triangle_ranges[2])
    corners = found.vertices[found.triangles[own]].astype(float) + found.origin
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # E = ∫ L cos θ cos θ' / d² dA over what faces the point below; sizes are small beside 2.4, so that 5 % are left of
    # a rectangle or disc of 1 m.
    to_point = np.array([0.25, 0.0, -0.5]) - corners.mean(axis=1)
    square = (to_point**2).sum(axis=1)
    facing = np.maximum(np.einsum("ti,ti->t", doubled, to_point), 0.0) / (2.0 * np.sqrt(square))
    cos_theta = -to_point[:, 1] / np.sqrt(square)
    irradiance = float(found.emission[2, 0]) * (facing * cos_theta / square).sum()
    assert irradiance == pytest.approx(math.pi, rel=0.1 if light in ("rectangle light", "disc light") else 0.01)
    if light == "spot light":
        assert np.allclose(found.cones[2], cone_row((0, -1, 0), math.radians(20), math.radians(30)), atol=1e-5)


def test_a_light_has_a_place_and_a_size_by_numbers_and_stays_in_its_room(scene: Scene, tmp_path: Path) -> None:
    (lamp,), _, _ = read_added("disc light", scene, (1.0, 2.0, 3.0), 0.1)
    assert np.allclose(lamp.box, [[0.95, 2.0, 2.95], [1.05, 2.0, 3.05]], atol=1e-3)
    room = scene_in(tmp_path, LOOKING, placed("room", "cube", scaled(2.5, (1, 1.25, 4)), CLAY))
    (within,), _, _ = read_added("point light", room)
    assert within.box.mean(axis=0)[1] == pytest.approx(0.9 * 2.5)


def test_where_nothing_stands_it_is_the_point_looked_at(tmp_path: Path) -> None:
    away = camera((1, 2, 5), 40, (8, 8), (4.0, 0.75, -3.0))
    (added,), _, _ = read_added("box", scene_in(tmp_path, away))
    assert np.allclose(added.box, [[3.75, 0.0, -3.25], [4.25, 0.5, -2.75]], atol=1e-6)


def test_a_room_that_is_one_object_is_in_no_ones_way(scene: Scene, tmp_path: Path) -> None:
    room = scene_in(tmp_path, LOOKING, placed("room", "cube", scaled(12, (0, 6, 0)), CLAY))
    (free,), (within,) = (read_added("box", each, size=0.5).objects for each in (scene, room))
    assert np.allclose(within.box, free.box, atol=1e-6)


def test_a_backdrop_stands_behind_all_that_stands_on_it(scene: Scene) -> None:
    (added,), _, _ = read_added("backdrop", scene)
    matrix = np.reshape(added.source.transform, (4, 4))
    width = np.linalg.norm(matrix[:3, 0])
    # The ball of 1.6 m has a circle of radius 0.8 √2 around its box: 12 times that, rounded up to 20 m.
    assert width == pytest.approx(20.0)
    camera = scene.description.camera
    away = (camera.position - np.array(camera.target)) * (1.0, 0.0, 1.0)
    assert matrix[:3, 2] / width == pytest.approx(away / np.linalg.norm(away), abs=1e-9)  # it faces the camera
    # It lies a ten thousandth of its width above the ground, and its floor is flat below the ball.
    found = composed(scene, (added,))
    caster = RayCaster(found.vertices, found.triangles)
    for x, z in ((-0.8, -0.8), (-0.8, 0.8), (0.8, -0.8), (0.8, 0.8)):
        hit = caster.intersect(np.float32([[x, 1e-2, z]]), np.float32([[0.0, -1.0, 0.0]]))
        assert found.object_of_triangle[hit.triangle[0]] == 2 and hit.distance[0] == pytest.approx(8e-3, abs=1e-5)
    # What is added then is as large as it was without it, and stands where it did.
    with_it, without = (read_added("box", each).objects[0].box for each in (found, scene))
    assert np.allclose(with_it, without, atol=1e-6)
    # What is seen past the ball is the backdrop.
    beside = np.float32([np.array([1.2, 0.8, 0.0]) - camera.position])
    seen = caster.intersect(np.float32([camera.position]), beside)
    assert found.object_of_triangle[seen.triangle[0]] == 2


def test_a_shader_ball_is_two_objects_that_stand_together(scene: Scene) -> None:
    (ball, base), _, _ = read_added("shader ball", scene)
    assert [each.description.name for each in (ball, base)] == ["shader ball", "shader ball base"]
    low, high = np.minimum(ball.box[0], base.box[0]), np.maximum(ball.box[1], base.box[1])
    assert low[1] == pytest.approx(0.0, abs=1e-6) and (high - low).max() == pytest.approx(0.5, abs=1e-3)
    assert ball.box.mean(axis=0)[[0, 2]] == pytest.approx(base.box.mean(axis=0)[[0, 2]], abs=1e-6)


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_what_is_added_fits_the_size_of_the_scene(tmp_path: Path, scale: float) -> None:
    view = camera((scale, 2 * scale, 5 * scale), 40, (8, 8), (0.0, 0.0, 0.0))
    text = placed("ball", "sphere", scaled(1.6 * scale, (0, 0.8 * scale, 0)), CLAY)
    for objects in (text, placed("lamp", "quad", scaled(scale), "emission = [1, 1, 1]\n")):  # nothing stands there
        (tmp_path / "scene.toml").write_text(view + objects)
        there = load_scene(tmp_path / "scene.toml")
        for what in ADDABLE:
            read = read_added(what, there)
            found = composed(there, read.objects)
            for each, box in zip(read.objects, found.bounds[1:], strict=True):
                assert 1e-3 * scale < float(np.ptp(each.box, axis=0).max()) < 50.0 * scale, what
                assert np.allclose(box, each.box, rtol=1e-4, atol=1e-6 * scale)


def test_within_an_object_that_the_camera_is_in_it_stands_there_too(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(LOOKING + placed("shell", "sphere", scaled(20), CLAY))
    there = load_scene(tmp_path / "scene.toml")
    for what in ADDABLE:
        for each in read_added(what, there).objects:
            assert np.isfinite(each.box).all() and np.abs(each.box).max() < 40.0, what


def test_place_and_size_by_numbers(scene: Scene) -> None:
    (added,), _, _ = read_added("torus", scene, (3.0, 1.0, -2.0), 0.2)
    assert np.allclose(added.box, [[2.9, 1.0, -2.1], [3.1, 1.06, -1.9]], atol=1e-4)


def test_objects_of_a_file_stand_together_in_their_own_size(
    scene: Scene, triangle_glb: tuple[dict, bytes], glb_file: Callable[..., Path]
) -> None:
    tree, binary = triangle_glb
    (primitive,) = tree["meshes"][0]["primitives"]
    tree["materials"] = [{"name": "red"}, {"name": "blue"}]
    tree["meshes"][0]["primitives"] = [primitive | {"material": k} for k in range(2)]
    file = glb_file(tree, binary)
    own, _, _ = read_added(str(file), scene, (0.0, 0.0, 0.0))
    assert [each.source.part for each in own] == [0, 1] and len({each.description.name for each in own}) == 2
    twice, _, _ = read_added(str(file), scene, (0.0, 0.0, 0.0), 2.0 * float(np.ptp(own[0].box, axis=0).max()))
    assert np.allclose(twice[1].box, 2.0 * own[1].box, atol=1e-6)
    found = composed(scene, own)
    assert np.allclose(found.bounds[2:], [each.box for each in own], atol=1e-6)
    # Its images and materials are named by the file's full path, so that the scene's folder does not matter.
    assert [each.name for each in found.description.objects[2].layers] == [
        each.name for each in own[0].description.layers
    ]


def test_lamps_of_a_file_come_along_and_suns_stay_behind(scene: Scene, tmp_path: Path) -> None:
    lights = [{"type": "point", "intensity": 683.0, "name": "bulb"}, {"type": "directional", "intensity": 1.0}]
    file = write(tmp_path / "lit.glb", lights, [{"translation": [1, 2, 3]}, {}])
    added, notes, _ = read_added(str(file), scene, (0.0, 0.0, 0.0))
    _, bulb = added
    assert bulb.description.is_lamp and bulb.source.emission == bulb.description.emission
    assert any("suns are left out" in note for note in notes)
    again, problems, _ = read_again([each.source for each in added], scene)
    assert problems == () and [each.source for each in again] == [each.source for each in added]
    assert all(np.allclose(a.box, b.box, atol=1e-6) for a, b in zip(added, again, strict=True))
    assert np.allclose(composed(scene, added).emission[3], bulb.description.emission)


def test_a_file_that_is_gone_takes_its_objects_alone_along(scene: Scene, tmp_path: Path) -> None:
    file = tmp_path / "card.ply"
    file.write_text(TRIANGLE_PLY)
    (card,), _, _ = read_added(str(file), scene)
    (box,), _, _ = read_added("box", scene)
    file.unlink()
    again, problems, _ = read_again([card.source, box.source], scene)
    assert [each.source for each in again] == [box.source]
    assert len(problems) == 1 and "card.ply" in problems[0] and "\n" not in problems[0]


@pytest.mark.parametrize("what", ["/nowhere/cup.glb", "teapot", "/nowhere/scene.toml"])
def test_what_cannot_be_added_is_refused_in_one_line(scene: Scene, what: str) -> None:
    with pytest.raises(LoadError) as caught:
        read_added(what, scene)
    assert what in str(caught.value)
