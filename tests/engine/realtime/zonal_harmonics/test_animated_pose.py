"""Objects at a time of their file's animation: in a scene that is traced, and where Deform draws them."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from engine.realtime.zonal_harmonics.bending_points import PosedPoints, bending_points
from engine.realtime.zonal_harmonics.pose import Deformation, Moment, deform
from engine.realtime.zonal_harmonics.posed_scene import animate_vertices, animated_pose, pose_scene
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.engine.scene.loaders.test_gltf_rig import Bar
from tests.scene_text import camera, placed

ROW = (Moment("bend", 0.7),)


def write_bar(folder: Path, bar: Bar | None = None) -> Path:
    """A scene of a bar on two joints that bends within a second, or of another bar."""
    bar = bar or Bar()
    tree = json.dumps(bar.tree | {"buffers": [{"byteLength": len(bar.binary)}]}).encode()
    tree += b" " * (-len(tree) % 4)
    chunks = [struct.pack("<II", len(each), kind) + each for each, kind in ((tree, 0x4E4F534A), (bar.binary, 0x4E4942))]
    (folder / "bar.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))) + b"".join(chunks))
    path = folder / "bar.toml"
    bar_object = '[[object]]\nname = "bar"\nmesh = "bar.glb"\n'
    dice = placed("dice", "cube", "0.2,0,0,0.4, 0,0.2,0,0.5, 0,0,0.2,0.15, 0,0,0,1")  # near by, so that the bar is cut
    path.write_text(camera((0, 1, 4), 40, (24, 18)) + "[environment]\nradiance = [1, 2, 3]\n" + bar_object + dice)
    return path


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load_scene(write_bar(tmp_path))


def test_a_scene_stands_as_its_animation_has_it_and_bends_from_there(scene: Scene) -> None:
    rest, pose = animate_vertices(scene, 0, ROW)
    assert scene.rigs[0] is not None
    moved = animated_pose(scene.rigs[0], rest, scene.triangles[:3], "bend", 0.7)
    assert np.array_equal(pose.positions, moved.positions) and np.abs(pose.positions - rest.positions).max() > 0.5
    traced = pose_scene(scene, (("bar", ROW),))
    assert traced.vertices[:5] == pytest.approx(moved.positions, abs=1e-6)
    assert traced.normals[:5] == pytest.approx(moved.frames[:, 2], abs=1e-6)
    row = (ROW[0], Deformation("bend", 30.0))
    # In the box of the mesh at rest, or it would shake as that moves, but carried along with the whole.
    box = rest.box + (moved.positions - rest.positions).mean(axis=0)
    bent = deform(moved, [row[1]], box)
    assert pose_scene(scene, (("bar", row),)).vertices[:5] == pytest.approx(bent.positions, abs=1e-6)


def test_an_animation_that_is_not_there_moves_nothing(scene: Scene) -> None:
    assert np.array_equal(pose_scene(scene, (("bar", (Moment("swim", 0.7),)),)).vertices, scene.vertices)


def test_a_name_of_no_object_is_carried_nowhere(scene: Scene) -> None:
    placed_points = PosedPoints(scene, bending_points(scene, RayCaster(scene.vertices, scene.triangles), 20))
    alone = placed_points.animation_offsets((("bar", ROW),))
    rest, moved = animate_vertices(scene, 0, ROW)
    assert alone["bar"] == pytest.approx((moved.positions - rest.positions).mean(axis=0))
    assert placed_points.animation_offsets((("gone", ROW), ("bar", ROW))) == alone


def test_what_is_drawn_goes_as_the_triangle_does_that_it_lies_on(scene: Scene) -> None:
    points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 200)
    placed_points = PosedPoints(scene, points)
    resting, pose = points.rest_geometry(0), placed_points._pose(0, ROW)
    assert len(resting.positions) > 20
    rest, moved = animate_vertices(scene, 0, ROW)
    for number, place in enumerate(rest.positions):
        (found,) = np.nonzero(np.abs(resting.positions - place).max(axis=1) < 1e-6)
        assert len(found) >= 2  # on either side
        assert pose.positions[found] == pytest.approx(np.tile(moved.positions[number], (len(found), 1)), abs=1e-6)
        sides = np.sign(resting.frames[found, 2] @ rest.frames[number, 2])
        assert pose.frames[found, 2] == pytest.approx(np.outer(sides, moved.frames[number, 2]), abs=1e-6)
    # In the middle of a triangle: as far as its corners on average, by their shares.
    corners = rest.positions[scene.triangles[0]]
    inside = [k for k, each in enumerate(resting.positions) if (np.abs(corners - each).max(axis=1) > 1e-3).all()]
    assert inside and np.isfinite(pose.frames).all()
    assert placed_points._pose(0, ()).positions == pytest.approx(resting.positions, abs=0.0)
