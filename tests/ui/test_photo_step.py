"""A script's step that matches a photograph: one edit of the document, and one line where it cannot be done."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

import insitu
from app.operators.script import load_script
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.camera import project
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


def test_a_camera_is_aligned_after_the_edit_and_its_refusal_is_one_line(
    photo: Path, window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor, script = window.shell.editor, photo.with_name("a.toml")
    own, size = editor.camera_history.own_camera, (64, 48)
    points = np.array([(0.0, 0.5, 0.5), (0.4, 0.5, 0.3), (-0.4, 0.4, 0.3), (0.0, 0.9, 0.3), (0.5, 0.0, 0.6)])
    pairs = np.stack([np.pad(project(own, size, points - np.array(own.position)), ((0, 0), (0, 1))), points], axis=1)
    written = ", ".join(f"[[{u}, {v}], {list(point)}]" for (u, v, _), point in pairs.tolist())
    step = f'object = "ball", photo = "{photo.as_posix()}", bounces = 1, pairs = [{written}]'
    script.write_text(f"[[step]]\nmatch = {{ {step} }}\n")
    run_steps(window, editor, load_script(script))
    assert editor.undo_label == "match ball to a picture" and editor.undo() is not None
    np.testing.assert_allclose(editor.camera_history.camera.position, own.position, atol=0.01)
    assert editor.camera_undo_label == "align the camera to a picture" and editor.view.camera is not None

    monkeypatch.setattr(editor.camera_history, "set_viewpoint", lambda *given: "64 x 48 is too large")
    with pytest.raises(ScriptError, match="^step 1: match: the camera stays as it was: 64 x 48 is too large$"):
        run_steps(window, editor, load_script(script))
    assert editor.undo() == "match ball to a picture"  # which was made before


def test_what_cannot_be_matched_is_one_line(photo: Path, window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before, script = editor.document, photo.with_name("a.toml")
    gone = f"{photo.as_posix()}.png"
    said = []
    for step in (
        'object = "cup", photo = "photo.exr"',
        f'object = "ball", photo = "{gone}"',
        f'object = "ball", photo = "{photo.as_posix()}", find = ["0.gloss"]',
    ):
        script.write_text(f"[[step]]\nmatch = {{ {step} }}\n")
        with pytest.raises(ScriptError) as refused:
            run_steps(window, editor, load_script(script))
        said.append(str(refused.value))
    unknown, missing, not_found = said
    assert unknown == "step 1: match: there is no object 'cup'; available: ball, ground"
    assert missing.startswith(f"step 1: match: {gone}: file = ")  # what the system says of it, cut short
    assert missing.endswith(", expected a readable file; nothing was changed")
    assert not_found == "step 1: match: Diffuse: 'gloss', expected theta_i, albedo"
    assert editor.document == before
