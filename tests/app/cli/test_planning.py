"""One decision on bounces: what `insitu plan` says is what a still, `precompute` and the editor take."""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from PIL import Image

from app import stills
from app.cli.planning import plan_project
from app.cli.precompute import precompute
from app.editor import Editor
from app.files.session import save_session
from app.jobs.in_process import InProcessClient
from app.jobs.tasks import Tasks
from app.messages import Progress
from app.project import open_project
from app.view_state import ViewState
from engine.scene.builtin import builtin_scenes
from tests.scene_text import ground

# Within a ball whose texture takes four fifths of the light: by its albedo alone it would need four bounces.
SCENE = """
version = 1
[camera]
position = [0, 0, 4]
target = [0, 0, 0]
resolution = [16, 12]
[[object]]
name = "ball"
primitive = "sphere"
transform = [12, 0, 0, 0, 0, 12, 0, 0, 0, 0, 12, 0, 0, 0, 0, 1]
layer = [{ model = "lambert", albedo = 0.9, texture = "dark.png", texture_space = "linear" }]
[[object]]
name = "lamp"
primitive = "sphere"
emission = 4
"""


@pytest.fixture
def scene(tmp_path: Path) -> str:
    Image.fromarray(np.full((4, 4, 3), 51, np.uint8)).save(tmp_path / "dark.png")
    (tmp_path / "scene.toml").write_text(SCENE)
    return str(tmp_path / "scene.toml")


def planned(source: str, resolution: tuple[int, int] | None = None) -> int | None:
    return plan_project(open_project(source, resolution), lambda step: None).bounces


def edited(source: str, resolution: tuple[int, int] | None = None) -> int:
    """How many bounces the editor takes."""
    editor = Editor(InProcessClient(Tasks()), source, resolution=resolution)
    end = time.monotonic() + 300.0
    while not (editor.scene_is_open and editor.view.n_bounces):
        assert time.monotonic() < end and not editor.status.is_error, editor.status
        editor.tick()
    return editor.view.n_bounces


def rendered(source: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many a still has."""
    found: list[int] = []

    def note(placement: Any, layers: Any, sky: Any, series: Any) -> Any:
        found.append(series.n_bounces)
        yield None
        return np.zeros((len(placement.hits.pixel), 3))

    monkeypatch.setattr(stills, "indirect_radiance", note)
    stills.render_picture(open_project(source), lambda step: None, n_lights=100)
    return found[0] if found else 1


def test_plan_still_and_editor_take_as_many_bounces(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert planned(scene) == 3  # 0.18 of the light goes on at each: 0.6 % after three, 3 % after two
    assert edited(scene) == 3
    assert rendered(scene, monkeypatch) == 3


def test_a_number_that_a_session_has_counts(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = open_project(scene).document
    session = str(save_session(tmp_path / "work.insitu", document, ViewState(n_bounces=2)))
    plan = plan_project(open_project(session), lambda step: None)
    assert (plan.bounces, plan.reasons["bounces"]) == (2, "as the session says")
    assert rendered(session, monkeypatch) == 2 and edited(session) == 2


def test_precompute_finds_the_indirect_light_that_the_editor_will_want(scene: str) -> None:
    stages: list[str] = []

    def note(progress: Progress) -> None:
        stages.append(progress.stage)

    precompute(open_project(scene), note, 100)
    assert "indirect light" in stages


GROUND = ground((160, 120))


def test_main_memory_is_told_within_a_third(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(GROUND)
    plan = plan_project(open_project(str(file)), lambda step: None)
    peak = 0
    # What the system keeps as a process's peak begins with what its parent had.
    with psutil.Popen([sys.executable, "-m", "app", "precompute", str(file)], stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            with contextlib.suppress(psutil.Error):
                peak = max(peak, process.memory_info().rss)
            time.sleep(0.01)
    assert process.returncode == 0 and plan.cost is not None
    assert plan.cost.memory_mib == pytest.approx(peak / 2**20, rel=0.3)


@pytest.mark.sweep
@pytest.mark.parametrize("name", builtin_scenes())
def test_they_agree_on_built_in_scenes_that_do_not_say(name: str, tmp_path: Path) -> None:
    for file in builtin_scenes()[name].parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    scene = tmp_path / "scene.toml"
    scene.write_text(re.sub(r"(?m)^bounces = .*$", "", scene.read_text()))
    assert planned(str(scene), (64, 48)) == edited(str(scene), (64, 48))
