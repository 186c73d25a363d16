"""Files that a desktop drops on the real window: each is opened, or refused in one line; whatever else goes on."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.app.test_project import TETRAHEDRON
from tests.pictures import write_exr
from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture()
OPENED = "[request.source for request in client.requests if type(request).__name__ == 'OpenScene']"
LIGHT = "editor.document.light.environment"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text("version = 1\n")
    (tmp_path / "thing.ply").write_text(TETRAHEDRON)
    write_exr(tmp_path / "sky.exr", np.full((4, 8, 3), 3.0, np.float32))
    (tmp_path / "nickel.binary").touch()
    (tmp_path / "notes.txt").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "thing.ply").write_text(TETRAHEDRON)
    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        archive.writestr("thing.ply", TETRAHEDRON)
    return tmp_path


def drop(real: RealWindow, *files: Path) -> None:
    real.events(("move", *real.at("viewport.centre")), ("drop", [str(file) for file in files]))


@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("scene.toml", "scene.toml"),
        ("thing.ply", "thing.ply"),
        ("model", "model/thing.ply"),
        ("model.zip", "model.zip"),
    ],
)
def test_a_scene_is_opened(real: RealWindow, files: Path, name: str, scene: str) -> None:
    real.fresh()
    drop(real, files / name)
    assert real.ask(OPENED)[-1] == str(files / scene) and real.ask("state.pending_action") is None
    real.fresh()
    real.drag("curve.magnitude", by=(0, -20))
    opened = real.ask(OPENED)
    drop(real, files / name)  # edits are asked about first
    assert real.ask("type(state.pending_action).__name__") == "OpenFile" and real.ask(OPENED) == opened
    real.click("button.leave.discard")
    assert real.ask(OPENED)[-1] == str(files / scene) and len(real.ask(OPENED)) == len(opened) + 1


def test_a_sky_and_a_measurement_are_a_step_each(real: RealWindow, files: Path) -> None:
    real.fresh()
    drop(real, files / "sky.exr")
    assert real.ask(LIGHT) == str(files / "sky.exr") and real.n_steps() == 1
    drop(real, files / "nickel.binary")
    real.wait_until("[layer.model.name for layer in editor.document.object('teapot').layers][0].startswith('measured')")
    assert real.n_steps() == 2
    real.quick("ctrl+z", 2)
    assert real.n_steps() == 0 and real.ask(LIGHT) != str(files / "sky.exr")


@pytest.mark.parametrize(
    ("names", "line"),
    [(["notes.txt"], "expected a scene"), (["folder"], "expected a scene"), (["folder.toml"], "no scene in it"),
     (["scene.toml", "sky.exr"], "2 files were dropped"), (["gone.hdr"], "there is no such file"), ([], "")],
)  # fmt: skip
def test_all_else_is_refused_in_a_line(real: RealWindow, files: Path, names: list[str], line: str) -> None:
    real.fresh()
    real.do("stage.before = editor.document; state.message and setattr(shell, 'state', "
            "__import__('dataclasses').replace(state, message=None))")  # fmt: skip
    opened = real.ask(OPENED)
    drop(real, *[files / name for name in names])
    assert line in real.notice() and bool(line) == bool(real.notice())
    assert real.ask("editor.document is stage.before") and real.ask(OPENED) == opened


def test_a_drop_answers_the_open_dialog(real: RealWindow, files: Path) -> None:
    real.fresh()
    real.key("ctrl+o")
    drop(real, files / "folder")
    assert real.ask("str(state.question.folder)") == str(files / "folder")
    drop(real, files / "notes.txt")
    assert "expected a scene" in real.ask("state.question.refusal")
    drop(real, files / "scene.toml")
    assert real.ask("state.question") is None and real.ask(OPENED)[-1] == str(files / "scene.toml")


def test_a_drop_names_what_is_to_be_saved(real: RealWindow, files: Path) -> None:
    real.fresh()
    real.key("ctrl+shift+s")
    drop(real, files / "notes.txt")
    assert real.ask("(str(state.question.folder), state.question.name)") == (str(files), "notes.txt")
    real.key("escape")


def test_a_drop_in_a_drag_takes_neither_apart(real: RealWindow, files: Path) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -20), let_go=False)
    drop(real, files / "sky.exr")
    real.release()
    assert real.ask(LIGHT) == str(files / "sky.exr") and not real.ask("editor.history.dragging")
    real.quick("ctrl+z", real.n_steps())
    assert real.n_steps() == 0 and real.ask(LIGHT) != str(files / "sky.exr")
