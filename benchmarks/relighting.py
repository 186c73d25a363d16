"""What a rotated sky costs in Placement once its rows are there, and its error [BenArtzi07, 7.2].

The worker's own requests are carried out in this process, as the window asks them: the exact picture, its rows, then
the sky turned. Beside it the quick picture that a turn had before: processor time alone, as it has other pixels.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.document.described import document_from_description
from app.document.document import Document
from app.document.scene_state import SceneState, layer_state, scene_state
from app.messages.worker_messages import OpenScene, Request, RequestFailed, Response, SetCamera
from app.modes.placement.placement_messages import ComputeTransport, LayerPicture, PrepareRelighting, RelightingPrepared
from app.project.project import open_project
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from benchmarks.figures import Figure, NotMeasured, not_measured
from engine.planner import band_counts
from engine.precompute.direct.pipeline import FINAL, PREVIEW
from engine.render.picture_difference import errors
from engine.settings import RenderSettings

NAMES = ("turn_error", "turn_cpu_s", "relight_rows_s")
SCENE = "teatray"
Pictures = dict[str, NDArray[np.floating]]


@dataclass(frozen=True)
class RelightEffort:
    """The picture, by how many degrees the sky turns for the error and for the other figures, frames timed."""

    resolution: tuple[int, int] = (160, 120)
    turns: tuple[float, ...] = (5.0, 77.0)
    n_frames: int = 5
    n_final: int = FINAL.n_lights


def relight_figures(effort: RelightEffort | None, report: Callable[[str], None], source: str = SCENE) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    report(f"a turned sky in Placement: {source}")
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        ready = ReadyScene(source, effort, Path(folder, "ready"))
        begun = time.process_time()
        prepared = ready.ask(PrepareRelighting(ready.scene))
        rows_s = time.process_time() - begun
        n_bytes = next((each.transport_bytes for each in prepared if isinstance(each, RelightingPrepared)), 0)
        by_rows, off = _frames(ready, effort, "relit"), dict[str, float]()
        for degrees in effort.turns:
            found = ready.pictures(ready.turned(degrees), "relit")
            off[f"{degrees:g}"] = _error(found, ready.pictures(ready.turned(degrees, effort.n_final), "final"))
        quick = _frames(ReadyScene(source, effort, Path(folder, "quick")), effort, "drag")
    size = "{}x{}".format(*effort.resolution)
    last = f"{effort.turns[-1]:g}"
    how = f"{source}, {size}"
    return [
        Figure("turn_error", (off[last],), f"{how}, turned by {last}° against that light's own transport", off),
        Figure("turn_cpu_s", by_rows, f"{how}: processor time of a frame", {"quick": float(np.median(quick))}),
        Figure("relight_rows_s", (rows_s,), f"{how}: processor time of all rows", {"mb": n_bytes / 1e6}),
    ]


class ReadyScene:
    """A scene whose exact picture there is, in a worker of this process."""

    def __init__(self, source: str, effort: RelightEffort, cache: Path) -> None:
        project = open_project(source, effort.resolution)
        self.document = document_from_description(source, project.scene.description)
        self.scene = state_of(self.document)
        if not self.scene.layers:
            raise NotMeasured(f"{source} has no layers")
        self._tasks, self._n_preview = RequestDispatcher(ArrayCache(cache)), min(PREVIEW.n_lights, effort.n_final // 4)
        self.ask(OpenScene(source, id=1), SetCamera(1, None, effort.resolution))
        self.ask(self.transport(self.scene, effort.n_final))

    def ask(self, *requests: Request) -> list[Response]:
        """All answers. Raises NotMeasured for a failure."""
        client = InProcessClient(self._tasks)
        for request in requests:
            client.send(request)
        answers = list(client.poll(budget_s=float("inf")))
        for answer in answers:
            if isinstance(answer, RequestFailed):
                raise NotMeasured(answer.line)
        return answers

    def turned(self, degrees: float, n_final: int = 0) -> ComputeTransport:
        """The sky turned by so much, as a hand has it, or with so many lights in the end."""
        light = self.scene.light
        return self.transport(replace(self.scene, light=replace(light, rotation=light.rotation + degrees)), n_final)

    def pictures(self, request: ComputeTransport, stage: str) -> Pictures:
        """What each layer sends, (p, 3) by key."""
        answers = (each for each in self.ask(request) if isinstance(each, LayerPicture) and each.stage == stage)
        scales = {each.key: each.layer.scale() for each in self.scene.layers}
        found: Pictures = {each.key: np.array(each.radiance) * scales[each.key] for each in answers}
        if not found:
            raise NotMeasured(f"no picture {stage!r} came")
        return found

    def transport(self, scene: SceneState, n_final: int = 0) -> ComputeTransport:
        """The request for a scene's transport, as of a light that is dragged, or with so many lights in the end."""
        key = scene.layers[0].key
        factor = scene.layers[0].layer.model.factors[0].name
        settings = RenderSettings(n_final or self._n_preview)
        return ComputeTransport(scene, key, factor, self._n_preview, settings, is_drag=n_final == 0)


def state_of(document: Document) -> SceneState:
    """What the worker lights of a document."""
    return scene_state(
        document, lambda given, key: layer_state(given, key, tuple(band_counts(given.layer(key)).values()))
    )


def _frames(ready: ReadyScene, effort: RelightEffort, stage: str) -> tuple[float, ...]:
    """Processor time of frames of a sky that turns."""
    ready.pictures(ready.turned(1.0), stage)  # what is found once
    seconds = []
    for k in range(effort.n_frames):
        begun = time.process_time()
        ready.pictures(ready.turned(3.0 * (k + 1)), stage)
        seconds.append(time.process_time() - begun)
    return tuple(seconds)


def _error(found: Pictures, truth: Pictures) -> float:
    """relRMSE over all layers' pictures."""
    keys = [key for key in truth if key in found]
    return errors(np.concatenate([found[key] for key in keys]), np.concatenate([truth[key] for key in keys])).rmse
