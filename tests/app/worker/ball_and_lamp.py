"""A tiny scene for the worker: a ball and a lamp on the ground, what is asked of it, and what its answers hold."""

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np

from app.document.light_state import LightState
from app.document.scene_state import LayerState, SceneState
from app.messages.worker_messages import Progress, RequestFailed, Response, ViewTraced
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    LayerPicture,
    StageDone,
)
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.bandstore import BandTile
from engine.precompute.direct.projection import project_layer
from engine.settings import RenderSettings
from tests.opened import open_in_process
from tests.scene_text import facing_down, ground, material, placed, scaled

COATED = material('model = "lambert"', 'model = "rough_conductor", alpha = 0.3')
SCENE = (
    ground((32, 32), size=5)
    + placed("ball", "sphere", scaled(0.9, (0, 0.5, 0)), COATED)
    + placed("lamp", "quad", facing_down(1, (-1.2, 2.4, 0)), "emission = [6, 5, 4]\n")
)
PREVIEW_LIGHTS, FINAL_LIGHTS = 40, 120
DECIDED = {field.name for field in fields(RenderSettings)} - {"precision"}  # which a request has itself
BANDS = {"lambert": (8,), "rough_conductor": (16, 4)}
GLOSS = "ball.1"
TWICE = Operator("amplify", "y", 0.0, 0.0, np.pi / 2, np.pi / 2, magnitude=2.0)


def work(key: str, model: str, **parameters: object) -> LayerState:
    return LayerState(key, make_layer(MODELS[model], parameters), BANDS[model])


def compute(selected: str | None = GLOSS, factor: str | None = "theta_h", **changes: object) -> ComputeTransport:
    layers = (work("ground.0", "lambert"), work("ball.0", "lambert"), work(GLOSS, "rough_conductor", alpha=0.3))
    scene = SceneState(LightState(), layers)
    decided = {name: changes.pop(name) for name in DECIDED & changes.keys()}
    decisions = replace(RenderSettings(FINAL_LIGHTS), **decided)  # type: ignore[arg-type]
    return replace(ComputeTransport(scene, selected, factor, PREVIEW_LIGHTS, decisions), **changes)  # type: ignore[arg-type]


def lit(request: ComputeTransport, light: LightState) -> ComputeTransport:
    """The request under another light."""
    return replace(request, scene=replace(request.scene, light=light))


def twice(state: LayerState, *factors: str) -> LayerState:
    """The layer with some of its curves twice as high."""
    for factor in factors:
        state = replace(state, layer=state.layer.with_operators(factor, [TWICE]))
    return state


def opened(source: str, store: ArrayCache) -> RequestDispatcher:
    tasks = RequestDispatcher(store)
    assert any(isinstance(answer, ViewTraced) for answer in open_in_process(tasks, source))
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


def contraction(factor: str | None, brighter: bool = False) -> ContractTransport:
    asked = work(GLOSS, "rough_conductor", alpha=0.3)
    return ContractTransport(twice(asked, *asked.factors) if brighter else asked, factor)


def with_layer(request: ComputeTransport, key: str, **changes: object) -> ComputeTransport:
    """The request with one of its layers changed."""
    layers = tuple(replace(w, **changes) if w.key == key else w for w in request.scene.layers)
    return replace(request, scene=replace(request.scene, layers=layers))


def done(answers: list[Response]) -> dict[str, int]:
    """The stages that were made, with the bytes of transport after each."""
    return {a.stage: a.transport_bytes for a in answers if isinstance(a, StageDone)}


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


def failure(answers: list[Response]) -> str:
    assert isinstance(answers[-1], RequestFailed) and "\n" not in answers[-1].line
    return answers[-1].line
