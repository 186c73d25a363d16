"""A sky that turns or is exchanged over a scene that was made ready for it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import LightState, MixRow
from app.document.scene_state import LayerState, SceneState
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import (
    ComputeTransport,
    LayerPicture,
    LightsReady,
    PrepareRelighting,
    RelightingPrepared,
    StageDone,
)
from app.worker import relighting
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.render.picture_difference import errors
from engine.settings import RenderSettings
from tests.opened import open_in_process, run_in_process
from tests.pictures import write_exr
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled

SCENE = (
    camera((0.4, 1.6, 2.6), 45, (32, 24))
    + environment(file="sky.exr")
    + placed("ground", "quad", facing_up(5))
    + placed("ball", "sphere", scaled(0.9, (0, 0.5, 0)))
)
LAMP = placed("lamp", "quad", facing_down(1, (-1.2, 2.4, 0)), "emission = [3, 3, 3]\n")
METAL = "ball.0"
TWICE = Operator("amplify", "y", 0.0, 0.0, np.pi / 2, np.pi / 2, magnitude=2.0)
LAYERS = (
    LayerState("ground.0", make_layer(MODELS["lambert"]), (8,)),
    LayerState(METAL, make_layer(MODELS["rough_conductor"], {"alpha": 0.3}), (16, 4)),
)


def skylight(shift: int = 0) -> np.ndarray:
    radiance = np.ones((16, 32, 3), np.float32) * np.float32((0.5, 0.7, 1.0))
    radiance[3:6, 4 + shift : 9 + shift] += np.float32((12.0, 9.0, 6.0))
    return radiance


def opened(folder: Path, text: str = SCENE) -> RequestDispatcher:
    write_exr(folder / "sky.exr", skylight())
    (folder / "scene.toml").write_text(text)
    tasks = RequestDispatcher(ArrayCache(folder / "cache"))
    open_in_process(tasks, str(folder / "scene.toml"))
    return tasks


def asked(light: LightState, n_final: int = 240, emission=(), layers=LAYERS) -> ComputeTransport:
    scene, decisions = SceneState(light, layers, emission), RenderSettings(n_final or 240)
    return ComputeTransport(scene, METAL, "theta_h", 40, decisions, is_drag=n_final == 0)


def turning(rotation: float, **changes: object) -> ComputeTransport:
    return asked(LightState(rotation=rotation), 0, **changes)  # type: ignore[arg-type]


def pictures(answers: list[Response], stage: str) -> dict[str, np.ndarray]:
    return {a.key: np.array(a.radiance) for a in answers if isinstance(a, LayerPicture) and a.stage == stage}


def ready(tasks: RequestDispatcher, **changes: object) -> dict[str, np.ndarray]:
    """Make the picture at no rotation, and be ready for others; the picture."""
    request = asked(LightState(), **changes)  # type: ignore[arg-type]
    final = pictures(run_in_process(tasks, request), "final")
    answers = run_in_process(tasks, PrepareRelighting(request.scene))
    assert [type(a) for a in answers] == [LightsReady, RelightingPrepared] and answers[1].transport_bytes > 0
    return final


def test_a_turned_sky_lights_every_pixel_as_its_own_transport_does(tmp_path: Path) -> None:
    tasks = opened(tmp_path)
    before = ready(tasks)
    answers = run_in_process(tasks, turning(110.0))
    found = pictures(answers, "relit")
    assert not pictures(answers, "drag") and [a.exact for a in answers if isinstance(a, StageDone)] == [True]
    truth = pictures(run_in_process(tasks, asked(LightState(rotation=110.0))), "final")
    quick = pictures(run_in_process(opened(tmp_path), turning(110.0)), "drag")
    for key, picture in truth.items():
        off = errors(found[key], picture).rmse
        assert off < 0.06 and errors(before[key], picture).rmse > 3 * off
        assert len(quick[key]) < len(picture)  # as it is without


@pytest.mark.parametrize(("most", "limit"), [(relighting.MOST_POINTS, 0.05), (200, 0.15)])
def test_the_shadow_of_a_sun_turns_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int, limit: float
) -> None:
    """200: shadows at every second pixel, as of a large picture, and the exact ones once it is idle."""
    monkeypatch.setattr(relighting, "MOST_POINTS", most)
    tasks = opened(tmp_path)
    sunny = np.repeat(np.repeat(skylight(), 8, axis=0), 8, axis=1)
    sunny[32:34, 160:162] = 8000.0
    write_exr(tmp_path / "sunny.exr", sunny)
    sun = LightState(environment=str(tmp_path / "sunny.exr"))
    final = pictures(run_in_process(tasks, asked(sun, 1500)), "final")
    run_in_process(tasks, PrepareRelighting(asked(sun).scene))
    begun = pictures(run_in_process(tasks, asked(sun, 0)), "relit")
    found = pictures(run_in_process(tasks, asked(replace(sun, rotation=37.0), 0)), "relit")
    truth = pictures(run_in_process(tasks, asked(replace(sun, rotation=37.0), 1500)), "final")
    for key, picture in truth.items():
        np.testing.assert_allclose(begun[key], final[key], rtol=1e-4, atol=1e-5 * final[key].max())
        off = errors(found[key], picture).rmse
        assert off < limit and (off > 0.05) == (most == 200), key


def test_no_turn_is_the_exact_picture_and_a_walk_of_turns_is_one_turn(tmp_path: Path) -> None:
    tasks = opened(tmp_path)
    final = ready(tasks)
    same = pictures(run_in_process(tasks, turning(0.0)), "relit")
    walk = np.random.default_rng(5).uniform(0.0, 360.0, 4)
    once = pictures(run_in_process(tasks, turning(77.0)), "relit")
    for rotation in (*walk, 77.0):
        last = pictures(run_in_process(tasks, turning(float(rotation))), "relit")
    for key, picture in final.items():
        np.testing.assert_allclose(same[key], picture, rtol=1e-4, atol=1e-5 * picture.max())
        np.testing.assert_array_equal(last[key], once[key])


def test_a_constant_sky_may_turn_as_it_likes(tmp_path: Path) -> None:
    tasks = opened(tmp_path, SCENE.replace('file = "sky.exr"', "radiance = [0.4, 0.5, 0.7]"))
    final = ready(tasks)
    turned = pictures(run_in_process(tasks, turning(200.0)), "relit")
    for key, picture in final.items():
        np.testing.assert_allclose(turned[key], picture, rtol=1e-3)


def test_rows_last_as_long_as_their_material(tmp_path: Path) -> None:
    tasks = opened(tmp_path)
    ready(tasks)
    bent = replace(LAYERS[1], layer=LAYERS[1].layer.with_operators("theta_h", [TWICE]))
    edited = (LAYERS[0], bent)
    answers = run_in_process(tasks, turning(40.0, layers=edited))
    assert set(pictures(answers, "relit")) == {"ground.0"} and set(pictures(answers, "drag")) == {METAL}
    before = pictures(run_in_process(tasks, turning(40.0)), "relit")[METAL]  # undone: they are still there
    ready(tasks, layers=edited)
    after = pictures(run_in_process(tasks, turning(40.0, layers=edited)), "relit")[METAL]
    np.testing.assert_allclose(after, 2.0 * before, atol=0.1 * before.mean())


def test_another_environment_comes_first_without_ghosts_of_the_one_before(tmp_path: Path) -> None:
    tasks = opened(tmp_path)
    ready(tasks)
    write_exr(tmp_path / "other.exr", skylight(15))
    other = LightState(environment=str(tmp_path / "other.exr"))
    answers = run_in_process(tasks, asked(other))
    stages = [a.stage for a in answers if isinstance(a, LayerPicture)]
    assert stages[:2] == ["relit"] * 2 and "coarse" not in stages and stages[-1] == "final"
    truth = pictures(answers, "final")
    for key, picture in pictures(answers, "relit").items():
        assert errors(picture, truth[key]).rmse < 0.15


def test_lamps_stay_as_they_are_while_the_sky_turns(tmp_path: Path) -> None:
    tasks, lit = opened(tmp_path, SCENE + LAMP), (("lamp", (3.0, 3.0, 3.0)),)
    ready(tasks, emission=lit)
    found = pictures(run_in_process(tasks, turning(110.0, emission=lit)), "relit")
    truth = pictures(run_in_process(tasks, asked(LightState(rotation=110.0), emission=lit)), "final")
    for key, picture in truth.items():
        assert errors(found[key], picture).rmse < 0.06


@pytest.mark.parametrize("unlit_by", ["light.environment", "lamp"])
def test_a_sky_turns_over_objects_that_a_light_excludes(tmp_path: Path, unlit_by: str) -> None:
    """The ball is lit by the lamp alone, or by the sky alone; the ground by both."""
    tasks, lit = opened(tmp_path, SCENE + LAMP), (("lamp", (3.0, 3.0, 3.0)),)
    linked = LightState().with_row(unlit_by, MixRow(excludes=("ball",)))
    final = pictures(run_in_process(tasks, asked(linked, emission=lit)), "final")
    run_in_process(tasks, PrepareRelighting(asked(linked, emission=lit).scene))
    turned = replace(linked, rotation=110.0)
    found = pictures(run_in_process(tasks, asked(turned, 0, lit)), "relit")
    truth = pictures(run_in_process(tasks, asked(turned, emission=lit)), "final")
    assert found.keys() == truth.keys() == final.keys()
    for key, picture in truth.items():
        assert errors(found[key], picture).rmse < 0.06
    of_ball = errors(final[METAL], truth[METAL]).rmse
    assert of_ball < 0.01 if unlit_by == "light.environment" else of_ball > 0.2
    # Other links are other light: rows say nothing of these.
    free = run_in_process(tasks, asked(LightState(rotation=110.0), 0, lit))
    assert not pictures(free, "relit") and pictures(free, "drag").keys() == truth.keys()


def test_emitters_that_are_dimmed_together_are_dimmed_at_every_pixel(tmp_path: Path) -> None:
    two = LAMP + LAMP.replace('"lamp"', '"other"').replace("-1.2", "1.2")
    tasks, lit = opened(tmp_path, SCENE + two), (("lamp", (3.0, 3.0, 3.0)), ("other", (1.0, 2.0, 3.0)))
    final = ready(tasks, emission=lit)
    for factor in (0.4, 2.5):
        changed = tuple((name, (factor * r, factor * g, factor * b)) for name, (r, g, b) in lit)
        found = pictures(run_in_process(tasks, turning(0.0, emission=changed)), "relit")
        truth = pictures(run_in_process(tasks, asked(LightState(), emission=changed)), "final")
        for key, picture in truth.items():
            off = errors(found[key], picture).rmse
            assert off < 0.06 and errors(final[key], picture).rmse > 3 * off
        ready(tasks, emission=lit)
    # One of them alone: by its own picture, as long as the sky is as it was.
    one = (("lamp", (1.0, 1.0, 1.0)), lit[1])
    found = pictures(run_in_process(tasks, turning(0.0, emission=one)), "relit")
    truth = pictures(run_in_process(tasks, asked(LightState(), emission=one)), "final")
    assert all(errors(found[key], picture).rmse < 0.06 for key, picture in truth.items())
    turned = run_in_process(tasks, turning(30.0, emission=one))
    assert not pictures(turned, "relit") and set(pictures(turned, "drag")) == set(final)


@pytest.mark.parametrize("n_made", [1, 3])
def test_what_is_given_up_half_way_leaves_what_is_whole(tmp_path: Path, n_made: int) -> None:
    tasks = opened(tmp_path)
    request = asked(LightState())
    run_in_process(tasks, request)
    steps = tasks.handle(PrepareRelighting(request.scene))
    for _ in range(16 + n_made):
        next(steps)
    steps.close()  # type: ignore[attr-defined]
    n_ready = len(pictures(run_in_process(tasks, turning(40.0)), "relit"))
    assert n_ready < 2
    ready(tasks)
    assert len(pictures(run_in_process(tasks, turning(40.0)), "relit")) == 2
