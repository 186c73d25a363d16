"""The worker's work on a tiny scene: what it says in which order, and what it says of what goes wrong."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from app.document.light_state import LightState
from app.editor.view_controller import describe_empty_frame
from app.messages.light_path_messages import TraceLightPath
from app.messages.worker_messages import Progress, Response, SceneOpened, SkyImage, ViewTraced
from app.modes.placement.placement_messages import (
    ContractTransport,
    ErrorEstimated,
    EstimateError,
    IndirectFound,
    LayerPicture,
    LayerTransport,
    StageDone,
    StageFootprint,
)
from app.worker import placement_worker as placement_module
from app.worker.cache import ArrayCache
from app.worker.kernels import INDIRECT, Kernels
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from app.worker.transport_stages import stages_of
from engine.curve import wavelet
from engine.light.environment import load_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import COARSE, PREVIEW
from engine.scene.light_paths import LightPath
from tests.app.worker.ball_and_lamp import (
    BANDS,
    GLOSS,
    PREVIEW_LIGHTS,
    SCENE,
    compute,
    contraction,
    failure,
    lit,
    opened,
    pictures,
    with_layer,
    without_progress,
    work,
)
from tests.opened import open_in_process, run_in_process
from tests.pictures import write_exr

# ----------------------------------------------------------------------------------------------------------- messages


def test_an_opened_scene_tells_what_the_window_needs(source: str, store: ArrayCache) -> None:
    answers = open_in_process(RequestDispatcher(store), source)
    assert [type(answer) for answer in answers] == [Progress, SceneOpened, Progress, ViewTraced]
    frame = answers[-1].frame
    n_points = frame.n_points
    assert (frame.width, frame.height) == (32, 32)
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


def test_the_resolution_can_be_another(source: str, store: ArrayCache) -> None:
    answers = open_in_process(RequestDispatcher(store), source, resolution=(20, 12))
    assert answers[-1].frame.object_image.shape == (12, 20)


def test_stages_come_coarse_to_fine_with_the_selected_layer_first(source: str, store: ArrayCache) -> None:
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


class StillCompiling:
    """The kernels of a first start: those of bounces are there when they are asked about a second time."""

    first_time, fraction = True, 0.5

    def __init__(self) -> None:
        self.n_asked = 0

    def wait(self, timeout_s: float) -> bool:
        return True

    def is_ready(self, what: str) -> bool:
        self.n_asked += what == INDIRECT
        return self.n_asked > 1

    def until_ready(self, what: str, goes_first: bool) -> Iterator[None]:
        return iter(())


def test_light_bounces_as_soon_as_that_is_compiled(source: str, store: ArrayCache) -> None:
    kernels = StillCompiling()
    tasks = RequestDispatcher(store, kernels=cast(Kernels, kernels))
    open_in_process(tasks, source)
    request = compute()
    answers = run_in_process(tasks, replace(request, settings=replace(request.settings, n_bounces=2)))
    told = [a.stage for a in answers if isinstance(a, (IndirectFound, StageDone))]
    assert told == ["coarse", "rough", "preview", "fine", "final"]


def test_a_file_is_read_by_the_mapping_of_the_light(source: str, store: ArrayCache, tmp_path: Path) -> None:
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


def test_a_coarse_stage_says_which_samples_stand_for_each_pixel(source: str, store: ArrayCache) -> None:
    tasks = RequestDispatcher(store)
    frame = open_in_process(tasks, source)[-1].frame
    answers = run_in_process(tasks, compute(selected=None, factor=None))
    assert not any(isinstance(answer, LayerTransport) for answer in answers)
    (coarse,) = (a for a in answers if isinstance(a, StageFootprint))
    assert coarse.stage == "coarse"  # in finer ones every pixel has its own
    assert coarse.rows.shape == coarse.weights.shape == (frame.n_points, 4)
    begin, end = frame.object_ranges[1]
    n_samples = len(pictures(answers, "coarse")[GLOSS])
    assert 0 < n_samples < (end - begin) / 8 and coarse.rows[begin:end].max() == n_samples - 1


def test_progress_only_grows_within_a_stage(source: str, store: ArrayCache, monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = opened(source, store)
    monkeypatch.setattr(placement_module.time, "monotonic", iter(np.arange(0.0, 1e4, 0.1)).__next__)
    told = [a for a in run_in_process(tasks, compute()) if isinstance(a, Progress)]
    for stage in ("coarse", "preview", "final"):
        fractions = [a.fraction for a in told if a.stage == stage]
        assert fractions == sorted(fractions) and fractions[0] >= 0.0
        assert 0.8 < fractions[-1] <= 1.0  # the end is near where it is said to be


def test_a_light_on_the_move_gets_one_quick_stage(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    answers = without_progress(run_in_process(tasks, compute(is_drag=True)))
    assert [(a.stage, a.exact) for a in answers if isinstance(a, StageDone)] == [("drag", True)]


def test_emitters_are_cut_at_last_as_asked() -> None:
    for n_patches in (20, 3000):
        stages = stages_of(compute(n_patches=n_patches))
        assert [quality.n_patches for quality, _ in stages] == [COARSE.n_patches, PREVIEW.n_patches, n_patches]


def test_a_preview_alone_is_exact_when_no_more_lights_are_asked_for(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    answers = run_in_process(tasks, compute(n_lights=PREVIEW_LIGHTS))
    assert [(a.stage, a.exact) for a in answers if isinstance(a, StageDone)] == [("coarse", False), ("preview", True)]


def test_transport_times_the_curve_is_the_picture(source: str, store: ArrayCache) -> None:
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


def test_a_curve_is_switched_after_the_transport(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, compute()))[GLOSS]
    picture, transport = run_in_process(tasks, contraction("theta_d", brighter=True))
    # Both curves twice as high: four times the light.
    np.testing.assert_allclose(picture.radiance, 4 * before, rtol=1e-6)
    assert (transport.factor, len(transport.coefficients_first)) == ("theta_d", 4)


def test_the_same_transport_comes_in_either_precision(source: str, store: ArrayCache) -> None:
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
    later = run_in_process(tasks, compute(precision="float", n_lights=PREVIEW_LIGHTS))
    assert {a.precision for a in later if isinstance(a, LayerTransport)} == {"float"}


def test_a_picture_alone_leaves_the_selection(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    before = pictures(run_in_process(tasks, compute(selected="ground.0", factor="theta_i")))[GLOSS]
    (picture,) = run_in_process(tasks, contraction(None, brighter=True))
    np.testing.assert_allclose(picture.radiance, 4 * before, rtol=1e-6)
    later = run_in_process(tasks, compute(selected=None, factor=None, n_lights=PREVIEW_LIGHTS))
    assert {a.key for a in later if isinstance(a, LayerTransport)} == {"ground.0"}


def test_a_curve_of_the_model_before_is_selected_no_longer(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, compute(n_lights=PREVIEW_LIGHTS))
    other = with_layer(compute(), GLOSS, layer=make_layer(MODELS["lambert"]), bands=BANDS["lambert"]).scene
    answers = run_in_process(tasks, compute(scene=other, selected=None, factor=None, n_lights=PREVIEW_LIGHTS))
    assert isinstance(answers[-1], StageDone) and not any(isinstance(a, LayerTransport) for a in answers)


def test_layers_that_share_a_curve_get_their_transport_as_well(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    quickly = {"n_lights": PREVIEW_LIGHTS, "selected": "ball.0", "factor": "theta_i"}
    answers = run_in_process(tasks, compute(**quickly, followers=("ground.0",)))
    assert {a.key for a in answers if isinstance(a, LayerTransport)} == {"ball.0", "ground.0"}
    nothing = {"selected": None, "factor": None, "n_lights": PREVIEW_LIGHTS}

    def coming() -> set[tuple[str, str]]:
        later = run_in_process(tasks, compute(**nothing))
        return {(a.key, a.factor) for a in later if isinstance(a, LayerTransport)}

    run_in_process(tasks, contraction("theta_h"))
    assert coming() == {(GLOSS, "theta_h")}
    run_in_process(tasks, ContractTransport(work("ground.0", "lambert"), "theta_i", beside=True))
    assert coming() == {(GLOSS, "theta_h"), ("ground.0", "theta_i")}


def test_a_transport_alone_comes_without_the_picture(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    run_in_process(tasks, compute())
    (transport,) = run_in_process(tasks, replace(contraction("theta_d"), picture=False))
    assert isinstance(transport, LayerTransport) and transport.factor == "theta_d"


def test_a_contraction_is_served_while_the_transport_is_computed(source: str, store: ArrayCache) -> None:
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


def test_a_contraction_before_its_transport_is_answered_by_it(source: str, store: ArrayCache) -> None:
    client = InProcessClient(opened(source, store))
    client.send(compute(selected="ground.0", factor="theta_i"))
    while not any(isinstance(a, Progress | SkyImage) for a in client.poll(0.0)):
        pass
    client.send(contraction("theta_d"))
    answers = client.poll(float("inf"))
    first = next(a for a in answers if isinstance(a, LayerTransport))
    assert (first.key, first.factor) == (GLOSS, "theta_d")


# ----------------------------------------------------------------------------------------------------- what goes wrong


def test_what_hides_a_placed_light_is_named(source: str, store: ArrayCache) -> None:
    """Seen from (2.8, 2, 0), the floor at x = 0.8 mirrors what is up along (-1, 1, 0): the ball, 0.9 m wide, is in the
    way, and at x = 3 it is not. The lamp itself never is."""
    tasks = RequestDispatcher(store)
    open_in_process(tasks, source)
    for x, line in ((0.8, "lamp is placed, but ball hides it from that point"), (3.0, "")):
        path = LightPath("lamp", (x, 0.0, 0.0), (0.0, 1.0, 0.0), (x + 2.0, 2.0, 0.0), 9.0)
        assert [answer.line for answer in run_in_process(tasks, TraceLightPath(path))] == [line]


def test_a_missing_environment_is_named(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    line = failure(run_in_process(tasks, lit(compute(), LightState("/nowhere/sky.exr"))))
    assert "/nowhere/sky.exr" in line and "internal" not in line
    # And the scene still stands.
    assert isinstance(run_in_process(tasks, compute(is_drag=True))[-1], StageDone)


def test_a_broken_environment_is_named(source: str, store: ArrayCache, tmp_path: Path) -> None:
    path = tmp_path / "sky.exr"
    path.write_bytes(b"not a picture")
    line = failure(run_in_process(opened(source, store), lit(compute(), LightState(str(path)))))
    assert "sky.exr" in line and "nothing was changed" in line


def test_a_scene_that_is_not_there_is_named(store: ArrayCache) -> None:
    line = failure(open_in_process(RequestDispatcher(store), "/nowhere/scene.toml"))
    assert "/nowhere/scene.toml" in line


NOTHING, LAMPS = "no surface, the background alone", "lamps alone"


@pytest.mark.parametrize(("target", "sees"), [("[0.4, 9, 2.7]", NOTHING), ("[-1.2, 2.4, 0]", LAMPS)])
def test_a_camera_that_sees_nothing_to_edit_has_a_picture_of_that(
    tmp_path: Path, store: ArrayCache, target: str, sees: str
) -> None:
    path = tmp_path / "scene.toml"
    text = SCENE.replace("target = [0, 0.3, 0]", f"target = {target}").replace("fov_y = 45", "fov_y = 8")
    path.write_text(text.replace("0,0,5,0, 0,-5,0,0", "0,0,0.1,0, 0,-0.1,0,0"))
    tasks = RequestDispatcher(store)
    seen = next(a for a in open_in_process(tasks, str(path)) if isinstance(a, ViewTraced))
    assert seen.frame.n_points == 0 and describe_empty_frame(seen.frame) == f"the camera sees {sees}"
    answers = run_in_process(tasks, compute(n_bounces=2))
    assert {key: len(picture) for key, picture in pictures(answers).items()} == dict.fromkeys(pictures(answers), 0)
    assert isinstance(answers[-1], StageDone) and answers[-1].exact
    scene = compute().scene
    assert [type(a) for a in run_in_process(tasks, EstimateError(scene))][-1] is ErrorEstimated


def test_an_estimate_without_a_picture_is_refused(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    nothing_yet = failure(run_in_process(tasks, EstimateError(compute().scene)))
    assert nothing_yet.startswith("the error is estimated of a whole picture")
    run_in_process(tasks, compute(is_drag=True))  # every eighth pixel, while a light is moved
    assert failure(run_in_process(tasks, EstimateError(compute().scene))) == nothing_yet


def test_transport_without_a_scene_is_refused(store: ArrayCache) -> None:
    assert failure(run_in_process(RequestDispatcher(store), compute())) == "no scene is open"


def test_a_constant_sky_of_the_document_replaces_the_scenes(source: str, store: ArrayCache) -> None:
    tasks = opened(source, store)
    dark, bright = (
        pictures(run_in_process(tasks, lit(compute(), LightState("constant", radiance=(v, v, v)))))["ground.0"]
        for v in (0.0, 2.0)
    )
    assert (bright >= dark).all() and bright.mean() > dark.mean() + 0.5
