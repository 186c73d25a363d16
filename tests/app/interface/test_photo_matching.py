"""Matching a photograph in Python, and from the command line: of a scene with another material."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import insitu
from engine.scene.builtin import builtin_environments
from tests.app.cli.command_line import run

SCENE = """version = 1
[camera]
position = [0.0, 1.1, 2.6]
target = [0.0, 0.35, 0.0]
fov_y = 34.0
resolution = [80, 60]
[environment]
file = "studio.exr"
[[object]]
name = "ball"
primitive = "sphere"
transform = [0.5, 0, 0, 0, 0, 0.5, 0, 0.5, 0, 0, 0.5, 0, 0, 0, 0, 1]
layer = [{ model = "rough_conductor", alpha = 0.15 }]
[[object]]
name = "ground"
primitive = "backdrop"
layer = [{ model = "lambert", albedo = [0.4, 0.4, 0.4] }]
"""
# Four corners of a square on the ground, and the top of the ball, with their places in the photograph.
POINTS = [(-0.6, 0.0, -0.4), (0.6, 0.0, -0.4), (0.5, 0.0, 0.6), (-0.5, 0.0, 0.6), (0.0, 1.0, 0.0)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene, and its photograph with another material."""
    folder = tmp_path_factory.mktemp("photo")
    shutil.copy(builtin_environments()["studio"], folder)
    (folder / "scene.toml").write_text(SCENE)
    scene = insitu.open(folder / "scene.toml")
    scene["ball"][0].alpha = 0.3
    scene.save(folder / "photo.exr", bounces=1)
    return folder


def test_a_scene_takes_over_what_was_found(folder: Path) -> None:
    scene = insitu.open(folder / "scene.toml")
    found = scene.match("ball", folder / "photo.exr", bounces=1)
    assert found.error < 0.02 < found.before
    assert found.exposure == pytest.approx(1.0, rel=1e-3)
    assert scene["ball"][0].alpha == pytest.approx(0.3, rel=0.1)
    (name,) = found.deviations
    assert name == "0.theta_h"
    assert scene.undo() == "match ball to a picture"
    assert scene["ball"][0].alpha == 0.15


def test_point_pairs_move_the_camera(folder: Path) -> None:
    scene = insitu.open(folder / "scene.toml")
    here = scene.camera.position
    pairs = [(place, point) for place, point in zip(_places(scene), POINTS, strict=True)]
    scene.camera.position = (1.2, 1.4, 2.2)
    found = scene.match("ball", folder / "photo.exr", find=["0.alpha"], pairs=pairs, bounces=1)
    assert found.camera_error is not None and found.camera_error < 0.1
    assert scene.camera.position == pytest.approx(here, abs=0.02)


def _places(scene: insitu.Scene) -> list[tuple[float, float]]:
    from engine.core.camera import project

    camera = scene.viewpoint.camera
    directions = [[p - q for p, q in zip(point, camera.position, strict=True)] for point in POINTS]
    return [(float(x), float(y)) for x, y in project(camera, (80, 60), directions)]


@pytest.mark.parametrize(
    ("how", "line"),
    [
        ({"find": ["0.gloss"]}, "expected theta_h"),
        ({"pairs": [((1, 2), (3, 4))]}, r"expected \(\(column, row\), \(x, y, z\)\)"),
        ({"mask": "nothing.png"}, "nothing.png"),
    ],
)
def test_what_cannot_be_matched_is_refused(folder: Path, how: dict[str, object], line: str) -> None:
    scene = insitu.open(folder / "scene.toml")
    before = scene.document
    with pytest.raises(insitu.Error, match=line):
        scene.match("ball", folder / "photo.exr", bounces=1, **how)
    assert scene.document == before


def test_the_command_writes_a_session(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "found.insitu"
    assert run("match", folder / "scene.toml", "ball", folder / "photo.exr", "-o", out, "--bounces", "1") == 0
    said = capsys.readouterr().out
    assert "0.theta_h: " in said and " of 64 bands known within 10%" in said
    assert "relRMSE" in said and "exposure 1" in said
    assert insitu.open(out)["ball"][0].alpha == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (["--pair", "3,4=5"], "expected C,R=X,Y,Z"),
        (["--transfer", "film"], "expected srgb, linear or a gamma"),
        (["--find", "alpha"], "expected LAYER.NAME"),
        (["--side", "3"], "longer side = 3"),
    ],
)
def test_the_command_refuses_in_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], more: list[str], line: str
) -> None:
    assert run("match", folder / "scene.toml", "ball", folder / "photo.exr", *more) == 1
    said = capsys.readouterr().err
    assert line in said and said.count("\n") == 1
