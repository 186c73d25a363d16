"""Scenes in a pose: what moves, what stays, and what is left of what collapses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import camera, placed


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    path = tmp_path / "two.toml"
    sky = "[environment]\nradiance = [1, 1, 1]\n"
    path.write_text(
        camera((0, 1, 4), 40, (8, 6))
        + sky
        + placed("ball", "sphere")
        + placed("box", "cube", "1,0,0,3, 0,1,0,0, 0,0,1,0, 0,0,0,1")
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
        + "[environment]\nradiance = [1, 1, 1]\n"
        + placed("world", "sphere", "8e8,0,0,0, 0,8e8,0,0, 0,0,8e8,0, 0,0,0,1")
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
