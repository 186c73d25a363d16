"""One decision on bounces: what `insitu plan` says is what a still, `precompute` and the editor take."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.cli import planning as cli_planning
from app.cli.planning import memory_note, plan_project
from app.cli.precompute import carry_out, precompute
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from app.files.session import save_session
from app.messages.worker_messages import Progress
from app.project.project import ProjectSpec, open_project
from app.stills import stills
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError
from engine.planner import Cost, Plan
from engine.scene.builtin import builtin_scenes
from engine.settings import DEFAULT_SETTINGS
from tests.scene_text import camera, ground, material, placed, scaled

# Within a ball whose texture takes four fifths of the light: by its albedo alone it would need four bounces.
DARK = 'model = "lambert", albedo = 0.9, texture = "dark.png", texture_space = "linear"'
SCENE = (
    camera((0, 0, 4), resolution=(16, 12))
    + placed("ball", "sphere", scaled(12), material(DARK))
    + placed("lamp", "sphere", more="emission = 4\n")
)


@pytest.fixture
def scene(tmp_path: Path) -> str:
    Image.fromarray(np.full((4, 4, 3), 51, np.uint8)).save(tmp_path / "dark.png")
    (tmp_path / "scene.toml").write_text(SCENE)
    return str(tmp_path / "scene.toml")


def planned_bounces_of(source: str, resolution: tuple[int, int] | None = None) -> int | None:
    return plan_project(open_project(source, resolution), lambda step: None).settings.n_bounces


def edited(source: str, resolution: tuple[int, int] | None = None) -> int:
    """How many bounces the editor takes."""
    editor = Editor(InProcessClient(RequestDispatcher()), source, resolution=resolution)
    end = time.monotonic() + 300.0
    while not (editor.scene_is_open and editor.view.settings.n_bounces):
        assert time.monotonic() < end and not editor.status.is_error, editor.status
        editor.tick()
    return editor.view.settings.n_bounces


def rendered(source: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many a still has."""
    found: list[int] = []

    def note(placement: Any, layers: Any, sky: Any, series: Any, *finely: Any, **wanted: Any) -> Any:
        found.append(series.n_bounces)
        yield None

    def dark(light: Any, layers: Any, second: Any, hits: Any, third: Any) -> Any:
        yield None
        return np.zeros((len(hits.pixel), 3))

    monkeypatch.setattr(stills, "find_indirect", note)
    monkeypatch.setattr(stills, "reflected_light", dark)
    stills.render_picture(open_project(source), lambda step: None, n_lights=100)
    return found[0] if found else 1


def test_plan_still_and_editor_take_as_many_bounces(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert planned_bounces_of(scene) == 3  # 0.18 of the light goes on at each: 0.6 % after three, 3 % after two
    assert edited(scene) == 3
    assert rendered(scene, monkeypatch) == 3


def test_a_number_that_a_session_has_counts(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = open_project(scene).document
    session = str(save_session(tmp_path / "work.insitu", document, SetView.of(n_bounces=2).apply(ViewState())))
    plan = plan_project(open_project(session), lambda step: None)
    assert (plan.settings.n_bounces, plan.reasons["bounces"]) == (2, "as the session says")
    assert rendered(session, monkeypatch) == 2 and edited(session) == 2


def test_precompute_finds_the_indirect_light_that_the_editor_will_want(scene: str) -> None:
    stages: list[str] = []

    def note(progress: Progress) -> None:
        stages.append(progress.stage)

    precompute(open_project(scene).with_settings(n_lights=100), note)
    assert "indirect light" in stages


GROUND = ground((160, 120))


def test_memory_and_disk_are_reported_within_a_third(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(GROUND)
    plan = plan_project(open_project(str(file)), lambda step: None)
    was = carry_out(ProjectSpec(str(file), (150, 100)))
    assert plan.cost is not None and was.seconds > 0.0
    assert plan.cost.memory_mib == pytest.approx(was.memory_mib, rel=0.3)
    smaller = 150 * 100 / (160 * 120)
    assert 0.7 < smaller * plan.cost.disk_mib / was.disk_mib < 1.3
    assert 0.7 < smaller * plan.cost.editing_mib / was.editing_mib < 1.3


def test_what_cannot_be_carried_out_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InsituError, match="nowhere.toml"):
        carry_out(ProjectSpec(str(tmp_path / "nowhere.toml")))


@pytest.mark.sweep
@pytest.mark.parametrize("name", builtin_scenes())
def test_they_agree_on_built_in_scenes_that_do_not_say(name: str, tmp_path: Path) -> None:
    for file in builtin_scenes()[name].parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    scene = tmp_path / "scene.toml"
    scene.write_text(re.sub(r"(?m)^bounces = .*$", "", scene.read_text()))
    assert planned_bounces_of(str(scene), (64, 48)) == edited(str(scene), (64, 48))


def test_what_the_pilots_take_is_in_the_cost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pilot of 0.3 s, before which the scene took 5 s to open, is in what was spent before shadows are tried."""
    spent: list[float] = []

    def pilot(placement: Any, layers: Any, sky: Any, plan: Plan) -> Any:
        begun = time.process_time()
        while time.process_time() < begun + 0.3:
            pass
        return plan
        yield

    def cost(*arguments: Any, spent_seconds: float, n_lights: int) -> Any:
        spent.append(spent_seconds)
        return arguments[-1]
        yield

    monkeypatch.setattr(cli_planning, "with_light_budget", pilot)
    monkeypatch.setattr(cli_planning, "estimate_cost", cost)
    project = open_project(scene_of(tmp_path, ground((16, 12))))
    plan_project(project, lambda step: None, opening_seconds=5.0)
    assert spent[0] > 5.3


def test_a_plan_that_does_not_fit_into_memory_says_so() -> None:
    cost = Cost(
        1.0, 0.0, 0.0, memory_mib=1024.0, disk_mib=1.0, editing_mib=2048.0, gpu_mib=0.0, n_points=1, n_sampled=1
    )
    plan = Plan((), DEFAULT_SETTINGS, {}, cost=cost)
    assert memory_note(plan, 4 << 30) == memory_note(replace(plan, cost=None), 1) == ""
    assert memory_note(plan, 2 << 30).startswith("to edit it takes 3.0 GiB of main memory, 2.0 GiB are free")
    assert memory_note(plan, 1 << 20).startswith("to precompute it takes 1.0 GiB")


def scene_of(folder: Path, text: str) -> str:
    (folder / "scene.toml").write_text(text)
    return str(folder / "scene.toml")
