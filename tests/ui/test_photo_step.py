"""A script's step that matches a photograph: one edit of the document, and one line where it cannot be done."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import pytest

import insitu
from app.operators.script import load_script
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.ui.small_scene import opened_window
from ui.headless import HeadlessWindow
from ui.script_runner import ScriptError, run_steps, wait_for_scene

pytestmark = pytest.mark.gl
SCENE = """version = 1
[camera]
position = [0.0, 1.1, 2.6]
target = [0.0, 0.35, 0.0]
fov_y = 34.0
resolution = [64, 48]
[environment]
radiance = [1.0, 1.0, 1.0]
[[object]]
name = "ball"
primitive = "sphere"
transform = [0.5, 0, 0, 0, 0, 0.5, 0, 0.5, 0, 0, 0.5, 0, 0, 0, 0, 1]
layer = [{ model = "lambert", albedo = [0.2, 0.2, 0.2] }]
[[object]]
name = "ground"
primitive = "backdrop"
layer = [{ model = "lambert", albedo = [0.4, 0.4, 0.4] }]
"""


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """The picture of the scene with another colour, from Python."""
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = insitu.open(tmp_path / "scene.toml")
    scene["ball"][0].albedo = (0.6, 0.3, 0.1)
    return scene.save(tmp_path / "photo.exr", bounces=1)


@pytest.fixture
def window(context: moderngl.Context, photo: Path, tmp_path: Path) -> Iterator[HeadlessWindow]:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, photo.with_name("scene.toml"), client) as window:
        wait_for_scene(window, window.shell.editor)
        yield window


def test_it_is_one_edit(photo: Path, window: HeadlessWindow) -> None:
    editor = window.shell.editor
    script = photo.with_name("a.toml")
    script.write_text(f'[[step]]\nmatch = {{ object = "ball", photo = "{photo.as_posix()}", bounces = 1 }}\n')
    run_steps(window, editor, load_script(script))
    assert editor.document.layer("ball.0").values["albedo"] == pytest.approx((0.6, 0.3, 0.1), abs=0.01)
    assert editor.undo() == "match ball to a picture"
    assert editor.document.layer("ball.0").values["albedo"] == (0.2, 0.2, 0.2)


def test_what_cannot_be_matched_is_one_line(photo: Path, window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before, script = editor.document, photo.with_name("a.toml")
    for step, line in (
        ('object = "cup", photo = "photo.exr"', "there is no object 'cup'"),
        (f'object = "ball", photo = "{photo.as_posix()}.png"', "expected a readable file"),
        (f'object = "ball", photo = "{photo.as_posix()}", find = ["0.gloss"]', "expected"),
    ):
        script.write_text(f"[[step]]\nmatch = {{ {step} }}\n")
        with pytest.raises(ScriptError, match=line):
            run_steps(window, editor, load_script(script))
    assert editor.document == before
