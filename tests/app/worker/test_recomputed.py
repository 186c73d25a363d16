"""What the worker makes again when a part of what was asked changes, and what it keeps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import LightState
from app.messages.worker_messages import Response, SkyImage
from app.modes.placement.placement_messages import (
    LayerPicture,
    LayerTransport,
    StageDone,
    StageFootprint,
)
from app.worker import executor
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from tests.app.worker.ball_and_lamp import (
    GLOSS,
    Recorder,
    assert_same_pictures,
    compute,
    contraction,
    done,
    lit,
    opened,
    pictures,
    tiles_of,
    twice,
    with_layer,
    without_progress,
    work,
)
from tests.opened import ask_for_scene, run_in_process

FIXED = with_layer(compute(selected="ground.0", factor="theta_i"), GLOSS, fixed=True)
FREE = compute(selected="ground.0", factor="theta_i")


def test_a_fixed_layer_looks_the_same_and_keeps_no_bands(source: str, store: ArrayCache, tmp_path: Path) -> None:
    free = run_in_process(opened(source, store), FREE)
    fixed = run_in_process(opened(source, ArrayCache(tmp_path / "another")), FIXED)
    for stage in ("coarse", "preview", "final"):
        for key, picture in pictures(free, stage).items():
            np.testing.assert_array_equal(pictures(fixed, stage)[key], picture)
    n_bands = 16 * 4
    n_points = len(pictures(fixed)[GLOSS])
    # Its picture takes 12 bytes a point; its bands take a scale, a start, two bytes a row and some of 4 an entry.
    assert done(fixed)["final"] < done(free)["final"] + n_points * (12 - 4 - 8 - 2 * 16)
    assert done(fixed)["final"] > done(free)["final"] + n_points * (12 - 4 - 8 - 2 * 16 - 4 * n_bands)


def test_a_fixed_layer_has_no_transport_to_hand_out(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    answers = run_in_process(tasks, with_layer(compute(), GLOSS, fixed=True))
    assert not [a for a in answers if isinstance(a, LayerTransport)]
    assert run_in_process(tasks, contraction("theta_h")) == []


def test_a_layer_that_becomes_editable_is_made_alone_and_in_one_stage(
    source: str, store: ArrayCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, FIXED))
    recorder = Recorder()
    monkeypatch.setattr(executor, "project_layer", recorder)
    answers = without_progress(run_in_process(tasks, replace(FREE, selected=GLOSS, factor="theta_h")))
    assert recorder.n_tiles == tiles_of(before[GLOSS])
    # What is there is told at once, so that the picture stays; then come the bands, which give the same picture.
    told = [(type(a), a.key) for a in answers if isinstance(a, LayerPicture | LayerTransport)]
    assert {key for _, key in told[:3]} == set(before)
    assert told[3:] == [(LayerPicture, GLOSS), (LayerTransport, GLOSS)]
    assert {a.stage for a in answers if isinstance(a, LayerPicture)} == {"final"} == set(done(answers))
    for picture in (a for a in answers if isinstance(a, LayerPicture)):
        np.testing.assert_allclose(picture.radiance, before[picture.key], rtol=1e-5)


def test_a_layer_that_becomes_fixed_is_not_made_again(
    source: str, store: ArrayCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = opened(source, store)
    first = run_in_process(tasks, FREE)
    recorder = Recorder()
    monkeypatch.setattr(executor, "project_layer", recorder)
    second = run_in_process(tasks, FIXED)
    assert recorder.n_tiles == 0
    assert_same_pictures(pictures(second), pictures(first))
    assert done(second)["final"] < done(first)["final"]


def test_another_curve_of_a_fixed_layer_is_another_picture(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, FIXED))
    brighter = twice(work(GLOSS, "rough_conductor", alpha=0.3), "theta_h").layer
    after = run_in_process(tasks, with_layer(FIXED, GLOSS, layer=brighter))
    assert set(pictures(after)) == set(before) and set(pictures(after, "coarse")) == {GLOSS}
    np.testing.assert_allclose(pictures(after)[GLOSS], 2 * before[GLOSS], rtol=1e-5)
    np.testing.assert_array_equal(pictures(after)["ground.0"], before["ground.0"])


def test_a_quotient_is_made_again_coarse_to_fine_and_for_its_layer_alone(
    source: str, store: ArrayCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, FREE)
    rough = work(GLOSS, "rough_conductor", alpha=0.5).layer
    recorder = Recorder()
    monkeypatch.setattr(executor, "project_layer", recorder)
    answers = run_in_process(tasks, with_layer(FREE, GLOSS, layer=rough))
    shown = [pictures(answers, stage) for stage in ("coarse", "preview", "final")]
    assert [set(stage) for stage in shown] == [{GLOSS}, {GLOSS}, {GLOSS, "ball.0", "ground.0"}]
    assert recorder.n_tiles == tiles_of(*(stage[GLOSS] for stage in shown))
    expected = with_layer(FREE, GLOSS, layer=rough)
    for key, picture in pictures(run_in_process(opened(source, store), expected)).items():
        np.testing.assert_allclose(shown[-1][key], picture, rtol=1e-6)


def test_each_picture_comes_with_its_footprint(source: str, store: ArrayCache) -> None:
    client = InProcessClient(opened(source, store))
    client.send(FREE)
    answers: list[Response] = []
    while done(answers).keys() != {"coarse"}:
        answers += client.poll(0.0)
    client.send(replace(FREE, revision=1))
    again = without_progress(client.poll(float("inf")))
    kinds = [(type(a).__name__, a.stage) for a in again if a.revision == 1 and not isinstance(a, StageDone)]
    assert kinds[:3] == [("StageFootprint", "coarse"), ("LayerPicture", "coarse"), ("LayerTransport", "coarse")]
    assert list(done([a for a in again if a.revision == 1])) == ["preview", "final"]


def test_what_belongs_to_the_view_outlives_the_request_that_brought_it(source: str, store: ArrayCache) -> None:
    client = InProcessClient(opened(source, store))
    view = ask_for_scene(client, source)
    first = client.send(FREE)
    answers = client.poll(float("inf"))
    of_view = [a for a in answers if isinstance(a, StageFootprint | SkyImage)]
    assert {a.id for a in of_view} == {view} and len(of_view) == 2
    assert {a.id for a in answers if isinstance(a, LayerPicture)} == {first}


def test_only_what_was_made_under_the_newest_light_is_handed_out(source: str, store: ArrayCache) -> None:
    client = InProcessClient(opened(source, store))
    client.send(FREE)
    client.poll(float("inf"))
    client.send(replace(lit(FREE, LightState(rotation=90.0)), revision=1))
    client.poll(0.0)  # it has begun
    client.send(replace(contraction("theta_h"), revision=1))
    answers = client.poll(float("inf"))
    first = next(a for a in answers if isinstance(a, LayerPicture))
    assert first.stage == "coarse"
    names = [type(a).__name__ for a in answers]
    assert names.index("StageFootprint") < names.index("LayerPicture")


def test_another_light_makes_all_of_it_again(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, FREE)
    turned = run_in_process(tasks, lit(FREE, LightState(rotation=90.0)))
    assert [len(pictures(turned, stage)) for stage in ("coarse", "preview", "final")] == [3, 3, 3]
