"""Names that no file can have, and links that lead in a circle, end in one line wherever a file is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.document.commands.light import set_environment_file
from app.document.named_files import image_name
from app.editor.editor import Editor
from app.files.materials import load_material
from app.files.session import load_session
from app.operators.script import load_script
from app.project.project import open_project
from engine.core.errors import InsituError
from engine.light.environment import load_environment
from engine.scene.scene_loader import load_scene
from tests.app.cli.command_line import run
from tests.app.fake_worker import FakeClient

CAMERA = "[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\n"
CARD = '[[object]]\nname = "card"\nprimitive = "quad"\n'


@pytest.fixture(params=["NUL", "a circle"])
def named(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, str]:
    """A folder, and a name in it without its ending: with one of these endings it is a link in a circle, or NUL is in
    it."""
    if request.param == "NUL":
        return tmp_path, "a\0b"
    for ending in ("toml", "insitu", "glb", "ply", "exr", "binary", "png"):
        (tmp_path / f"loop.{ending}").symlink_to(f"other.{ending}")
        (tmp_path / f"other.{ending}").symlink_to(f"loop.{ending}")
    return tmp_path, "loop"


def one_line(error: BaseException) -> None:
    assert str(error).isprintable() and str(error)


@pytest.mark.parametrize("ending", ["toml", "insitu", "glb", "ply", "exr", "binary", "png"])
def test_what_is_to_be_opened(named: tuple[Path, str], ending: str, client: FakeClient) -> None:
    folder, name = named
    path = folder / f"{name}.{ending}"
    with pytest.raises(InsituError) as caught:
        open_project(str(path))
    one_line(caught.value)
    editor = Editor(client, "shelf")
    line = editor.open(str(path))  # as the window does
    assert line is None or (line.isprintable() and line)  # of a mesh or a scene the worker says it
    with pytest.raises(InsituError):
        load_scene(path)
    for opens in (load_session, load_material, load_script):
        with pytest.raises(InsituError) as caught:
            opens(path)
        one_line(caught.value)


def test_what_a_scene_names(named: tuple[Path, str]) -> None:
    folder, name = named
    quoted = name.replace("\0", "\\u0000")
    scenes = {
        "environment": CAMERA + f'[environment]\nfile = "{quoted}.exr"\n' + CARD,
        "mesh": CAMERA + f'[[object]]\nname = "card"\nmesh = "{quoted}.ply"\n',
        "measured": CAMERA + CARD + f'layer = [{{ model = "measured", file = "{quoted}.binary" }}]\n',
        "texture": CAMERA + CARD + f'layer = [{{ model = "lambert", texture = "{quoted}.png" }}]\n',
    }
    for what, text in scenes.items():
        path = folder / f"{what}.toml"
        path.write_text("version = 1\n" + text)
        with pytest.raises(InsituError) as caught:
            _ = open_project(str(path)).sky
        one_line(caught.value)


def test_light_images_and_materials(named: tuple[Path, str], client: FakeClient) -> None:
    folder, name = named
    for asks in (
        lambda: set_environment_file(folder / f"{name}.exr"),
        lambda: load_environment(folder / f"{name}.exr"),
        lambda: image_name(folder / f"{name}.png", "shelf"),
    ):
        with pytest.raises(InsituError) as caught:
            asks()
        one_line(caught.value)
    quoted = name.replace("\0", "\\u0000")
    material = folder / "material.toml"
    material.write_text(f'version = 1\nname = "Felt"\nlayer = [{{ model = "measured", file = "{quoted}.binary" }}]\n')
    with pytest.raises(InsituError) as caught:
        load_material(material)
    one_line(caught.value)


def test_what_is_measured_for_the_selected_object(named: tuple[Path, str], settled: Editor) -> None:
    folder, name = named
    said = settled.exchange.import_measured(folder / f"{name}.binary")
    assert said and said.isprintable()


def test_pictures_that_a_script_captures(tmp_path: Path) -> None:
    script = tmp_path / "script.toml"
    script.write_text('[[step]]\ncapture = "a\\u0000b.png"\n')
    with pytest.raises(InsituError, match="step 0: capture = a.b.png, expected the name of a file"):
        load_script(script)


def test_the_command_line(named: tuple[Path, str], capsys: pytest.CaptureFixture[str]) -> None:
    folder, name = named
    for ending in ("toml", "insitu", "glb", "exr"):
        assert run("render", folder / f"{name}.{ending}", "-o", folder / "out.exr") == 1
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and "Traceback" not in said and "\0" not in said
