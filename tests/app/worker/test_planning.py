"""The worker computes the last stage with as many lights as the picture needs, and finds that again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import LightState
from app.document.scene_state import SceneState
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import ComputeTransport, LayerPicture, LightPlanned
from app.worker import planning as light_plan
from app.worker.cache import ArrayCache
from app.worker.executor import LocalExecutor
from app.worker.tasks import RequestDispatcher
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.linking import LightGroup
from engine.precompute.direct.pipeline import Quality
from engine.render import light_pilot
from engine.render.light_pilot import NOT_FOUND, LightBudget
from engine.settings import RenderSettings
from tests.app.worker.ball_and_lamp import work
from tests.opened import open_in_process, run_in_process
from tests.scene_text import ground

MOST = RenderSettings(4000, keeps_sphere=True)


class Noting(LocalExecutor):
    """Notes how finely light is seen."""

    def __init__(self) -> None:
        self.seen: list[Quality] = []

    def compute_light(self, group: LightGroup, quality: Quality):  # type: ignore[no-untyped-def]
        self.seen.append(quality)
        return super().compute_light(group, quality)


@pytest.fixture(autouse=True)
def every_picture_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_pilot, "PAYS_FROM", 1)


@pytest.fixture
def scene(tmp_path: Path) -> str:
    (tmp_path / "scene.toml").write_text(ground((40, 30)))
    return str(tmp_path / "scene.toml")


def opened(scene: str, store: ArrayCache) -> tuple[RequestDispatcher, Noting]:
    labour = Noting()
    tasks = RequestDispatcher(store, executor=labour)
    open_in_process(tasks, scene)
    return tasks, labour


def compute(**decided: object) -> ComputeTransport:
    layers = (work("ground.0", "lambert"),)
    decisions = replace(MOST, **decided)  # type: ignore[arg-type]
    return ComputeTransport(SceneState(LightState(), layers), "ground.0", "theta_i", 80, decisions)


def last_picture(answers: list[Response]) -> np.ndarray:
    return [answer.radiance for answer in answers if isinstance(answer, LayerPicture) and answer.stage == "final"][-1]


def test_the_last_stage_has_as_many_lights_as_are_needed(scene: str, tmp_path: Path) -> None:
    store = ArrayCache(tmp_path / "cache")
    tasks, labour = opened(scene, store)
    answers = run_in_process(tasks, compute())
    (planned,) = (answer for answer in answers if isinstance(answer, LightPlanned))
    assert planned.n_lights == 500 and dict(planned.reasons)["lights"].endswith("of what 4,000 show")
    assert [(each.name, each.n_lights) for each in labour.seen][-1] == ("final", 500)
    # What a person sets is computed, and differs by next to nothing.
    tasks, labour = opened(scene, ArrayCache(tmp_path / "other"))
    exact = run_in_process(tasks, compute(overridden=frozenset({"lights", "patches"})))
    assert labour.seen[-1].n_lights == 4000 and not [each for each in exact if isinstance(each, LightPlanned)]
    truth, found = last_picture(exact), last_picture(answers)
    assert np.sqrt(np.mean((found - truth) ** 2)) / truth.mean() < 0.005


def test_what_was_found_is_found_again(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the same worker after an edit, by another one on disk, and so is the transport that was made by it."""
    store = ArrayCache(tmp_path / "cache")
    tasks, _ = opened(scene, store)
    first = run_in_process(tasks, compute())

    def refuse(*arguments: object) -> None:
        raise AssertionError("it was tried again")

    monkeypatch.setattr(light_plan, "find_light_budget", refuse)
    brighter = replace(
        compute(), scene=SceneState(LightState(rotation=70.0), (work("ground.0", "lambert", albedo=[0.9] * 3),))
    )
    run_in_process(tasks, brighter)
    other, labour = opened(scene, store)
    again = run_in_process(other, compute())
    assert labour.seen == [] or {each.name for each in labour.seen} <= {"coarse", "preview"}
    assert next(answer for answer in again if isinstance(answer, LightPlanned)).n_lights == 500
    np.testing.assert_array_equal(last_picture(again), last_picture(first))


def test_it_is_tried_with_what_the_file_has_whatever_was_edited_by_then(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A window that was opened on an edited document took another number of lights than the one that had edited it."""
    tried = []

    def noted(placement, layers, sky, *rest):  # type: ignore[no-untyped-def]
        tried.append((sky.rotation, [(each.layer.parameters, each.layer.edits) for each in layers]))
        return (yield from light_pilot.find_light_budget(placement, layers, sky, *rest))

    monkeypatch.setattr(light_plan, "find_light_budget", noted)
    bright, shiny = work("ground.0", "lambert", albedo=[0.9] * 3), work("ground.0", "rough_conductor", alpha=0.77)
    edited, other = (
        replace(compute(), scene=SceneState(LightState(rotation=70.0), (each,))) for each in (bright, shiny)
    )
    for i, request in enumerate((compute(), edited, other)):
        tasks, _ = opened(scene, ArrayCache(tmp_path / str(i)))
        run_in_process(tasks, request)
    assert len(tried) == 3 and tried[0] == tried[1]
    # The file has no such layer: as its model begins.
    assert tried[2] == (0.0, [(make_layer(MODELS["rough_conductor"], {}).parameters, ())])


@pytest.mark.parametrize(
    "errors", [(), (("patches", NOT_FOUND, NOT_FOUND),), (("lights", 0.002, 0.04), ("patches", NOT_FOUND, NOT_FOUND))]
)
def test_a_stored_light_budget_comes_back(tmp_path: Path, errors: tuple[tuple[str, float, float], ...]) -> None:
    """Of a lamp that no sampled point sees no error is known, and stored numbers are finite."""
    cache, need = ArrayCache(tmp_path), LightBudget(500, 768, errors)
    cache.put("budget", light_plan.budget_arrays(need))
    assert cache.get("budget", light_plan.budget_from) == need and cache.take_notes() == ()
