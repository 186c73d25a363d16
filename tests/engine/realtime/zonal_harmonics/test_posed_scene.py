"""Scenes in a pose, by deformers and at a time of an animation: what moves, what stays, and where Deform draws it."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.bending_points import PosedPoints, bending_points
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation, Moment, deform
from engine.realtime.zonal_harmonics.posed_scene import animate_vertices, animated_pose, pose_scene
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.engine.scene.loaders.test_gltf_rig import Bar
from tests.scene_text import camera, environment, placed, scaled

ROW = (Moment("bend", 0.7),)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    path = tmp_path / "two.toml"
    path.write_text(
        camera((0, 1, 4), 40, (8, 6))
        + environment()
        + placed("ball", "sphere")
        + placed("box", "cube", scaled(1, (3, 0, 0)))
    )
    return load_scene(path)


def test_one_object_moves_and_the_other_stays(scene: Scene) -> None:
    bent = pose_scene(scene, (("ball", (Deformation("bend", 60.0),)),))
    ball, box = (np.unique(scene.triangles[slice(*each)]) for each in scene.triangle_ranges)
    assert np.array_equal(bent.vertices[box], scene.vertices[box])
    low, high = scene.bounds[0]
    top, foot = scene.vertices[ball, 1].argmax(), scene.vertices[ball, 1].argmin()
    assert bent.vertices[ball][foot] == pytest.approx(scene.vertices[ball][foot], abs=1e-6)
    angle, height = np.radians(60.0), high[1] - low[1]
    along = height / angle * np.array([1 - np.cos(angle), np.sin(angle)])
    assert bent.vertices[ball][top, :2] == pytest.approx([along[0], low[1] + along[1]], abs=1e-5)
    assert bent.normals[ball][top] == pytest.approx([np.sin(angle), np.cos(angle), 0.0], abs=1e-5)
    agree = np.einsum("tk,tk->t", bent.geometric_normals, bent.normals[bent.triangles[:, 0]])
    assert agree[: len(scene.triangles) // 2].min() > 0.5


def test_no_pose_is_the_scene_itself(scene: Scene) -> None:
    assert pose_scene(scene, ()) is scene and pose_scene(scene, (("cup", (Deformation("bend", 60.0),)),)) is scene


@pytest.mark.parametrize(
    "row",
    [
        (Deformation("bend", 720.0),),
        (Deformation("taper", -1.0), Deformation("bulge", -1.0)),
        (Deformation("twist", 1440.0, "z"),),
    ],
)
def test_what_collapses_keeps_unit_normals(scene: Scene, row: tuple[Deformation, ...]) -> None:
    bent = pose_scene(scene, (("ball", row), ("box", row)))
    for normals in (bent.normals, bent.geometric_normals):
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert np.isfinite(bent.vertices).all()


def test_what_reaches_beyond_the_largest_scene_is_refused_by_its_extent(tmp_path: Path) -> None:
    path = tmp_path / "vast.toml"
    path.write_text(
        camera((0, 1e8, 9e8), 40, (8, 6), (0, 0, 0), "bounces = 1\n")
        + environment()
        + placed("world", "sphere", scaled(8e8))
    )
    vast, poses = load_scene(path), (("world", (Deformation("bulge", 4.0),)),)
    said = "world: reaches 2e\\+09 m in this pose, expected at most 1e\\+09 m"
    with pytest.raises(InsituError, match=said):
        pose_scene(vast, poses)
    deform = Deform(vast, n_points=0, n_rays=16)
    deform.set_light(SkyState(None))
    deform.set_layers({})
    with pytest.raises(InsituError, match=said):
        finish_deform(deform).draw(vast.description.camera, (8, 6), poses)


def write_bar(folder: Path, bar: Bar | None = None) -> Path:
    """A bar_scene of a bar on two joints that bends within a second, or of another bar."""
    bar = bar or Bar()
    tree = json.dumps(bar.tree | {"buffers": [{"byteLength": len(bar.binary)}]}).encode()
    tree += b" " * (-len(tree) % 4)
    chunks = [struct.pack("<II", len(each), kind) + each for each, kind in ((tree, 0x4E4F534A), (bar.binary, 0x4E4942))]
    (folder / "bar.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))) + b"".join(chunks))
    path = folder / "bar.toml"
    dice = placed("dice", "cube", scaled(0.2, (0.4, 0.5, 0.15)))  # near by, so that the bar is cut
    path.write_text(camera((0, 1, 4), 40, (24, 18)) + environment((1, 2, 3)) + placed("bar", "bar.glb") + dice)
    return path


@pytest.fixture
def bar_scene(tmp_path: Path) -> Scene:
    return load_scene(write_bar(tmp_path))


def test_a_scene_stands_as_its_animation_has_it_and_bends_from_there(bar_scene: Scene) -> None:
    rest, pose = animate_vertices(bar_scene, 0, ROW)
    assert bar_scene.rigs[0] is not None
    moved = animated_pose(bar_scene.rigs[0], rest, bar_scene.triangles[:3], "bend", 0.7)
    assert np.array_equal(pose.positions, moved.positions) and np.abs(pose.positions - rest.positions).max() > 0.5
    traced = pose_scene(bar_scene, (("bar", ROW),))
    assert traced.vertices[:5] == pytest.approx(moved.positions, abs=1e-6)
    assert traced.normals[:5] == pytest.approx(moved.frames[:, 2], abs=1e-6)
    row = (ROW[0], Deformation("bend", 30.0))
    # In the box of the mesh at rest, or it would shake as that moves, but carried along with the whole.
    box = rest.box + (moved.positions - rest.positions).mean(axis=0)
    bent = deform(moved, [row[1]], box)
    assert pose_scene(bar_scene, (("bar", row),)).vertices[:5] == pytest.approx(bent.positions, abs=1e-6)


def test_an_animation_that_is_not_there_moves_nothing(bar_scene: Scene) -> None:
    assert np.array_equal(pose_scene(bar_scene, (("bar", (Moment("swim", 0.7),)),)).vertices, bar_scene.vertices)


def test_a_name_of_no_object_is_carried_nowhere(bar_scene: Scene) -> None:
    placed_points = PosedPoints(
        bar_scene, bending_points(bar_scene, RayCaster(bar_scene.vertices, bar_scene.triangles), 20)
    )
    alone = placed_points.animation_offsets((("bar", ROW),))
    rest, moved = animate_vertices(bar_scene, 0, ROW)
    assert alone["bar"] == pytest.approx((moved.positions - rest.positions).mean(axis=0))
    assert placed_points.animation_offsets((("gone", ROW), ("bar", ROW))) == alone


def test_what_is_drawn_goes_as_the_triangle_does_that_it_lies_on(bar_scene: Scene) -> None:
    points = bending_points(bar_scene, RayCaster(bar_scene.vertices, bar_scene.triangles), 200)
    placed_points = PosedPoints(bar_scene, points)
    resting, pose = points.rest_geometry(0), placed_points._pose(0, ROW)
    assert len(resting.positions) > 20
    rest, moved = animate_vertices(bar_scene, 0, ROW)
    for number, place in enumerate(rest.positions):
        (found,) = np.nonzero(np.abs(resting.positions - place).max(axis=1) < 1e-6)
        assert len(found) >= 2  # on either side
        assert pose.positions[found] == pytest.approx(np.tile(moved.positions[number], (len(found), 1)), abs=1e-6)
        sides = np.sign(resting.frames[found, 2] @ rest.frames[number, 2])
        assert pose.frames[found, 2] == pytest.approx(np.outer(sides, moved.frames[number, 2]), abs=1e-6)
    # In the middle of a triangle: as far as its corners on average, by their shares.
    corners = rest.positions[bar_scene.triangles[0]]
    inside = [k for k, each in enumerate(resting.positions) if (np.abs(corners - each).max(axis=1) > 1e-3).all()]
    assert inside and np.isfinite(pose.frames).all()
    assert placed_points._pose(0, ()).positions == pytest.approx(resting.positions, abs=0.0)
