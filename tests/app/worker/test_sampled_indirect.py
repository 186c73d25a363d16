"""Rays that the worker traces where edited materials need them, and what becomes of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.scene_state import SceneState
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import (
    EditedSampled,
    FreezeIndirect,
    IndirectFound,
    IndirectFrozen,
    IndirectImproved,
    IndirectNoise,
    SampleEdited,
    SamplingProgress,
)
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.precompute.indirect import edited_sampling, smoothing
from tests.app.worker.ball_and_lamp import GLOSS, SCENE, TWICE, compute, opened
from tests.opened import run_in_process
from tests.quick_indirect import QUICK

REQUEST = compute(None, None, n_bounces=3)


@pytest.fixture
def tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RequestDispatcher:
    monkeypatch.setattr("app.worker.indirect_tasks.FINE", replace(QUICK, n_rays=64, n_photons=1 << 10))
    for module in (smoothing, edited_sampling):
        monkeypatch.setattr(module, "NOISY", 0.03)
    (tmp_path / "scene.toml").write_text(SCENE)
    tasks = opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "cache"))
    run_in_process(tasks, REQUEST)
    return tasks


def edited(scene: SceneState = REQUEST.scene) -> SceneState:
    """The scene with a ball that shines twice as much."""
    layers = tuple(
        replace(each, layer=each.layer.with_operators("theta_h", (TWICE,))) if each.key == GLOSS else each
        for each in scene.layers
    )
    return replace(scene, layers=layers)


def one(answers: list[Response], kind: type) -> Response:
    """The answer of a kind; of freezings, the last."""
    (answer,) = (each for each in answers if isinstance(each, kind) and getattr(each, "is_last", True))
    return answer


def frozen(tasks: RequestDispatcher, scene: SceneState, serial: int = 1) -> list[Response]:
    return run_in_process(tasks, FreezeIndirect(scene, GLOSS, 0, serial=serial))


def test_rays_are_lacking_once_a_material_is_edited(tasks: RequestDispatcher) -> None:
    assert one(frozen(tasks, REQUEST.scene), IndirectNoise).is_sampled
    assert not one(frozen(tasks, edited()), IndirectNoise).is_sampled
    assert one(frozen(tasks, REQUEST.scene), IndirectNoise).is_sampled  # undone before any were traced


def test_each_round_brings_better_light_with_its_freezing_and_noise(tasks: RequestDispatcher) -> None:
    before = frozen(tasks, edited(), serial=7)
    found, noise = one(before, IndirectFrozen), one(before, IndirectNoise)
    answers = run_in_process(tasks, SampleEdited(edited()))
    rounds = [each for each in answers if isinstance(each, IndirectImproved)]
    last = one(answers, EditedSampled)
    assert rounds and answers[-1] is last and last.n_added > 0 and last.noise < 0.8 * last.noise_before
    assert last.noise_before == pytest.approx(noise.noise, rel=1e-5) and last.transport_bytes > 0
    numbers = [found.number]
    for each in rounds:
        assert each.found.number == each.frozen.number == each.noise.number not in numbers
        assert each.frozen.serial == each.noise.serial == 7 and each.frozen.curves == found.curves
        numbers.append(each.found.number)
    assert [each.noise.is_sampled for each in rounds] == [False] * (len(rounds) - 1) + [True]
    assert rounds[-1].noise.noise == last.noise
    fractions = [each.fraction for each in answers if isinstance(each, SamplingProgress)]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    # What is frozen next is of that light, and lacks nothing.
    again = frozen(tasks, edited())
    assert one(again, IndirectFrozen).number == numbers[-1] and one(again, IndirectNoise).is_sampled
    assert not any(isinstance(each, IndirectFound) for each in again)  # it came with the last round


def test_the_light_is_that_of_before_with_less_noise(tasks: RequestDispatcher) -> None:
    before = one(frozen(tasks, edited()), IndirectFrozen)
    run_in_process(tasks, SampleEdited(edited()))
    after = one(frozen(tasks, edited()), IndirectFrozen)
    for i, light in before.light.reflected.items():
        assert after.light.reflected[i].mean() == pytest.approx(light.mean(), rel=0.1)


def test_an_edit_that_is_undone_asks_once_more_and_has_a_filter_of_its_own(tasks: RequestDispatcher) -> None:
    frozen(tasks, edited())
    run_in_process(tasks, SampleEdited(edited()))
    assert not one(frozen(tasks, REQUEST.scene), IndirectNoise).is_sampled
    answers = run_in_process(tasks, SampleEdited(REQUEST.scene))
    assert any(isinstance(each, IndirectImproved) for each in answers)
    assert one(frozen(tasks, REQUEST.scene), IndirectNoise).is_sampled
    # Nothing is left to do.
    assert one(run_in_process(tasks, SampleEdited(REQUEST.scene)), EditedSampled).n_points == 0


@pytest.mark.parametrize("n_steps", [1, 3, 8, 15])
def test_what_is_given_up_leaves_what_is_there(tasks: RequestDispatcher, n_steps: int) -> None:
    before = one(frozen(tasks, edited()), IndirectFrozen)
    steps = tasks.handle(SampleEdited(edited()))
    improved = [each for each, _ in zip(steps, range(n_steps), strict=False) if isinstance(each, IndirectImproved)]
    steps.close()
    after = frozen(tasks, edited())
    assert one(after, IndirectFrozen).number == (improved[-1].found.number if improved else before.number)
    if not improved:
        for i, light in before.light.reflected.items():
            np.testing.assert_array_equal(one(after, IndirectFrozen).light.reflected[i], light)


def test_a_freezing_that_is_requested_meanwhile_is_the_one_that_comes(tasks: RequestDispatcher) -> None:
    frozen(tasks, edited(), serial=1)
    steps = tasks.handle(SampleEdited(edited()))
    while not isinstance(next(steps), SamplingProgress):
        pass
    frozen(tasks, edited(), serial=2)
    rounds = [each for each in steps if isinstance(each, IndirectImproved)]
    assert rounds and all(each.frozen.serial == 2 for each in rounds)


def test_its_memory_counts(tasks: RequestDispatcher) -> None:
    frozen(tasks, edited())
    before = one(run_in_process(tasks, SampleEdited(edited())), EditedSampled)
    [light] = {tasks._workers[0]._indirect.light}
    assert before.transport_bytes > light.n_bytes > light.points.samples.n_bytes
    assert light.points.samples.records.nbytes == 2 * 64 * before.n_sets


def test_a_scene_that_is_opened_again_has_the_light_that_was_found(tasks: RequestDispatcher, tmp_path: Path) -> None:
    frozen(tasks, edited())
    added = one(run_in_process(tasks, SampleEdited(edited())), EditedSampled)
    again = opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "cache"))
    run_in_process(again, REQUEST)
    frozen(again, REQUEST.scene)
    assert len(again._workers[0]._indirect.light.points.samples.rows) == added.n_sets - added.n_added


def test_rays_are_lacking_once_the_light_has_turned(tasks: RequestDispatcher) -> None:
    turned = replace(REQUEST, scene=replace(REQUEST.scene, emission=(("lamp", (2.0, 3.0, 4.0)),)))
    run_in_process(tasks, turned)
    assert not one(frozen(tasks, turned.scene), IndirectNoise).is_sampled
    assert one(run_in_process(tasks, SampleEdited(turned.scene)), EditedSampled).n_added > 0
    assert one(frozen(tasks, turned.scene), IndirectNoise).is_sampled
