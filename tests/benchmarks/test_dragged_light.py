"""The figures of a dragged light, from what its program says, and that program on a small scene."""

import functools
import json
from pathlib import Path
from typing import Any

import pytest

import benchmarks.dragged_light as dragged_light
from app.worker.client import Client
from benchmarks.dragged_light import DRAGS, NAMES, DragEffort, drag_figures
from benchmarks.figures import SPECS, NotMeasured
from benchmarks.programs import dragged_light as program
from benchmarks.programs import renderer
from tests.app.worker.ball_and_lamp import SCENE
from tests.ui.quick_worker import HANDLERS


def found_by(name: str, *others: Any) -> dict[str, dict[str, float]]:
    if name == "vase":
        raise NotMeasured("no vase")
    return {
        "turned by 5°": {"error": 0.01, "indirect": 0.005, "jump": 0.5, "first_step_s": 1.0, "step_s": 0.2},
        "turned by 30°": {"error": 0.04, "indirect": 0.02, "jump": 1.5, "first_step_s": 0.3, "step_s": 0.4},
    }


def test_the_worst_drag_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dragged_light, "measure_dragged_light", found_by)
    figures = {each.name: each for each in drag_figures(DragEffort(), lambda line: None)}
    assert set(figures) == set(NAMES) <= SPECS.keys() and set(DRAGS) == {"room", "vase", "teatray"}
    assert figures["drag_error_room"].value == 0.04 and figures["drag_error_room"].met
    assert figures["drag_indirect_error_room"].value == 0.02
    assert figures["drag_error_vase"].value is None and "no vase" in figures["drag_error_vase"].how
    assert figures["drag_jump"].value == 1.5 and len(figures["drag_jump"].parts) == 4


@pytest.mark.parametrize("name", NAMES)
def test_a_quick_run_leaves_them_out(name: str) -> None:
    assert name in [figure.name for figure in drag_figures(None, lambda line: None)]


def test_the_program_finds_a_picture_near_the_exact_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.setattr(renderer, "Client", functools.partial(Client, HANDLERS))
    monkeypatch.setattr(program, "EditorRig", functools.partial(renderer.EditorRig, n_lights=200))
    output = tmp_path / "out.json"
    arguments = [str(tmp_path / "scene.toml"), str(output), "--resolution", "32", "24", "--bounces", "3"]
    assert program.main([*arguments, "--turns", "20", "--dims", "0.5"]) == 0
    found = json.loads(output.read_text())
    assert set(found) == {"turned by 20°", "emitters at 0.5"}
    for each in found.values():
        assert 0.0 < each["indirect"] < 0.02 < each["error"] < 0.3 and 0.0 < each["jump"] < 10.0
