"""The worker's work on a tiny scene: what it says in which order, what it keeps, and that it goes on where it was."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document import LightState
from app.jobs import placement as placement_module
from app.jobs.array_record import read_record, write_record
from app.jobs.cache import Store
from app.jobs.client import Client
from app.jobs.in_process import InProcessClient
from app.jobs.placement import _stages
from app.jobs.tasks import Tasks
from app.looking import what_is_missing
from app.messages import Failed, Progress, Response, SceneOpened, SceneSeen, SkyImage, WorkerRestarted
from app.placement.messages import (
    ComputeTransport,
    Contract,
    ErrorEstimated,
    EstimateError,
    LayerPicture,
    LayerTransport,
    StageDone,
    StageFootprint,
)
from app.scene_state import LayerState, SceneState
from engine.curve import wavelet
from engine.curve.operators import Operator
from engine.light.environment import load_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.plan import N_PATCHES
from engine.transport.bandstore import BandTile
from engine.transport.pipeline import COARSE, PREVIEW
from engine.transport.projection import project_layer
from tests.opened import ask_for_scene, open_in_process, run_in_process
from tests.pictures import write_exr

SCENE = """version = 1
bounces = 1
[camera]
position = [0.4, 1.6, 2.6]
target = [0, 0.3, 0]
fov_y = 45
resolution = [48, 48]
[environment]
radiance = [0.4, 0.5, 0.7]
[[object]]
name = "ground"
primitive = "quad"
transform = [5,0,0,0, 0,0,5,0, 0,-5,0,0, 0,0,0,1]
layer = [{ model = "lambert" }]
[[object]]
name = "ball"
primitive = "sphere"
transform = [0.9,0,0,0, 0,0.9,0,0.5, 0,0,0.9,0, 0,0,0,1]
layer = [{ model = "lambert" }, { model = "rough_conductor", alpha = 0.3 }]
[[object]]
name = "lamp"
primitive = "quad"
transform = [1,0,0,-1.2, 0,0,-1,2.4, 0,1,0,0, 0,0,0,1]
emission = [6, 5, 4]
"""
PREVIEW_LIGHTS, FINAL_LIGHTS = 80, 480
BANDS = {"lambert": (8,), "rough_conductor": (16, 4)}
GLOSS = "ball.1"
TWICE = Operator("amplify", "y", 0.0, 0.0, np.pi / 2, np.pi / 2, magnitude=2.0)


def work(key: str, model: str, **parameters: object) -> LayerState:
    return LayerState(key, make_layer(MODELS[model], parameters), BANDS[model])


def compute(selected: str | None = GLOSS, factor: str | None = "theta_h", **changes: object) -> ComputeTransport:
    layers = (work("ground.0", "lambert"), work("ball.0", "lambert"), work(GLOSS, "rough_conductor", alpha=0.3))
    scene = SceneState(LightState(), layers)
    request = ComputeTransport(scene, selected, factor, PREVIEW_LIGHTS, FINAL_LIGHTS, N_PATCHES)
    return replace(request, **changes)


def lit(request: ComputeTransport, light: LightState) -> ComputeTransport:
    """The request under another light."""
    return replace(request, scene=replace(request.scene, light=light))


def twice(state: LayerState, *factors: str) -> LayerState:
    """The layer with some of its curves twice as high."""
    for factor in factors:
        state = replace(state, layer=state.layer.with_operators(factor, [TWICE]))
    return state


@pytest.fixture
def source(tmp_path: Path) -> str:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return str(path)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "cache")


def opened(source: str, store: Store) -> Tasks:
    tasks = Tasks(store)
    assert any(isinstance(answer, SceneSeen) for answer in open_in_process(tasks, source))
    return tasks


def without_progress(answers: list[Response]) -> list[Response]:
    return [answer for answer in answers if not isinstance(answer, Progress)]


def pictures(answers: list[Response], stage: str = "final") -> dict[str, np.ndarray]:
    return {a.key: np.array(a.radiance) for a in answers if isinstance(a, LayerPicture) and a.stage == stage}


def assert_same_pictures(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    assert set(found) == set(expected) == {"ground.0", "ball.0", GLOSS}
    for key, picture in expected.items():
        assert picture.max() > 0
        np.testing.assert_array_equal(found[key], picture)


# ----------------------------------------------------------------------------------------------------------- messages


def test_an_opened_scene_tells_what_the_window_needs(source: str, store: Store) -> None:
    answers = open_in_process(Tasks(store), source)
    assert [type(answer) for answer in answers] == [Progress, SceneOpened, Progress, SceneSeen]
    frame = answers[-1].frame
    n_points = frame.n_pixels
    assert (frame.width, frame.height) == (48, 48)
    # The lamp shines and has no points; the other two share them all.
    assert frame.object_ranges.tolist()[-1] == [n_points, n_points]
    assert ((frame.theta_o >= 0) & (frame.theta_o <= np.float32(np.pi / 2))).all()
    assert frame.theta_o.shape == (n_points,)
    # Frames for lobes drawn over the picture: half floats, turned to the eye.
    normal, tangent = (array.astype(np.float64) for array in (frame.normal, frame.tangent))
    rays = frame.ray_directions.reshape(-1, 3)[frame.pixel]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=2e-3)
    np.testing.assert_allclose(np.einsum("pk,pk->p", normal, tangent), 0.0, atol=2e-3)
    np.testing.assert_allclose(-np.einsum("pk,pk->p", normal, rays), np.cos(frame.theta_o), atol=2e-3)


def test_the_resolution_can_be_another(source: str, store: Store) -> None:
    answers = open_in_process(Tasks(store), source, resolution=(20, 12))
    assert answers[-1].frame.object_image.shape == (12, 20)


def test_stages_come_coarse_to_fine_with_the_selected_layer_first(source: str, store: Store) -> None:
    tasks = opened(source, store)
    answers = without_progress(run_in_process(tasks, compute()))
    one_stage = [LayerPicture, LayerTransport, LayerPicture, LayerPicture, StageDone]
    assert [type(answer) for answer in answers] == [SkyImage, StageFootprint, *3 * one_stage]
    assert [(a.stage, a.exact) for a in answers if isinstance(a, StageDone)] == [
        ("coarse", False), ("preview", False), ("final", True)
    ]  # fmt: skip
    keys = [a.key for a in answers if isinstance(a, LayerPicture)]
    assert keys == 3 * [GLOSS, "ground.0", "ball.0"]
    assert answers[-1].transport_bytes > 0
    # A second request for the same light does not send the sky again.
    assert not any(isinstance(a, SkyImage) for a in run_in_process(tasks, compute()))


def test_a_file_is_read_by_the_mapping_of_the_light(source: str, store: Store, tmp_path: Path) -> None:
    tasks = opened(source, store)
    probe = tmp_path / "probe.exr"
    write_exr(probe, np.random.default_rng(3).uniform(0.0, 2.0, (32, 32, 3)).astype(np.float32))
    found = {}
    for mapping in ("latlong", "angular"):
        answers = run_in_process(tasks, lit(compute(), LightState(str(probe), mapping)))  # type: ignore[arg-type]
        (sky,) = (a.radiance for a in answers if isinstance(a, SkyImage))
        np.testing.assert_array_equal(sky, load_environment(probe, mapping).radiance)  # type: ignore[arg-type]
        found[mapping] = pictures(answers)[GLOSS]
    # Another sky, another picture: nothing of the first was taken for the second.
    assert np.abs(found["latlong"] - found["angular"]).max() > 0.05 * found["latlong"].max()


def test_a_coarse_stage_says_which_samples_stand_for_each_pixel(source: str, store: Store) -> None:
    tasks = Tasks(store)
    frame = open_in_process(tasks, source)[-1].frame
    answers = run_in_process(tasks, compute(selected=None, factor=None))
    assert not any(isinstance(answer, LayerTransport) for answer in answers)
    (coarse,) = (a for a in answers if isinstance(a, StageFootprint))
    assert coarse.stage == "coarse"  # in finer ones every pixel has its own
    assert coarse.rows.shape == coarse.weights.shape == (frame.n_pixels, 4)
    begin, end = frame.object_ranges[1]
    n_samples = len(pictures(answers, "coarse")[GLOSS])
    assert 0 < n_samples < (end - begin) / 8 and coarse.rows[begin:end].max() == n_samples - 1


def test_progress_only_grows_within_a_stage(source: str, store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = opened(source, store)
    monkeypatch.setattr(placement_module.time, "monotonic", iter(np.arange(0.0, 1e4, 0.1)).__next__)
    told = [a for a in run_in_process(tasks, compute()) if isinstance(a, Progress)]
    for stage in ("coarse", "preview", "final"):
        fractions = [a.fraction for a in told if a.stage == stage]
        assert fractions == sorted(fractions) and fractions[0] >= 0.0
        assert 0.8 < fractions[-1] <= 1.0  # the end is near where it is said to be


def test_a_light_on_the_move_gets_one_quick_stage(source: str, store: Store) -> None:
    tasks = opened(source, store)
    answers = without_progress(run_in_process(tasks, compute(n_lights_final=0)))
    assert [(a.stage, a.exact) for a in answers if isinstance(a, StageDone)] == [("drag", True)]


def test_emitters_are_cut_at_last_as_asked() -> None:
    for n_patches in (20, 3000):
        stages = _stages(compute(n_patches=n_patches))
        assert [quality.n_patches for quality, _ in stages] == [COARSE.n_patches, PREVIEW.n_patches, n_patches]


def test_a_preview_alone_is_exact_when_no_more_lights_are_asked_for(source: str, store: Store) -> None:
    tasks = opened(source, store)
    answers = run_in_process(tasks, compute(n_lights_final=PREVIEW_LIGHTS))
    assert [(a.stage, a.exact) for a in answers if isinstance(a, StageDone)] == [("coarse", False), ("preview", True)]


def test_transport_times_the_curve_is_the_picture(source: str, store: Store) -> None:
    answers = run_in_process(opened(source, store), compute())
    transport = [a for a in answers if isinstance(a, LayerTransport)][-1]
    curve = wavelet.forward(work(GLOSS, "rough_conductor", alpha=0.3).coefficients[0])
    planes = transport.coefficients_first.astype(np.float64) * np.asarray(transport.scale).reshape(-1, 1, 1)
    picture = np.einsum("jpc,jc->pc", planes, curve)
    expected = pictures(answers)[GLOSS]
    # Half floats, scaled a plane: 2⁻¹¹ of each plane's largest value.
    np.testing.assert_allclose(picture, expected, atol=3e-3 * expected.max())
    norms = np.sqrt(np.einsum("jpc,jpc->jc", planes, planes))
    np.testing.assert_allclose(transport.norms, norms, rtol=2e-3, atol=1e-3 * norms.max())


# ------------------------------------------------------------------------------------------------------- contractions


def contraction(factor: str | None, brighter: bool = False) -> Contract:
    asked = work(GLOSS, "rough_conductor", alpha=0.3)
    return Contract(twice(asked, *asked.factors) if brighter else asked, factor)


def test_a_curve_is_switched_after_the_transport(source: str, store: Store) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, compute()))[GLOSS]
    picture, transport = run_in_process(tasks, contraction("theta_d", brighter=True))
    # Both curves twice as high: four times the light.
    np.testing.assert_allclose(picture.radiance, 4 * before, rtol=1e-6)
    assert (transport.factor, len(transport.coefficients_first)) == ("theta_d", 4)


def test_the_same_transport_comes_in_either_precision(source: str, store: Store) -> None:
    tasks = opened(source, store)
    half = [a for a in run_in_process(tasks, compute()) if isinstance(a, LayerTransport)][-1]
    picture, full = run_in_process(tasks, replace(contraction("theta_h"), precision="float"))
    assert isinstance(picture, LayerPicture) and isinstance(full, LayerTransport)
    assert (half.precision, full.precision) == ("half", "float")
    planes = [np.asarray(t.coefficients_first * t.scale[:, None, None]) for t in (half, full)]
    largest = np.abs(planes[1]).max(axis=(1, 2), keepdims=True)
    assert (np.abs(planes[0] - planes[1]) <= 2.0**-11 * np.abs(planes[1]) + 2.0**-21 * largest).all()
    assert not np.array_equal(planes[0], planes[1])
    # What follows keeps the precision that was asked for last.
    later = run_in_process(tasks, compute(precision="float", n_lights_final=PREVIEW_LIGHTS))
    assert {a.precision for a in later if isinstance(a, LayerTransport)} == {"float"}


def test_a_picture_alone_leaves_the_selection(source: str, store: Store) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, compute(selected="ground.0", factor="theta_i")))[GLOSS]
    (picture,) = run_in_process(tasks, contraction(None, brighter=True))
    np.testing.assert_allclose(picture.radiance, 4 * before, rtol=1e-6)
    later = run_in_process(tasks, compute(selected=None, factor=None, n_lights_final=PREVIEW_LIGHTS))
    assert {a.key for a in later if isinstance(a, LayerTransport)} == {"ground.0"}


def test_a_curve_of_the_model_before_is_selected_no_longer(source: str, store: Store) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, compute(n_lights_final=PREVIEW_LIGHTS))
    other = with_layer(compute(), GLOSS, layer=make_layer(MODELS["lambert"]), bands=BANDS["lambert"]).scene
    answers = run_in_process(tasks, compute(scene=other, selected=None, factor=None, n_lights_final=PREVIEW_LIGHTS))
    assert isinstance(answers[-1], StageDone) and not any(isinstance(a, LayerTransport) for a in answers)


def test_layers_that_share_a_curve_get_their_transport_as_well(source: str, store: Store) -> None:
    tasks = opened(source, store)
    quickly = {"n_lights_final": PREVIEW_LIGHTS, "selected": "ball.0", "factor": "theta_i"}
    answers = run_in_process(tasks, compute(**quickly, followers=("ground.0",)))
    assert {a.key for a in answers if isinstance(a, LayerTransport)} == {"ball.0", "ground.0"}
    nothing = {"selected": None, "factor": None, "n_lights_final": PREVIEW_LIGHTS}

    def coming() -> set[tuple[str, str]]:
        later = run_in_process(tasks, compute(**nothing))
        return {(a.key, a.factor) for a in later if isinstance(a, LayerTransport)}

    run_in_process(tasks, contraction("theta_h"))
    assert coming() == {(GLOSS, "theta_h")}
    run_in_process(tasks, Contract(work("ground.0", "lambert"), "theta_i", beside=True))
    assert coming() == {(GLOSS, "theta_h"), ("ground.0", "theta_i")}


def test_a_transport_alone_comes_without_the_picture(source: str, store: Store) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, compute())
    (transport,) = run_in_process(tasks, replace(contraction("theta_d"), picture=False))
    assert isinstance(transport, LayerTransport) and transport.factor == "theta_d"


def test_a_contraction_is_served_while_the_transport_is_computed(source: str, store: Store) -> None:
    client = InProcessClient(opened(source, store))
    client.send(compute())
    answers: list[Response] = []
    while not any(isinstance(a, StageDone) for a in answers):
        answers += client.poll(0.0)
    number = client.send(contraction("theta_d", brighter=True))
    rest = client.poll(float("inf"))
    own = [a for a in rest if a.id == number]
    assert [(type(a), a.stage) for a in own] == [(LayerPicture, "coarse"), (LayerTransport, "coarse")]
    assert rest.index(own[0]) < 4
    # The stages that follow use the new curves, and hand out the transport of the curve that is now selected.
    later = [a for a in rest if isinstance(a, LayerTransport) and a.id != number]
    assert [(a.stage, a.factor) for a in later] == [("preview", "theta_d"), ("final", "theta_d")]
    expected = contraction("theta_d", brighter=True).layer.coefficients[0]
    np.testing.assert_array_equal([a for a in rest if isinstance(a, LayerPicture)][-3].coefficients[0], expected)


def test_a_contraction_before_its_transport_is_answered_by_it(source: str, store: Store) -> None:
    client = InProcessClient(opened(source, store))
    client.send(compute(selected="ground.0", factor="theta_i"))
    while not any(isinstance(a, Progress | SkyImage) for a in client.poll(0.0)):
        pass
    client.send(contraction("theta_d"))
    answers = client.poll(float("inf"))
    first = next(a for a in answers if isinstance(a, LayerTransport))
    assert (first.key, first.factor) == (GLOSS, "theta_d")


# ------------------------------------------------------------------------------------------ what is not made again


def with_layer(request: ComputeTransport, key: str, **changes: object) -> ComputeTransport:
    """The request with one of its layers changed."""
    layers = tuple(replace(w, **changes) if w.key == key else w for w in request.scene.layers)
    return replace(request, scene=replace(request.scene, layers=layers))


def done(answers: list[Response]) -> dict[str, int]:
    """The stages that were made, with the bytes of transport after each."""
    return {a.stage: a.transport_bytes for a in answers if isinstance(a, StageDone)}


FIXED = with_layer(compute(selected="ground.0", factor="theta_i"), GLOSS, fixed=True)
FREE = compute(selected="ground.0", factor="theta_i")


def test_a_fixed_layer_looks_the_same_and_keeps_no_bands(source: str, store: Store, tmp_path: Path) -> None:
    free = run_in_process(opened(source, store), FREE)
    fixed = run_in_process(opened(source, Store(tmp_path / "another")), FIXED)
    for stage in ("coarse", "preview", "final"):
        for key, picture in pictures(free, stage).items():
            np.testing.assert_array_equal(pictures(fixed, stage)[key], picture)
    n_bands = 16 * 4
    n_points = len(pictures(fixed)[GLOSS])
    # Its picture takes 12 bytes a point; its bands take a scale, a start, two bytes a row and some of 4 an entry.
    assert done(fixed)["final"] < done(free)["final"] + n_points * (12 - 4 - 8 - 2 * 16)
    assert done(fixed)["final"] > done(free)["final"] + n_points * (12 - 4 - 8 - 2 * 16 - 4 * n_bands)


def test_a_fixed_layer_has_no_transport_to_hand_out(source: str, store: Store) -> None:
    tasks = opened(source, store)
    answers = run_in_process(tasks, with_layer(compute(), GLOSS, fixed=True))
    assert not [a for a in answers if isinstance(a, LayerTransport)]
    assert run_in_process(tasks, contraction("theta_h")) == []


def test_a_layer_that_becomes_editable_is_made_alone_and_in_one_stage(
    source: str, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, FIXED))
    recorder = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", recorder)
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
    source: str, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = opened(source, store)
    first = run_in_process(tasks, FREE)
    recorder = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", recorder)
    second = run_in_process(tasks, FIXED)
    assert recorder.n_tiles == 0
    assert_same_pictures(pictures(second), pictures(first))
    assert done(second)["final"] < done(first)["final"]


def test_another_curve_of_a_fixed_layer_is_another_picture(source: str, store: Store) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, FIXED))
    brighter = twice(work(GLOSS, "rough_conductor", alpha=0.3), "theta_h").layer
    after = run_in_process(tasks, with_layer(FIXED, GLOSS, layer=brighter))
    assert set(pictures(after)) == set(before) and set(pictures(after, "coarse")) == {GLOSS}
    np.testing.assert_allclose(pictures(after)[GLOSS], 2 * before[GLOSS], rtol=1e-5)
    np.testing.assert_array_equal(pictures(after)["ground.0"], before["ground.0"])


def test_a_quotient_is_made_again_coarse_to_fine_and_for_its_layer_alone(
    source: str, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, FREE)
    rough = work(GLOSS, "rough_conductor", alpha=0.5).layer
    recorder = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", recorder)
    answers = run_in_process(tasks, with_layer(FREE, GLOSS, layer=rough))
    shown = [pictures(answers, stage) for stage in ("coarse", "preview", "final")]
    assert [set(stage) for stage in shown] == [{GLOSS}, {GLOSS}, {GLOSS, "ball.0", "ground.0"}]
    assert recorder.n_tiles == tiles_of(*(stage[GLOSS] for stage in shown))
    expected = with_layer(FREE, GLOSS, layer=rough)
    for key, picture in pictures(run_in_process(opened(source, store), expected)).items():
        np.testing.assert_allclose(shown[-1][key], picture, rtol=1e-6)


def test_each_picture_that_is_told_comes_with_its_footprint(source: str, store: Store) -> None:
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


def test_what_belongs_to_the_view_outlives_the_request_that_brought_it(source: str, store: Store) -> None:
    client = InProcessClient(opened(source, store))
    view = ask_for_scene(client, source)
    first = client.send(FREE)
    answers = client.poll(float("inf"))
    of_view = [a for a in answers if isinstance(a, StageFootprint | SkyImage)]
    assert {a.id for a in of_view} == {view} and len(of_view) == 2
    assert {a.id for a in answers if isinstance(a, LayerPicture)} == {first}


def test_only_what_was_made_under_the_newest_light_is_handed_out(source: str, store: Store) -> None:
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


def test_another_light_makes_all_of_it_again(source: str, store: Store) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, FREE)
    turned = run_in_process(tasks, lit(FREE, LightState(rotation=90.0)))
    assert [len(pictures(turned, stage)) for stage in ("coarse", "preview", "final")] == [3, 3, 3]


# ---------------------------------------------------------------------------------------------------- cache and resume


class Recorder:
    """Stands in for `project_layer`: counts the tiles computed, and raises after so many."""

    def __init__(self, fail_after: int | None = None) -> None:
        self.n_tiles = 0
        self.fail_after = fail_after

    def __call__(self, hits, rows, light, layer, skip=frozenset()) -> Iterator[BandTile]:
        for tile in project_layer(hits, rows, light, layer, skip):
            if self.n_tiles == self.fail_after:
                raise RuntimeError("the power went out")
            self.n_tiles += 1
            yield tile


def tiles_of(*shown: np.ndarray) -> int:
    """How many tiles of 256 points layers with these pictures have."""
    return sum(-(-len(picture) // 256) for picture in shown)


def test_what_was_computed_before_comes_from_the_cache(source: str, store: Store, monkeypatch) -> None:
    expected = pictures(run_in_process(opened(source, store), compute()))
    recorder = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", recorder)
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)
    assert recorder.n_tiles == 0


@pytest.mark.parametrize(
    "n_kept", [pytest.param(0, marks=pytest.mark.sweep), 1, pytest.param(4, marks=pytest.mark.sweep)]
)
def test_it_resumes_after_the_last_complete_tile(source: str, tmp_path: Path, monkeypatch, n_kept: int) -> None:
    whole = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", whole)
    expected = pictures(run_in_process(opened(source, Store(tmp_path / "fresh")), compute()))
    broken = Recorder(whole.n_tiles - tiles_of(*expected.values()) + n_kept)
    monkeypatch.setattr(placement_module, "project_layer", broken)
    assert "a defect" in failure(run_in_process(opened(source, Store(tmp_path / "cache")), compute()))
    again = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", again)
    assert_same_pictures(pictures(run_in_process(opened(source, Store(tmp_path / "cache")), compute())), expected)
    assert again.n_tiles == whole.n_tiles - n_kept


def test_a_cancelled_transport_keeps_what_is_whole(source: str, store: Store, monkeypatch) -> None:
    steps = opened(source, store).handle(compute())
    final_pictures = (a for a in steps if isinstance(a, LayerPicture) and a.stage == "final")
    assert next(final_pictures).key == GLOSS
    steps.close()
    recorder = Recorder()
    monkeypatch.setattr(placement_module, "project_layer", recorder)
    answers = run_in_process(opened(source, store), compute())
    coarse, final = pictures(answers, "coarse"), pictures(answers)
    # The selected layer's final transport was there already; all else is computed, in three stages.
    assert coarse.keys() == final.keys() - {GLOSS}
    others = [final[key] for key in coarse]
    assert recorder.n_tiles == tiles_of(*coarse.values()) + 2 * tiles_of(*others)


def test_a_damaged_cache_is_computed_again(source: str, store: Store, tmp_path: Path) -> None:
    expected = pictures(run_in_process(opened(source, store), compute()))
    for path in (tmp_path / "cache").iterdir():
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        path.write_bytes(data)
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)


# ----------------------------------------------------------------------------------------------------- what goes wrong


def failure(answers: list[Response]) -> str:
    assert isinstance(answers[-1], Failed) and "\n" not in answers[-1].line
    return answers[-1].line


def test_a_missing_environment_is_named(source: str, store: Store) -> None:
    tasks = opened(source, store)
    line = failure(run_in_process(tasks, lit(compute(), LightState("/nowhere/sky.exr"))))
    assert "/nowhere/sky.exr" in line and "internal" not in line
    # And the scene still stands.
    assert isinstance(run_in_process(tasks, compute(n_lights_final=0))[-1], StageDone)


def test_a_broken_environment_is_named(source: str, store: Store, tmp_path: Path) -> None:
    path = tmp_path / "sky.exr"
    path.write_bytes(b"not a picture")
    line = failure(run_in_process(opened(source, store), lit(compute(), LightState(str(path)))))
    assert "sky.exr" in line and "nothing was changed" in line


def test_a_scene_that_is_not_there_is_named(store: Store) -> None:
    line = failure(open_in_process(Tasks(store), "/nowhere/scene.toml"))
    assert "/nowhere/scene.toml" in line


NOTHING, LAMPS = "no surface, the background alone", "lamps alone"


@pytest.mark.parametrize(("target", "sees"), [("[0.4, 9, 2.7]", NOTHING), ("[-1.2, 2.4, 0]", LAMPS)])
def test_a_camera_that_sees_nothing_to_edit_has_a_picture_of_that(
    tmp_path: Path, store: Store, target: str, sees: str
) -> None:
    path = tmp_path / "scene.toml"
    text = SCENE.replace("target = [0, 0.3, 0]", f"target = {target}").replace("fov_y = 45", "fov_y = 8")
    path.write_text(text.replace("0,0,5,0, 0,-5,0,0", "0,0,0.1,0, 0,-0.1,0,0"))
    tasks = Tasks(store)
    seen = next(a for a in open_in_process(tasks, str(path)) if isinstance(a, SceneSeen))
    assert seen.frame.n_pixels == 0 and what_is_missing(seen.frame) == f"the camera sees {sees}"
    answers = run_in_process(tasks, compute(n_bounces=2))
    assert {key: len(picture) for key, picture in pictures(answers).items()} == dict.fromkeys(pictures(answers), 0)
    assert isinstance(answers[-1], StageDone) and answers[-1].exact
    scene = compute().scene
    assert [type(a) for a in run_in_process(tasks, EstimateError(scene))][-1] is ErrorEstimated


def test_a_picture_that_is_not_there_is_not_judged_in_silence(source: str, store: Store) -> None:
    tasks = opened(source, store)
    nothing_yet = failure(run_in_process(tasks, EstimateError(compute().scene)))
    assert nothing_yet.startswith("the error is estimated of a whole picture")
    run_in_process(tasks, compute(n_lights_final=0))  # every eighth pixel, while a light is moved
    assert failure(run_in_process(tasks, EstimateError(compute().scene))) == nothing_yet


def test_transport_without_a_scene_is_refused(store: Store) -> None:
    assert failure(run_in_process(Tasks(store), compute())) == "no scene is open"


def test_a_constant_sky_of_the_document_replaces_the_scenes(source: str, store: Store) -> None:
    tasks = opened(source, store)
    dark, bright = (
        pictures(run_in_process(tasks, lit(compute(), LightState("constant", radiance=(v, v, v)))))["ground.0"]
        for v in (0.0, 2.0)
    )
    assert (bright >= dark).all() and bright.mean() > dark.mean() + 0.5


# ------------------------------------------------------------------------------------------------------- a real process


def test_a_killed_worker_goes_on_to_the_same_pictures(source: str, tmp_path: Path, monkeypatch) -> None:
    expected = pictures(run_in_process(opened(source, Store(tmp_path / "fresh")), compute()))
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))
    answers: list[Response] = []
    killed = False
    deadline = time.monotonic() + 600  # only a worker that hangs needs so long
    with Client() as client:
        ask_for_scene(client, source)
        client.send(compute())
        while not any(isinstance(a, StageDone) and a.exact for a in answers):
            assert time.monotonic() < deadline
            client.wait(0.05)
            answers += client.poll()
            if not killed and any(isinstance(a, StageDone) and a.stage == "preview" for a in answers):
                os.kill(client.pid, signal.SIGKILL)
                killed = True
    assert any(isinstance(a, WorkerRestarted) for a in answers) and not any(isinstance(a, Failed) for a in answers)
    # The scene is opened and the stages are gone through once more, to the last bit as if nothing had been.
    assert sum(isinstance(a, SceneOpened) for a in answers) == 2
    assert_same_pictures(pictures(answers), expected)


def rewritten(folder: Path, forge: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]) -> int:
    """Forge what stands in the cache, under the keys and checksums it should have; how many records."""
    count = 0
    for path in folder.iterdir():
        data, records = memoryview(path.read_bytes()), []
        while data:
            records.append(read_record(data))
            data = data[records[-1].n_bytes :]
        with open(path, "wb") as file:
            for record in records:
                write_record(file, record.label, forge(record.arrays))
        count += len(records)
    return count


FORGERIES = {
    "nothing": lambda arrays: {},
    "another name": lambda arrays: {f"{name}s": array for name, array in arrays.items()},
    "another type": lambda arrays: {name: array.astype(np.complex64) for name, array in arrays.items()},
    "too short": lambda arrays: {name: array[:-1] for name, array in arrays.items()},
    "too long": lambda arrays: {name: np.concatenate([array, array]) for name, array in arrays.items()},
    "beyond": lambda arrays: {
        name: array + np.float32(np.inf) if array.dtype.kind == "f" else np.full_like(array, np.iinfo(array.dtype).max)
        for name, array in arrays.items()
        if name != "bits"  # any bit may be set
    },
}


def some_of(*forgeries: str) -> pytest.MarkDecorator:
    """These in every run, all of them in the sweep."""
    rest = [pytest.param(name, marks=pytest.mark.sweep) for name in FORGERIES if name not in forgeries]
    return pytest.mark.parametrize("forgery", [*forgeries, *rest])


@some_of("nothing", "beyond")
def test_a_forged_cache_is_computed_again(source: str, store: Store, tmp_path: Path, forgery: str) -> None:
    expected = pictures(run_in_process(opened(source, store), compute()))
    assert rewritten(tmp_path / "cache", FORGERIES[forgery]) == 5  # visibility, three layers, and the unit they are in
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)
    # What was computed again is kept again.
    assert rewritten(tmp_path / "cache", dict) == 5
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)


@some_of("too short")
def test_forged_tiles_are_computed_again(
    source: str, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forgery: str
) -> None:
    expected = pictures(run_in_process(opened(source, Store(tmp_path / "fresh")), compute()))
    n_coarse = tiles_of(*pictures(run_in_process(opened(source, store), compute(n_lights_final=80)), "coarse").values())
    broken = Recorder(n_coarse + tiles_of(*expected.values()) + 2)  # two tiles of the final stage
    monkeypatch.setattr(placement_module, "project_layer", broken)
    run_in_process(opened(source, store), compute())
    monkeypatch.undo()
    assert [path.suffix for path in (tmp_path / "cache").iterdir()].count(".tiles") == 1
    rewritten(tmp_path / "cache", FORGERIES[forgery])
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)
