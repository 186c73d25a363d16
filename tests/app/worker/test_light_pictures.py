"""A mix of lights over a scene that was made ready for it: a weighted sum of pictures of each light alone."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import ENVIRONMENT_KEY, LightState, MixRow
from app.document.scene_state import SceneState
from app.document.single_lights import light_weights
from app.messages.worker_messages import Response
from app.modes.placement.placement_messages import (
    ComputeTransport,
    FreezeIndirect,
    IndirectFrozen,
    IndirectRelit,
    LayerPicture,
    LightsReady,
    PrepareRelighting,
    RelightingPrepared,
)
from app.worker import light_pictures
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.light.sides import SIDES
from engine.light.suns import Sun
from engine.render.picture_difference import errors
from tests.app.worker.ball_and_lamp import GLOSS, SCENE, Recorder, compute, opened, tiles_of, twice
from tests.opened import run_in_process
from tests.scene_text import facing_down, placed

SIDE = placed("side", "quad", facing_down(0.5, (1.0, 1.8, 0.4)), "emission = [4, 4, 8]\n")
NOON = Sun((0.3, 0.9, 0.3), (1.5, 1.2, 0.9), 4.0, "Noon")
GLOSSY = compute().scene.layers[2]
LAMPS = (("lamp", (6.0, 5.0, 4.0)), ("side", (4.0, 4.0, 8.0)))


def mixed(
    gain: float = 1.0,
    sun: float = 1.0,
    lamps: tuple[float, float] = (1.0, 1.0),
    is_drag: bool = False,
    n_bounces: int = 1,
) -> ComputeTransport:
    """The request of a scene under four lights, times these factors."""
    light = LightState(own_suns=(NOON,), new_suns=(NOON.scaled(sun),))
    light = light.with_row(ENVIRONMENT_KEY, MixRow(colour=(gain, gain, gain)))
    emission = tuple(
        (name, (factor * r, factor * g, factor * b)) for (name, (r, g, b)), factor in zip(LAMPS, lamps, strict=True)
    )
    request = compute(n_bounces=n_bounces, is_drag=is_drag)
    return replace(request, scene=SceneState(light, request.scene.layers, emission))


MIXES = {
    "brighter": {"lamps": (2.0, 1.0)},
    "three quarters of all": {"gain": 0.75, "sun": 0.75, "lamps": (0.75, 0.75)},
    "no sky": {"gain": 0.0, "sun": 0.0},
    "the sun alone": {"gain": 0.0, "lamps": (0.0, 0.0)},
    "a little of each": {"gain": 3.0, "sun": 0.1, "lamps": (0.5, 7.0)},
}


@pytest.fixture
def tasks(tmp_path: Path) -> RequestDispatcher:
    (tmp_path / "scene.toml").write_text(SCENE + SIDE)
    return opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "cache"))


def pictures(answers: list[Response], stage: str) -> dict[str, np.ndarray]:
    return {a.key: np.array(a.radiance) for a in answers if isinstance(a, LayerPicture) and a.stage == stage}


def prepare(tasks: RequestDispatcher, request: ComputeTransport) -> RelightingPrepared:
    coarse, prepared = run_in_process(tasks, PrepareRelighting(request.scene))
    assert isinstance(coarse, LightsReady) and isinstance(prepared, RelightingPrepared)
    return prepared


def prepare_coarsely(tasks: RequestDispatcher, request: ComputeTransport, n_steps: int = 0) -> None:
    """Make it ready as far as its lights can be mixed, and some steps further."""
    steps = tasks.handle(PrepareRelighting(request.scene))
    assert any(isinstance(answer, LightsReady) for answer in steps)
    for _ in itertools.islice(steps, n_steps):
        pass
    steps.close()  # type: ignore[attr-defined]


def test_the_weights_are_what_each_light_sends() -> None:
    scene = mixed(gain=0.5, sun=2.0, lamps=(0.0, 1.0)).scene
    weights = light_weights(scene.light, scene.emission)
    assert list(weights.values()) == [(0.5, 0.5, 0.5), (3.0, 2.4, 1.8), (0.0, 0.0, 0.0), (4.0, 4.0, 8.0)]
    # Lights are the same ones in any mix, and a lamp under any sky.
    plain = mixed().scene
    assert weights.keys() == light_weights(plain.light, plain.emission).keys()
    turned = light_weights(replace(plain.light, rotation=40.0), plain.emission)
    assert [light.emitter for light in turned.keys() & weights.keys()] in (["lamp", "side"], ["side", "lamp"])


def test_the_sides_of_a_sky_are_mixed_as_their_own_transport_makes_it(tasks: RequestDispatcher) -> None:
    def of_sides(up: float, others: float = 1.0, is_drag: bool = False) -> ComputeTransport:
        rows = {f"light.sides.{name}": others for name in SIDES} | {"light.sides.up": up}
        light = replace(mixed().scene.light, sides=True)
        light = light.with_rows({key: MixRow(colour=(gain, gain, gain)) for key, gain in rows.items()})
        request = mixed(is_drag=is_drag)
        return replace(request, scene=replace(request.scene, light=light))

    run_in_process(tasks, of_sides(1.0))
    assert prepare(tasks, of_sides(1.0)).n_lights == 9
    for up, others in ((3.0, 1.0), (1.0, 0.0)):
        found = pictures(run_in_process(tasks, of_sides(up, others, is_drag=True)), "relit")
        truth = pictures(run_in_process(tasks, of_sides(up, others)), "final")
        for key, picture in truth.items():
            assert errors(found[key], picture).rmse < 0.01
        run_in_process(tasks, of_sides(1.0))
        prepare(tasks, of_sides(1.0))


def test_a_mix_is_as_its_own_transport_makes_it(tasks: RequestDispatcher) -> None:
    final = pictures(run_in_process(tasks, mixed()), "final")
    prepared = prepare(tasks, mixed())
    assert prepared.n_lights == 4
    assert prepared.transport_bytes > 5 * sum(picture.nbytes for picture in final.values())
    found = {name: pictures(run_in_process(tasks, mixed(**mix, is_drag=True)), "relit") for name, mix in MIXES.items()}
    same = pictures(run_in_process(tasks, mixed(is_drag=True)), "relit")
    for key, picture in final.items():
        np.testing.assert_allclose(same[key], picture, rtol=1e-4, atol=1e-5 * picture.max())
        np.testing.assert_allclose(found["three quarters of all"][key], 0.75 * picture, rtol=1e-3, atol=1e-4)
    for name, mix in MIXES.items():
        truth = pictures(run_in_process(tasks, mixed(**mix)), "final")
        for key, picture in truth.items():
            # Each of both has about half a percent from so few lights of its own.
            assert errors(found[name][key], picture).rmse < 0.02, (name, key)


def linked(request: ComputeTransport) -> ComputeTransport:
    """The same where a lamp does not reach the ground, and the sun not the ball."""
    light = request.scene.light.with_row("lamp", MixRow(excludes=("ground",)))
    light = light.with_row("light.Noon", MixRow(excludes=("ball",)))
    return replace(request, scene=replace(request.scene, light=light))


def test_a_mix_of_linked_lights_is_as_its_own_transport_makes_it(tasks: RequestDispatcher) -> None:
    plain = pictures(run_in_process(tasks, mixed()), "final")
    final = pictures(run_in_process(tasks, linked(mixed())), "final")
    assert all(picture.mean() < 0.95 * plain[key].mean() for key, picture in final.items())
    assert prepare(tasks, linked(mixed())).n_lights == 4
    request = linked(mixed(sun=3.0, lamps=(4.0, 1.0)))
    found = pictures(run_in_process(tasks, replace(request, is_drag=True)), "relit")
    truth = pictures(run_in_process(tasks, request), "final")
    for key, picture in truth.items():
        assert errors(found[key], picture).rmse < 0.02, key
    # Other links make other pictures: those that are stored are not of them.
    assert not pictures(run_in_process(tasks, mixed(sun=3.0, is_drag=True)), "relit")


def test_pictures_of_single_lights_are_made_once(tasks: RequestDispatcher, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Recorder()
    monkeypatch.setattr(light_pictures, "project_layer", made)
    final = pictures(run_in_process(tasks, mixed()), "final")
    prepare(tasks, mixed())
    # Under each light a coarse tile of every layer before the others.
    assert made.n_tiles == 4 * (len(final) + tiles_of(*final.values()))
    # Another mix needs nothing, another curve of a layer only that layer.
    run_in_process(tasks, mixed(gain=2.0))
    prepare(tasks, mixed(gain=2.0))
    assert made.n_tiles == 4 * (len(final) + tiles_of(*final.values()))
    edited = mixed(gain=2.0)
    layers = tuple(twice(each, "theta_h") if each.key == GLOSS else each for each in edited.scene.layers)
    edited = replace(edited, scene=replace(edited.scene, layers=layers))
    run_in_process(tasks, edited)
    prepare(tasks, edited)
    assert made.n_tiles == 4 * (len(final) + 1 + tiles_of(*final.values(), final[GLOSS]))


def test_coarse_pictures_of_each_light_come_first(tasks: RequestDispatcher) -> None:
    final = pictures(run_in_process(tasks, mixed()), "final")
    prepare_coarsely(tasks, mixed())
    same = pictures(run_in_process(tasks, mixed(is_drag=True)), "relit")
    brighter = mixed(gain=1.5, lamps=(1.0, 2.0))
    found = pictures(run_in_process(tasks, replace(brighter, is_drag=True)), "relit")
    truth = pictures(run_in_process(tasks, brighter), "final")
    for key, picture in final.items():
        np.testing.assert_allclose(same[key], picture, rtol=1e-4, atol=1e-5 * picture.max())
        # The ball is as wide as three coarse samples: more than half of the change is there.
        assert errors(found[key], truth[key]).rmse < 0.5 * errors(picture, truth[key]).rmse, key


@pytest.mark.parametrize("seed", range(2))
def test_any_sequence_of_mixes_is_near_the_transport_of_the_last(
    tasks: RequestDispatcher, tmp_path: Path, seed: int
) -> None:
    """Preparing is given up anywhere; a mix as it was at rest shows the exact picture, whatever is coarse by then."""
    chance, request, n_mixed = random.Random(seed), mixed(), 0
    final = pictures(run_in_process(tasks, request), "final")
    steps = chance.choices(("drag", "drag", "rest", "prepare", "give up", "give up", "curve"), k=5)
    for step in ("give up", "drag", *steps):
        match step:
            case "drag":
                mix = chance.choice(list(MIXES.values()))
                light, emission = mixed(**mix).scene.light, mixed(**mix).scene.emission
                dragged = replace(request, is_drag=True, scene=SceneState(light, request.scene.layers, emission))
                found = pictures(run_in_process(tasks, dragged), "relit")
                assert all(np.isfinite(each).all() and (each >= 0.0).all() for each in found.values())
                same = pictures(run_in_process(tasks, replace(request, is_drag=True)), "relit")
                for key, picture in same.items():
                    np.testing.assert_allclose(picture, final[key], rtol=1e-4, atol=1e-4 * final[key].max())
                n_mixed += len(same)
                run_in_process(tasks, request)
            case "rest":
                mix = chance.choice(list(MIXES.values()))
                request = replace(request, scene=replace(mixed(**mix).scene, layers=request.scene.layers))
                final |= pictures(run_in_process(tasks, request), "final")
            case "prepare":
                prepare(tasks, request)
            case "give up":
                prepare_coarsely(tasks, request, chance.randrange(60))
            case "curve":
                layers = (*request.scene.layers[:2], chance.choice((GLOSSY, twice(GLOSSY, "theta_h"))))
                request = replace(request, scene=replace(request.scene, layers=layers))
                final |= pictures(run_in_process(tasks, request), "final")
    prepare(tasks, request)
    assert n_mixed > 0
    last = mixed(gain=2.0, lamps=(0.5, 1.0)).scene
    last = replace(request, scene=replace(last, layers=request.scene.layers))
    found = pictures(run_in_process(tasks, replace(last, is_drag=True)), "relit")
    fresh = opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "other"))
    for key, picture in pictures(run_in_process(fresh, last), "final").items():
        assert errors(found[key], picture).rmse < 0.02, key


def test_a_layer_of_another_material_is_not_mixed(tasks: RequestDispatcher) -> None:
    run_in_process(tasks, mixed())
    prepare(tasks, mixed())
    request = mixed(lamps=(2.0, 1.0), is_drag=True)
    layers = tuple(twice(each, "theta_h") if each.key == GLOSS else each for each in request.scene.layers)
    found = pictures(run_in_process(tasks, replace(request, scene=replace(request.scene, layers=layers))), "relit")
    assert set(found) == {"ground.0", "ball.0"}


def test_a_single_light_is_a_multiple_of_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.toml").write_text(SCENE[: SCENE.index('[[object]]\nname = "lamp"')])
    tasks, made = opened(str(tmp_path / "scene.toml"), ArrayCache(tmp_path / "cache")), Recorder()
    monkeypatch.setattr(light_pictures, "project_layer", made)
    request = compute()
    final = pictures(run_in_process(tasks, request), "final")
    assert prepare(tasks, request).n_lights == 1 and not made.n_tiles
    light = request.scene.light.with_row(ENVIRONMENT_KEY, MixRow(colour=(0.5, 2.0, 0.0)))
    bright = replace(request, is_drag=True, scene=SceneState(light, request.scene.layers))
    found = pictures(run_in_process(tasks, bright), "relit")
    assert found.keys() == final.keys()
    for key, picture in found.items():
        np.testing.assert_allclose(picture, final[key] * np.float32((0.5, 2.0, 0.0)), rtol=1e-5)


def test_pictures_that_take_too_much_memory_are_not_made(
    tasks: RequestDispatcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(light_pictures, "MOST_PICTURE_BYTES", 1e3)
    run_in_process(tasks, mixed())
    assert prepare(tasks, mixed()).n_lights == 0
    assert not pictures(run_in_process(tasks, mixed(lamps=(2.0, 1.0), is_drag=True)), "relit")


def test_indirect_light_is_mixed_as_well(tasks: RequestDispatcher) -> None:
    """By albedo the sum over lights is exact but for the noise of each one's samples."""
    run_in_process(tasks, mixed(n_bounces=2))
    frozen = [
        each for each in run_in_process(tasks, FreezeIndirect(mixed().scene, second_bands=1))
        if isinstance(each, IndirectFrozen)
    ][-1]  # fmt: skip
    prepare(tasks, mixed(n_bounces=2))

    def relit(**mix: object) -> IndirectRelit:
        answers = run_in_process(tasks, mixed(**mix, is_drag=True, n_bounces=2))  # type: ignore[arg-type]
        (found,) = [each for each in answers if isinstance(each, IndirectRelit)]
        return found

    same = relit()
    for key, light in same.now.items():
        np.testing.assert_allclose(light, same.resting[key], rtol=1e-6)
        known = frozen.unit * frozen.light.reflected[frozen.keys.index(key)][:, 0].T
        assert errors(same.resting[key], known).rmse < 0.1
    halved = relit(gain=0.5, sun=0.5, lamps=(0.5, 0.5))
    dark = relit(gain=0.0, sun=0.0, lamps=(0.0, 0.0))
    for key, light in halved.now.items():
        np.testing.assert_allclose(light, 0.5 * same.now[key], rtol=1e-5)
        np.testing.assert_allclose(halved.gloss[key], 0.5, rtol=1e-5)
        assert not dark.now[key].any() and not dark.gloss[key].any() and not dark.mirrored[key].any()
