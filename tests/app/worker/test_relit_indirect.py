"""Indirect light of a lamp that is dimmed and a sky that turns, as the worker answers a drag."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import LightState, MixRow
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import (
    ComputeTransport,
    FreezeIndirect,
    IndirectFrozen,
    IndirectRelit,
    PrepareRelighting,
    RelightingPrepared,
    StageDone,
)
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.precompute.indirect import relighting
from engine.precompute.indirect.gloss_rows import gloss_rows
from tests.app.worker.ball_and_lamp import SCENE, assert_same_pictures, compute, opened, pictures, twice
from tests.opened import run_in_process
from tests.pictures import write_exr
from tests.quick_indirect import light_quickly

LAMP = (60.0, 50.0, 40.0)


@pytest.fixture
def tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RequestDispatcher:
    light_quickly(monkeypatch)
    (tmp_path / "scene.toml").write_text(SCENE)
    return opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "cache"))


def lit_by(lamp: tuple[float, float, float] = LAMP, is_drag: bool = False, rotation: float = 0.0) -> ComputeTransport:
    request = compute(None, None, n_bounces=3, is_drag=is_drag)
    return replace(
        request, scene=replace(request.scene, light=LightState(rotation=rotation), emission=(("lamp", lamp),))
    )


def frozen(tasks: RequestDispatcher, request: ComputeTransport) -> IndirectFrozen:
    """The exact indirect light under a light, at rest."""
    run_in_process(tasks, request)
    found = run_in_process(tasks, FreezeIndirect(request.scene))
    (answer,) = (each for each in found if isinstance(each, IndirectFrozen))
    return answer


def reflected(answer: IndirectFrozen) -> dict[str, np.ndarray]:
    """The frozen light of each layer by its key, (D, p, 3)."""
    return {answer.keys[i]: light.transpose(1, 2, 0) for i, light in answer.light.reflected.items()}


def relit(tasks: RequestDispatcher, request: ComputeTransport) -> tuple[IndirectRelit, list[Response]]:
    found = run_in_process(tasks, request)
    (answer,) = (each for each in found if isinstance(each, IndirectRelit))
    return answer, found


def test_a_lamp_that_is_dimmed_to_nothing_and_back_has_the_same_picture(tasks: RequestDispatcher) -> None:
    before = frozen(tasks, lit_by())
    assert not before.by_albedo
    sky = dict[str, np.ndarray]()
    for factor in (0.0, 0.5, 2.0):
        answer, found = relit(tasks, lit_by((60 * factor, 50 * factor, 40 * factor), is_drag=True))
        assert answer.number == before.number and isinstance(found[-1], StageDone)
        assert answer.now.keys() == reflected(before).keys()
        sky = sky or answer.now
        for key, resting in answer.resting.items():
            assert resting.shape == reflected(before)[key][0].shape
            assert 0.0 < sky[key].mean() < 0.7 * resting.mean()
            np.testing.assert_allclose(answer.now[key], sky[key] + factor * (resting - sky[key]), rtol=1e-4, atol=1e-6)
            assert (
                min(factor, 1.0) - 1e-5 <= answer.gloss[key].min()
                and answer.gloss[key].max() <= max(factor, 1.0) + 1e-5
            )
    again, _ = relit(tasks, lit_by(is_drag=True))
    for key, now in again.now.items():
        np.testing.assert_array_equal(now, again.resting[key])
    after = frozen(tasks, lit_by())
    for key, light in reflected(before).items():
        np.testing.assert_array_equal(reflected(after)[key], light)


def test_light_that_rested_elsewhere_is_the_same_when_it_is_back(tasks: RequestDispatcher) -> None:
    before, dark = frozen(tasks, lit_by()), frozen(tasks, lit_by((0.0, 0.0, 0.0)))
    for key, light in reflected(dark).items():
        assert dark.unit * light.mean() < 0.7 * before.unit * reflected(before)[key].mean()
    relit(tasks, lit_by((1.0, 1.0, 1.0), is_drag=True))
    after = frozen(tasks, lit_by())
    for key, light in reflected(before).items():
        np.testing.assert_array_equal(reflected(after)[key], light)


def test_nothing_is_relit_before_there_is_light_or_after_another_model(tasks: RequestDispatcher) -> None:
    answers = run_in_process(tasks, lit_by(is_drag=True))
    assert not any(isinstance(each, IndirectRelit) for each in answers)
    frozen(tasks, lit_by())
    request = lit_by(is_drag=True)
    fewer = replace(request, scene=replace(request.scene, layers=request.scene.layers[:-1]))
    assert not any(isinstance(each, IndirectRelit) for each in run_in_process(tasks, fewer))


def test_what_is_prepared_for_other_light_counts_as_memory(tasks: RequestDispatcher) -> None:
    frozen(tasks, lit_by())
    before = run_in_process(tasks, lit_by())[-1]
    *_, prepared = run_in_process(tasks, PrepareRelighting(lit_by().scene))
    assert isinstance(before, StageDone) and isinstance(prepared, RelightingPrepared)
    answer, _ = relit(tasks, lit_by(is_drag=True))
    # Of the sky, of the lamp, and of all other emitters.
    of_sources = 3 * sum(light.nbytes for light in answer.now.values())
    assert prepared.transport_bytes >= before.transport_bytes + of_sources


def sky_file(folder: Path) -> str:
    radiance = np.full((16, 32, 3), 0.3, np.float32)
    radiance[4:7, 18:22] += np.float32((9.0, 7.0, 5.0))
    write_exr(folder / "sky.exr", radiance)
    return str(folder / "sky.exr")


@pytest.mark.parametrize("seed", range(2))
def test_any_sequence_ends_with_the_picture_of_its_last_light(
    tasks: RequestDispatcher, tmp_path: Path, seed: int
) -> None:
    chance, file = random.Random(seed), sky_file(tmp_path)
    request = lit_by()
    n_relit = 0
    for _ in range(7):
        light, scene = request.scene.light, request.scene
        match chance.choice(("turn", "turn", "dim", "environment", "curve", "bounces")):
            case "turn":
                scene = replace(scene, light=replace(light, rotation=float(chance.randrange(360))))
            case "dim":
                scene = replace(scene, emission=(("lamp", tuple(chance.choice((0.0, 0.4, 1.0)) * x for x in LAMP)),))
            case "environment":
                scene = replace(scene, light=replace(light, environment=chance.choice(("scene", file))))
            case "curve":
                layer = compute().scene.layers[2]
                edited = chance.choice((layer, twice(layer, "theta_h")))
                scene = replace(scene, layers=(*scene.layers[:2], edited))
            case "bounces":
                request = replace(request, settings=replace(request.settings, n_bounces=chance.choice((2, 3))))
        request = replace(request, scene=scene)
        if chance.random() < 0.6:
            answers = run_in_process(tasks, replace(request, is_drag=True))
            parts = [each for each in answers if isinstance(each, IndirectRelit)]
            assert all(np.isfinite(light).all() for each in parts for light in (each.now | each.mirrored).values())
            n_relit += len(parts)
        else:
            frozen(tasks, request)
            run_in_process(tasks, PrepareRelighting(request.scene))
    # A light that was not there before: it is found with the curves as they are.
    request = replace(request, scene=replace(request.scene, light=LightState(environment=file, rotation=411.0)))
    run_in_process(tasks, replace(request, is_drag=True))
    found, fresh = frozen(tasks, request), opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "other"))
    truth = frozen(fresh, request)
    for key, light in reflected(truth).items():
        np.testing.assert_allclose(reflected(found)[key], light, rtol=1e-5, atol=1e-7 * light.max())
    assert found.unit == truth.unit and n_relit > 0
    assert_same_pictures(*(pictures(run_in_process(each, request)) for each in (tasks, fresh)))


def test_rows_of_mirrored_light_are_made_once_for_light_that_is_frozen_with_gloss(
    tasks: RequestDispatcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def counted(*inputs):
        made.append(inputs)
        return (yield from gloss_rows(*inputs))

    monkeypatch.setattr(relighting, "gloss_rows", counted)
    monkeypatch.setattr(relighting, "_LEAST_GLOSS", 0.0)
    request = lit_by()
    request = replace(request, scene=replace(request.scene, light=LightState(environment=sky_file(tmp_path))))
    turned = replace(request, scene=replace(request.scene, light=replace(request.scene.light, rotation=40.0)))
    run_in_process(tasks, request)
    for second, n_made in ((1, 0), (None, 1), (None, 1)):
        run_in_process(tasks, request)
        run_in_process(tasks, FreezeIndirect(request.scene, second_bands=second))
        run_in_process(tasks, PrepareRelighting(request.scene))
        assert len(made) == n_made
        answer, _ = relit(tasks, replace(turned, is_drag=True))
        assert any(light.any() for light in answer.mirrored.values()) == (n_made > 0)


@pytest.mark.parametrize(("unlit_by", "has_rows"), [("lamp", True), ("light.environment", False)])
def test_rows_of_mirrored_light_are_made_where_the_whole_sky_reaches_all_objects(
    tasks: RequestDispatcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unlit_by: str, has_rows: bool
) -> None:
    monkeypatch.setattr(relighting, "_LEAST_GLOSS", 0.0)
    request = lit_by()
    name = request.scene.layers[0].object
    light = LightState(environment=sky_file(tmp_path)).with_row(unlit_by, MixRow(excludes=(name,)))
    request = replace(request, scene=replace(request.scene, light=light))
    frozen(tasks, request)
    run_in_process(tasks, PrepareRelighting(request.scene))
    turned = replace(request.scene, light=replace(light, rotation=40.0))
    answer, _ = relit(tasks, replace(request, scene=turned, is_drag=True))
    assert any(each.any() for each in answer.mirrored.values()) == has_rows
