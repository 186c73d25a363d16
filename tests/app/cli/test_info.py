"""`insitu info`: what is in a file, as text and as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.document.view_state import ViewState
from app.files.session import save_session
from app.project.project import open_project
from engine.scene import object_meshes
from engine.scene.description import Camera
from engine.scene.loaders.model import ImportedCamera, ImportedModel, UnshownProperty
from tests.app.cli.command_line import run
from tests.pictures import write_exr

Captured = pytest.CaptureFixture[str]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
THICKNESS = UnshownProperty("materials.KHR_materials_volume.thicknessFactor", 3, "glass has no thickness")
FRONT = ImportedCamera("front", Camera(position=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0)))
HIDDEN = "\x1b[31mnodes.\nextras"


def values(capsys: Captured, *words: str | Path) -> dict[str, Any]:
    """What a command line prints, as JSON."""
    assert run("info", *words, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.fixture
def mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A mesh whose reader cannot show all of it."""
    (tmp_path / "kite.obj").write_text(TRIANGLE)
    read = object_meshes.read_model

    def with_more(file: Path, variants: Mapping[str, str]) -> ImportedModel:
        model = read(file, variants)
        return replace(
            model, notes=("one normal computed",), cameras=(FRONT,),
            unshown=(THICKNESS, UnshownProperty(HIDDEN, 1, "x")),
        )  # fmt: skip

    monkeypatch.setattr(object_meshes, "read_model", with_more)
    return tmp_path / "kite.obj"


def test_all_of_a_mesh_is_listed(mesh: Path, capsys: Captured) -> None:
    found = values(capsys, mesh)
    assert (found["version"], found["kind"], found["files"]) == (1, "scene", ["kite.obj"])
    # The floor and the studio that it stands in are not in its file.
    assert [item["name"] for item in found["objects"]] == ["kite"] and found["n_triangles"] == 1
    assert found["lights"] == [] and found["cameras"] == ["front"]
    assert found["unshown"][1] == {"name": THICKNESS.name, "count": 3, "effect": "glass has no thickness"}
    assert "kite: one normal computed" in found["notes"]


def test_the_text_is_plain_and_says_the_same(mesh: Path, capsys: Captured) -> None:
    assert run("info", mesh) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{mesh}: scene" and all(line.isprintable() for line in lines)
    assert any(line.split() == [THICKNESS.name, "3", *THICKNESS.effect.split()] for line in lines)
    assert "  kite: one normal computed" in lines


def test_a_scene_and_its_session(scene: Path, capsys: Captured) -> None:
    found = values(capsys, scene)
    assert found["lights"] == ["environment"] and found["materials"] == ["chalk"]
    assert found["unshown"] == [] and found["notes"] == []
    session = save_session(scene.parent / "mine.insitu", open_project(str(scene), (8, 6)).document, ViewState())
    of_session = values(capsys, session)
    assert of_session["kind"] == "session" and Path(of_session["scene"]) == scene
    assert of_session["objects"] == found["objects"]
    scene.write_text(scene.read_text() + '[[object]]\nname = "new"\nprimitive = "cube"\n')
    assert "new: not in the session, shown as the scene has them" in values(capsys, session)["notes"]


def test_an_environment(tmp_path: Path, capsys: Captured) -> None:
    image = np.full((4, 8, 3), 0.5, np.float32)
    image[0, 0] = -1.0
    write_exr(tmp_path / "sky.exr", image)
    found = values(capsys, tmp_path / "sky.exr")
    assert (found["kind"], found["width"], found["height"], found["mapping"]) == ("environment", 8, 4, "latlong")
    assert found["largest"] == 0.5 and "negative" in found["notes"][0]
    assert found["mean"] == pytest.approx([0.5] * 3, rel=0.02)


def test_a_measured_brdf(merl_file: Path, capsys: Captured) -> None:
    found = values(capsys, merl_file)
    assert found["kind"] == "measured BRDF" and found["fit"]["n_missing"] > 0


@pytest.mark.parametrize("name", ["nothing.glb", "nothing.hdr", "nothing.binary", "picture.png"])
def test_what_cannot_be_read_is_one_line(name: str, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "picture.png").write_bytes(b"")
    assert run("info", tmp_path / name, "--json") == 1
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1 and name in error


def test_all_images_are_textures(tmp_path: Path, capsys: Captured) -> None:
    for name in ("colour.png", "rough.png"):
        Image.fromarray(np.array([[0, 90], [160, 255]], np.uint8)).save(tmp_path / name)
    (tmp_path / "a.toml").write_text(
        "version = 1\n[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\n"
        '[[object]]\nname = "card"\nprimitive = "quad"\n'
        '[[object.layer]]\nmodel = "microfacet"\ntexture = "colour.png"\n'
        'parameter_maps = { alpha = { map = "rough.png" } }\n'
    )
    assert values(capsys, tmp_path / "a.toml")["textures"] == ["colour.png", "rough.png"]
