"""What the command line opens: scenes, sessions, values by path, and the light that a document means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.cli.options import print_project_notes
from app.document.commands.layers import SetParameter
from app.document.commands.light import SetEnvironment
from app.document.light_state import LightState
from app.document.sources import find_source
from app.document.view_state import Viewpoint, ViewState
from app.files.session import save_session
from app.project.assignments import parse_assignment
from app.project.distant_light import sky_of
from app.project.project import open_project
from engine.core.errors import InsituError, LoadError
from engine.light.suns import Sun
from engine.scene.builtin import builtin_environments
from tests.app.cli.command_line import SCENE
from tests.engine.scene.conftest import TRIANGLE_PLY
from tests.pictures import write_exr
from tests.scene_text import environment


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "ball.toml").write_text(SCENE)
    return tmp_path / "ball.toml"


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("teapot.1.alpha=0.3", "teapot.1.alpha", 0.3),
        ("a.0.albedo = [1, 0.5, 0]", "a.0.albedo", [1, 0.5, 0]),
        ("a.visible=false", "a.visible", False),
        ("a.1.distribution=ggx", "a.1.distribution", "ggx"),
        ('light.environment="studio"', "light.environment", "studio"),
        ("light.environment=/a=b.exr", "light.environment", "/a=b.exr"),
    ],
)
def test_assignments_are_read_as_toml_or_as_words(text: str, path: str, value: Any) -> None:
    assert parse_assignment(text) == (path, value)


def test_shapes_and_files_are_added_by_path(scene: Path, tmp_path: Path) -> None:
    (tmp_path / "card.ply").write_text(TRIANGLE_PLY)
    values = (("box.add", "box"), ("card.add", str(tmp_path / "card.ply")), ("box.scale", [2, 1, 1]))
    project = open_project(str(scene), values=values)
    own = open_project(str(scene))
    assert project.object_names == (*own.object_names, "box", "card")
    assert project.edited(own.document, Viewpoint()).object_names == own.object_names
    session = save_session(tmp_path / "added.insitu", project.document, ViewState())
    assert open_project(str(session)).document == project.document
    assert not any("box" in note for note in project.scene.notes)  # grey is what a shape is
    # Each stands where those before it leave room.
    low, high = open_project(str(scene), values=(("a.add", "box"), ("b.add", "box"))).scene.bounds[-2:].swapaxes(0, 1)
    assert ((low[0] >= high[1] - 1e-6) | (low[1] >= high[0] - 1e-6)).any()
    # Of a file that has gone the objects wait, and a line says so.
    (tmp_path / "card.ply").unlink()
    found = open_project(str(session))
    assert found.object_names == (*own.object_names, "box")
    assert any("card.ply" in note for note in found.notes) and any("card: no longer" in note for note in found.notes)
    for value, said in ((3, "one of box, sphere"), ("cup.xyz", "cup.xyz"), (str(tmp_path / "card.ply"), "card.ply")):
        with pytest.raises(InsituError, match=said):
            open_project(str(scene), values=(("cup.add", value),))


@pytest.mark.parametrize("text", ["", "a", "=1", "a=", "a= "])
def test_what_is_no_assignment_is_refused(text: str) -> None:
    with pytest.raises(InsituError, match="path=value"):
        parse_assignment(text)


def test_sources_are_names_or_files(scene: Path) -> None:
    assert find_source(None) == "teatray" and find_source("cornell") == "cornell"
    assert find_source(str(scene)) == str(scene)
    with pytest.raises(InsituError, match="built-in scenes are teatray, "):
        find_source("teatrey")


def test_a_session_brings_its_edits(scene: Path, tmp_path: Path) -> None:
    project = open_project(str(scene))
    edited = SetParameter("ball.0", "albedo", (0.1, 0.2, 0.3)).apply(project.document)
    session = save_session(tmp_path / "work.insitu", edited, ViewState())
    again = open_project(str(session), (8, 6), [("light.rotation", 12.0)])
    assert again.document.layer("ball.0") == edited.layer("ball.0")
    assert again.scene.resolution == (8, 6) and again.document.light.rotation == 12.0
    assert again.document.source == str(scene) and again.layers.keys() == again.editable == {"ball.0"}


def test_hidden_layers_are_left_out(scene: Path) -> None:
    assert not open_project(str(scene), values=[("ball.0.visible", False)]).layers
    assert not open_project(str(scene), values=[("ball.visible", False)]).layers
    assert not open_project(str(scene), values=[("ball.editable", False)]).editable


def test_the_light_is_the_scenes_until_another_is_chosen(scene: Path) -> None:
    project = open_project(str(scene))
    assert project.sky.environment is not None and np.all(project.sky.environment.radiance == 0.5)
    constant = sky_of(project.scene, LightState("constant", radiance=(1.0, 2.0, 3.0), rotation=5.0))
    assert constant.environment is not None and constant.environment.radiance[0, 0].tolist() == [1.0, 2.0, 3.0]
    assert (constant.rotation, constant.scale) == (5.0, 1.0)
    name, path = next(iter(builtin_environments().items()))
    chosen = sky_of(project.scene, SetEnvironment(name).apply(project.document).light)
    assert chosen.environment is not None and chosen.environment.source == str(path)
    with pytest.raises(LoadError, match=r"nowhere\.exr"):
        sky_of(project.scene, LightState("nowhere.exr"))


def test_suns_are_part_of_the_scenes_environment(scene: Path) -> None:
    text = scene.read_text().replace(
        "radiance = 0.5", "radiance = 0.5\nsun = [{ direction = [0, 1, 0], irradiance = 7 }]"
    )
    scene.write_text(text)
    project = open_project(str(scene))
    sky = project.sky.environment
    assert sky is not None and project.sky.environment is sky
    # L = E / (pi sin² 0.265°) in the zenith; elsewhere the sky.
    assert sky.radiance[0].max() == pytest.approx(7.0 / (np.pi * np.sin(np.radians(0.265)) ** 2), rel=2e-2)
    assert np.median(sky.radiance) == 0.5
    assert sky_of(project.scene, LightState("constant", radiance=(1.0, 1.0, 1.0))).environment.radiance.max() == 1.0


def test_a_scene_without_environment_has_no_sky(tmp_path: Path) -> None:
    (tmp_path / "dark.toml").write_text(SCENE.replace(environment(0.5), ""))
    assert open_project(str(tmp_path / "dark.toml")).sky.environment is None


TETRAHEDRON = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
)


def test_light_alone_opens_the_default_scene_under_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_exr(tmp_path / "probe.exr", np.full((8, 8, 3), 3.0, np.float32))
    monkeypatch.chdir(tmp_path)
    project = open_project("probe.exr", (8, 6), [("light.rotation", 12.0)])
    assert project.document.source == "teatray"
    light = project.document.light
    assert (light.environment, light.mapping) == (str(tmp_path / "probe.exr"), "angular")  # it is square
    assert light.rotation == 12.0 and project.sky.environment is not None
    session = save_session(tmp_path / "work.insitu", project.document, ViewState())
    assert open_project(str(session), (8, 6)).document == project.document


def test_a_mesh_opens_as_a_scene_that_a_session_can_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    (folder / "thing.ply").write_text(TETRAHEDRON)
    monkeypatch.chdir(folder)
    project = open_project("thing.ply", (8, 6), [("thing.0.albedo", [0.1, 0.2, 0.3])])
    assert [state.name for state in project.document.objects] == ["thing", "floor"]
    session = save_session(folder / "work.insitu", project.document, ViewState())
    assert 'scene = "thing.ply"' in session.read_text()  # the folder can move
    moved = folder.rename(tmp_path / "elsewhere")
    again = open_project(str(moved / "work.insitu"), (8, 6))
    assert again.document.objects == project.document.objects
    assert again.document.source == str(moved / "thing.ply")


def test_a_session_from_before_objects_without_layers_were_grey(scene: Path, tmp_path: Path) -> None:
    project = open_project(str(scene))
    (ball, *others) = project.document.objects
    bare = replace(project.document, objects=(replace(ball, layers=()), *others))
    session = save_session(tmp_path / "work.insitu", bare, ViewState())
    assert open_project(str(session)).document.objects == project.document.objects


def test_a_commands_notes_are_of_the_light_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image = np.ones((4, 8, 3), np.float32)
    image[1, 2] = -1.0
    write_exr(tmp_path / "sky.exr", image)
    project = open_project(str(tmp_path / "sky.exr"))
    print_project_notes(project)
    said = "".join(capsys.readouterr())
    assert said.startswith("note: 1 of 32 pixels had negative values, set to 0") and said.count("note:") == 1
    assert project.sky is project.sky  # it is read once


def test_a_renamed_sun_is_the_same_light() -> None:
    scene, resting = open_project("teatray", (8, 6)).scene, LightState("constant", radiance=(0.2, 0.2, 0.2))
    suns = [Sun((0.0, 0.6, 0.8), (1.0, 1.0, 1.0), name=name) for name in ("sun", "Noon")]
    first, second = (sky_of(scene, replace(resting, new_suns=(sun,))).environment for sun in suns)
    assert first is second and first is not None and first.suns
