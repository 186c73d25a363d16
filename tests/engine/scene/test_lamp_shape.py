"""Lamps by numbers: sizes against what their matrices do to a rectangle, a disc and a ball, targets, and cones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.light.cones import Cone
from engine.realtime.zonal_harmonics.posed_scene import movements_between, pose_scene
from engine.scene.description import parse_description
from engine.scene.lamp_shape import LampShape, lamp_shape_of
from engine.scene.scene_loader import build_scene
from engine.scene.toml_text import parse_toml
from engine.scene.transform import Transform, rotation_matrix
from tests.scene_text import camera, facing_down, placed, scaled

EMITS = "emission = [5, 5, 5]\n"
RECTANGLE_AT = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])


def shape(primitive: str, linear: np.ndarray, at: tuple[float, float, float], cone: Cone | None = None) -> LampShape:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, at
    return LampShape(primitive, tuple(matrix.ravel().tolist()), cone)  # type: ignore[arg-type]


def corners_of(lamp: LampShape, transform: Transform) -> np.ndarray:
    at_rest = RECTANGLE_AT @ lamp.linear.T + lamp.pivot
    matrix = transform.matrix(lamp.pivot)
    return at_rest @ matrix[:3, :3].T + matrix[:3, 3]


DOWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # +Z to -Y
ASKEW = rotation_matrix((20.0, 35.0, -50.0))


@pytest.mark.parametrize("frame", [np.eye(3), DOWN, ASKEW, ASKEW * (1.0, 1.0, -1.0)])
@pytest.mark.parametrize("before", [Transform(), Transform((1.0, 2.0, 3.0), (10.0, 70.0, 5.0), (2.0, 0.5, 1.5))])
def test_a_rectangle_has_the_sides_that_were_set(frame: np.ndarray, before: Transform) -> None:
    lamp = shape("quad", frame * (0.8, 0.5, 1.0), (0.3, 1.0, -0.2))
    found = lamp.resized("height", 0.7, lamp.resized("width", 2.0, before))
    assert (lamp.size("width", found), lamp.size("height", found)) == (pytest.approx(2.0), pytest.approx(0.7))
    corners = corners_of(lamp, found)
    sides = np.diff(corners, axis=0)
    # Its corners say the same: opposite sides 2 m and 0.7 m long, at right angles, about the same centre.
    np.testing.assert_allclose(np.linalg.norm(sides, axis=1), (2.0, 0.7, 2.0), rtol=1e-9)
    assert abs(sides[0] @ sides[1]) < 1e-9
    np.testing.assert_allclose(corners.mean(axis=0), lamp.pivot + before.translation, atol=1e-12)


def test_along_the_axes_of_the_world_a_size_is_one_number_of_the_scale() -> None:
    lamp = shape("quad", DOWN * 0.5, (0.0, 1.0, 0.0))
    # Its width goes along X; its height, turned down, along Z.
    assert lamp.resized("width", 1.0, Transform()) == Transform(scale=(2.0, 1.0, 1.0))
    assert lamp.resized("height", 1.0, Transform()) == Transform(scale=(1.0, 1.0, 2.0))
    assert lamp.size("height", Transform(scale=(1.0, 1.0, 3.0))) == pytest.approx(1.5)


@pytest.mark.parametrize("primitive", ["disc", "sphere"])
def test_a_radius_keeps_proportions(primitive: str) -> None:
    lamp = shape(primitive, DOWN * 0.6, (0.0, 1.0, 0.0))
    assert lamp.size("radius", Transform()) == pytest.approx(0.3)
    found = lamp.resized("radius", 0.6, Transform(scale=(2.0, 1.0, 0.5)))
    assert lamp.size("radius", found) == pytest.approx(0.6)
    assert np.divide(found.scale, (2.0, 1.0, 0.5)) == pytest.approx(np.full(3, found.scale[0] / 2.0))
    # A disc that shines down is an ellipse of the half axes 0.6 and 0.15 at first, as large as a circle of 0.3.
    if primitive == "disc":
        assert lamp.size("radius", Transform(scale=(2.0, 1.0, 0.5))) == pytest.approx(math.sqrt(0.6 * 0.15))


@pytest.mark.parametrize("metres", [0.0, -1.0, 1e-5, 1e6, math.nan])
def test_sizes_out_of_range_are_refused(metres: float) -> None:
    lamp = shape("quad", DOWN * 0.5, (0.0, 1.0, 0.0))
    with pytest.raises(ValueError, match=r"width .* m, expected 0.0005 m to 500 m"):
        lamp.resized("width", metres, Transform())


def test_a_sheared_rectangle_has_no_sides_that_could_be_set() -> None:
    sheared = np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert shape("quad", sheared, (0.0, 0.0, 0.0)).sizes == ()


def test_a_target_is_met_by_the_axis() -> None:
    lamp, point = shape("disc", DOWN * 0.5, (0.2, 2.0, 0.1)), np.array([1.0, 0.3, -0.7])
    # At first it shines straight down, at the ground.
    np.testing.assert_allclose(lamp.target(Transform(), None), (0.2, 0.0, 0.1), atol=1e-12)
    found = lamp.aimed_at(point, Transform((0.5, 0.0, 0.0), scale=(1.0, 2.0, 3.0)))
    distance = float(np.linalg.norm(point - (0.7, 2.0, 0.1)))
    np.testing.assert_allclose(lamp.target(found, distance), point, atol=1e-12)
    # It goes along with the light.
    moved = replace(found, translation=(0.5, 1.0, 0.0))
    np.testing.assert_allclose(lamp.target(moved, distance), point + (0.0, 1.0, 0.0), atol=1e-12)
    assert shape("sphere", np.eye(3), (0.0, 1.0, 0.0)).target(Transform(), 1.0) is None


def test_angles_push_each_other() -> None:
    cone = Cone(20.0, 30.0)
    assert cone.with_inner(40.0) == Cone(40.0, 40.0) and cone.with_outer(10.0) == Cone(10.0, 10.0)
    assert cone.with_inner(0.0).with_outer(90.0) == Cone(0.0, 90.0)
    for inner, outer in ((-1.0, 30.0), (0.0, 0.0), (0.0, 91.0), (31.0, 30.0), (math.nan, 30.0), (0.0, math.nan)):
        with pytest.raises(ValueError, match="angle"):
            Cone(inner, outer)


def test_a_cone_is_a_pose_that_moves_nothing(tmp_path: Path) -> None:
    text = camera((0, 1, 4)) + placed("box", "cube", "", 'layer = [{ model = "lambert" }]\n')
    text += placed("spot", "sphere", scaled(0.1, (0, 2, 0)), f"{EMITS}cone = {{ inner = 10, outer = 20 }}\n")
    text += placed("lamp", "quad", facing_down(0.5, (1, 2, 0)), EMITS)
    description = parse_description(parse_toml(text, "scene.toml"), "scene.toml")
    scene = build_scene(description, tmp_path / "scene.toml")
    narrow, moved = (("spot", (Cone(5.0, 60.0),)),), (("spot", (Cone(5.0, 60.0), Transform((1.0, 0.0, 0.0)))),)
    posed = pose_scene(scene, narrow)
    assert (posed.vertices == scene.vertices).all() and (posed.normals == scene.normals).all()
    # a = row[3] - row[:3] · d, which is 1 at 5 degrees from the axis +Z and 0 at 60.
    row = posed.cones[1].astype(np.float64)
    for degrees, share in ((5.0, 1.0), (60.0, 0.0)):
        towards = -np.array([math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))])
        assert row[3] - row[:3] @ towards == pytest.approx(share, abs=1e-6)
    assert (posed.cones[2] == scene.cones[2]).all()
    # It follows with the identity, and together with a move by that alone.
    np.testing.assert_array_equal(movements_between(scene, (), narrow)[1], np.eye(4))
    np.testing.assert_allclose(movements_between(scene, narrow, moved)[1][:3, 3], (1.0, 0.0, 0.0))
    found = lamp_shape_of(description.objects[1])
    assert found is not None and found.cone == Cone(10.0, 20.0) and lamp_shape_of(description.objects[0]) is None
