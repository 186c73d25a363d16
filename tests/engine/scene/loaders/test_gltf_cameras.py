"""Cameras of glTF files: where they stand, what they see, and those that are not as here."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.model import ImportedModel

Triangle = tuple[dict, bytes]
PERSPECTIVE = {"type": "perspective", "name": "Front", "perspective": {"yfov": math.pi / 4, "znear": 0.1}}


@pytest.fixture
def with_camera(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> Callable[..., ImportedModel]:
    """with_camera(camera, **node): the model of the triangle beside a camera's node."""

    def read(camera: dict, **node: object) -> ImportedModel:
        tree, binary = triangle_glb
        tree |= {"cameras": [camera], "nodes": [{"mesh": 0}, {"camera": 0} | node], "scenes": [{"nodes": [0, 1]}]}
        return read_gltf(glb_file(tree, binary))

    return read


def test_a_camera_looks_along_minus_z_of_its_node(with_camera: Callable[..., ImportedModel]) -> None:
    half = math.sqrt(0.5)
    model = with_camera(PERSPECTIVE, translation=[9, 1, 0], rotation=[0, half, 0, half])  # a quarter about Y: along -X
    (found,) = model.cameras
    assert (found.name, found.aspect) == ("Front", None)
    assert found.camera.position == (9, 1, 0) and found.camera.fov_y == pytest.approx(45.0)
    # the target is as far as the middle of the triangle's box, (0.5, 0.5, 0)
    assert np.allclose(found.camera.target, (0.5, 1, 0)) and np.allclose(found.camera.up, (0, 1, 0))
    assert model.unshown == ()


def test_names_and_aspect(with_camera: Callable[..., ImportedModel]) -> None:
    camera = {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 1, "aspectRatio": 2.0}}
    (found,) = with_camera(camera, name="Left \x1b eye", translation=[0, 0, 5], scale=[2, 2, 2]).cameras
    assert found.name.startswith("Left") and found.name.isprintable() and found.aspect == 2.0
    assert with_camera(camera, translation=[0, 0, 5]).cameras[0].name == "Camera 1"


def test_an_orthographic_camera_is_a_distant_one(with_camera: Callable[..., ImportedModel]) -> None:
    camera = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 1.5, "znear": 0.1, "zfar": 9}}
    model = with_camera(camera, translation=[0.5, 0.5, 5])
    (found,) = model.cameras
    assert found.aspect == 2.0 and np.allclose(found.camera.target, (0.5, 0.5, 0))
    # half of the picture's height at the target is ymag
    half = found.camera.position[2] * math.tan(math.radians(found.camera.fov_y / 2))
    assert half == pytest.approx(1.5)
    assert [(each.name, each.effect) for each in model.unshown] == [
        ("cameras.orthographic", "shown in perspective, of 2 degrees from afar")
    ]


@pytest.mark.parametrize(
    "camera",
    [
        {"type": "fisheye"},
        {},
        {"type": "perspective", "perspective": {"yfov": "wide"}},
        {"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1}},
    ],
)
def test_a_camera_that_cannot_be_used_is_listed(with_camera: Callable[..., ImportedModel], camera: dict) -> None:
    model = with_camera(camera, translation=[0, 0, 5])
    assert model.cameras == () and len(model.parts) == 1
    assert "a view that cannot be used" in " ".join(each.effect for each in model.unshown)
    model = with_camera(PERSPECTIVE, scale=[0, 0, 0])
    assert model.cameras == () and any(each.name == "nodes.camera" for each in model.unshown)


def test_views_of_a_file_s_cameras(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> None:
    """By their names on the command line; placed with their object, and in their own aspect."""
    from app.files.bookmarks import camera_bookmarks
    from app.project.project import open_project
    from engine.core.errors import InsituError
    from engine.scene.scene_loader import load_scene
    from tests.scene_text import camera as view
    from tests.scene_text import placed

    tree, binary = triangle_glb
    wide = {"type": "perspective", "name": "Front", "perspective": {"yfov": 0.5, "znear": 0.1, "aspectRatio": 4.0}}
    tree |= {
        "cameras": [PERSPECTIVE, wide],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]}, {"camera": 1, "translation": [0, 0, 6]}],
        "scenes": [{"nodes": [0, 1, 2]}],
    }  # fmt: skip
    path = glb_file(tree, binary)
    views = camera_bookmarks(load_scene(path).cameras, (512, 512))
    assert [each.name for each in views] == ["Front", "Front 2"]
    assert views[0].viewpoint.resolution is None and views[1].viewpoint.resolution == (1024, 256)
    project = open_project(str(path), camera="Front 2")
    assert project.scene.description.camera.position == (0, 0, 6) and project.scene.resolution == (1024, 256)
    assert open_project(str(path), (32, 16), camera="Front").scene.resolution == (32, 16)
    with pytest.raises(InsituError, match="there is no view 'Back'; saved views: Front, Front 2"):
        open_project(str(path), camera="Back")
    scene_file = path.parent / "scene.toml"
    scene_file.write_text(
        view((0, 0, 3), 40, (32, 24)) + placed("toy", path.name, "1, 0, 0, 7, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1")
    )
    assert [each.camera.position for each in load_scene(scene_file).cameras] == [(7, 0, 5), (7, 0, 6)]
