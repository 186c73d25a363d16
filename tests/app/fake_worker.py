"""A worker that only listens: it keeps what it was asked and hands out the answers that a test puts in its mouth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.document.described import document_from_description
from app.document.named_files import document_with_measurements, unread_files
from app.messages.light_path_messages import LightPathTraced, TraceLightPath
from app.messages.worker_messages import (
    CancelRequests,
    OpenScene,
    Request,
    Response,
    SceneOpened,
    SetCamera,
    ViewTraced,
    with_numbers,
)
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    ErrorEstimated,
    EstimateError,
    LayerPicture,
    LayerTransport,
    LightsReady,
    PlanBands,
    PrepareRelighting,
    RelightingPrepared,
    StageDone,
)
from app.worker.planning import plan_bands
from engine.material.layer import Layer
from engine.measured.measurement import Measurement
from engine.planner import band_counts
from engine.render.picture_error import ErrorEstimate
from engine.scene.added_objects import AddedObject
from engine.scene.composition import ObjectSource
from engine.scene.description import ObjectDescription, parse_description
from engine.scene.loaders.model import ImportedCamera
from engine.scene.picture_frame import PictureFrame
from engine.scene.rig import Animations
from engine.settings import Precision

METAL = {"model": "rough_conductor", "alpha": 0.15}
SCENE: dict[str, Any] = {
    "version": 1,
    "name": "shelf",
    "bounces": 1,
    "camera": {"position": [0, 1, 4], "target": [0, 0, 0], "resolution": [8, 6]},
    "environment": {"radiance": 1.0, "rotation": 30.0},
    "object": [
        {"name": "pot", "primitive": "sphere", "layer": [{"model": "lambert", "name": "base"}, METAL]},
        {"name": "floor", "primitive": "quad", "layer": [{"model": "lambert", "albedo": 0.3}]},
        {"name": "lamp", "primitive": "quad", "emission": 5.0},
    ],
}


# A picture of one pixel, which sees the pot.
FRAME = PictureFrame(
    pixel=np.zeros(1, np.int32),
    object_ranges=np.array([[0, 1], [1, 1], [1, 1]], np.int32),
    object_image=np.zeros((1, 1), np.int16),
    emission_image=np.zeros((1, 1, 3), np.float32),
    ray_directions=np.zeros((1, 1, 3), np.float32),
    theta_o=np.zeros(1, np.float32),
)


class FakeClient:
    """Satisfies `app.messages.worker_messages.WorkerClient`. `requests` holds all that was sent, oldest first, ids from
    1.

    It ``plans`` bands by itself, and says what is in the way of lights, a poll after it was asked.
    """

    plans = True
    light_path = ""  # what is in the way of lights that are placed

    def __init__(self) -> None:
        self.alive = True
        self.arriving = False
        self.pid: int | None = None
        self.requests: list[Request] = []
        self.closed = False
        self._due: list[Response] = []
        self._id = 0

    def send(self, request: Request) -> int:
        self._id += 1
        sent = with_numbers(request, self._id, request.revision)
        self.requests.append(sent)
        if isinstance(sent, PlanBands) and self.plans:
            self.answer(sent, *(answer for answer in plan_bands(sent) if answer is not None))
        elif isinstance(sent, TraceLightPath):
            self.answer(sent, LightPathTraced(self.light_path))
        return self._id

    def poll(self, budget_s: float = 0.0) -> list[Response]:
        due, self._due = self._due, []
        return due

    def close(self) -> None:
        self.closed = True

    def sent(self, kind: type[Request]) -> list[Any]:
        """All requests of one kind, oldest first."""
        return [request for request in self.requests if isinstance(request, kind)]

    def answer(self, request: Request, *responses: Response) -> None:
        """Let the next poll return these, as answers to this request."""
        self._due += [with_numbers(response, response.id or request.id, request.revision) for response in responses]

    def open_scene(
        self, scene: dict[str, Any] = SCENE, bands: dict[str, dict[str, int]] | None = None,
        measurements: dict[str, Measurement] | None = None, planned: tuple[tuple[Layer, dict[str, int]], ...] = (),
        boxes: NDArray[np.float64] | None = None, animations: tuple[Animations, ...] = (),
        cameras: tuple[ImportedCamera, ...] = (), added: tuple[AddedObject, ...] = (),
    ) -> None:  # fmt: skip
        """Answer the newest OpenScene; bands: those planned, None for all; boxes: of the objects, None for none."""
        description = parse_description(scene, "scene.toml")
        document = document_with_measurements(document_from_description("scene.toml", description), measurements or {})
        if bands is None:
            bands = {key: band_counts(layer) for key, layer in document.layers() if not unread_files([layer])}
        text = description.model_dump_json(by_alias=True)
        planned = (*((document.layer(key), counts) for key, counts in bands.items()), *planned)
        boxes = np.zeros((0, 2, 3)) if boxes is None else boxes
        opened = SceneOpened(
            text, ("a note",), measurements or {}, planned, boxes, animations, cameras=cameras, added=added
        )
        self.answer(self.sent(OpenScene)[-1], opened)
        self.see_scene()

    def see_scene(self, *missing: ObjectSource) -> None:
        """Answer the newest SetCamera; missing: what cannot be read."""
        problems = tuple(f"{each.mesh}: no such file" for each in missing if isinstance(each, ObjectDescription))
        self.answer(self.sent(SetCamera)[-1], ViewTraced(FRAME, (), missing, problems))

    def finish_stage(self, stage: str, exact: bool) -> None:
        """Answer the newest ComputeTransport with one stage: all layers' pictures, then the selected's transport."""
        request: ComputeTransport = self.sent(ComputeTransport)[-1]
        for layer in request.scene.layers:
            self.answer(request, LayerPicture(layer.key, stage, np.zeros((4, 3)), layer.coefficients))
            if layer.key in (request.selected, *request.followers) and request.factor is not None:
                self.answer(request, transport(layer.key, request.factor, stage, request.precision))
        self.answer(request, StageDone(stage, exact, 0.1, 2_000_000))

    def contract(self, stage: str) -> None:
        """Answer the newest Contract."""
        request: ContractTransport = self.sent(ContractTransport)[-1]
        layer = request.layer
        if request.picture:
            self.answer(request, LayerPicture(layer.key, stage, np.zeros((4, 3)), layer.coefficients))
        if request.factor is not None:
            self.answer(request, transport(layer.key, request.factor, stage, request.precision))


def transport(key: str, factor: str, stage: str, precision: Precision = "half") -> LayerTransport:
    """A curve's transport for four pixels, all zero."""
    planes = np.zeros((8, 4, 3), np.float16 if precision == "half" else np.float32)
    return LayerTransport(key, factor, stage, planes, np.ones((8, 3)), np.ones(8))


class ServingClient(FakeClient):
    """A worker that answers by itself, in bits: each poll brings a few of the answers that are due.

    As the real one does, it drops what a newer request replaces, notes a Contract that comes too early, and makes the
    layers of a stage with the newest coefficients it knows.
    """

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._random = np.random.default_rng(seed)
        self._answers: dict[type[Request], list[Response]] = {}
        self._made: dict[str, LayerPicture] = {}
        self._paused = False
        self._selected: dict[str, str] = {}
        self._precision: Precision = "half"

    def send(self, request: Request) -> int:
        id = super().send(request)
        sent = self.requests[-1]
        if isinstance(sent, OpenScene):
            text = parse_description(SCENE, "scene.toml").model_dump_json(by_alias=True)
            self._answers = {OpenScene: [with_numbers(SceneOpened(text), id, sent.revision)]}
        elif isinstance(sent, SetCamera):
            opened = self._answers.get(OpenScene, [])  # what was built on the look before it is given up
            self._answers = {OpenScene: [*opened, with_numbers(ViewTraced(FRAME), id, sent.revision)]}
        elif isinstance(sent, ComputeTransport):
            if sent.selected is not None and sent.factor is not None:
                self._selected = dict.fromkeys((sent.selected, *sent.followers), sent.factor)
            self._precision = sent.precision
            stages = ["drag"] if sent.is_drag else ["coarse", "final"]
            self._answers = {ComputeTransport: [a for stage in stages for a in self._stage(sent, stage, stages[-1])]}
        elif isinstance(sent, ContractTransport):
            if sent.factor is not None:
                others = self._selected if sent.beside else {}
                self._selected, self._precision = {**others, sent.layer.key: sent.factor}, sent.precision
            self._answers[ContractTransport] = self._contraction(sent)
        elif isinstance(sent, EstimateError):
            # The error of each request is another one, so that a test can tell which of them was answered.
            self._answers[EstimateError] = [with_numbers(ErrorEstimated(ErrorEstimate(float(id))), id, sent.revision)]
        elif isinstance(sent, PrepareRelighting):
            answers = (LightsReady(0, 2), RelightingPrepared(0, 2))
            self._answers[PrepareRelighting] = [with_numbers(each, id, sent.revision) for each in answers]
        elif isinstance(sent, CancelRequests) and sent.of in ((EstimateError,), (PrepareRelighting,)):
            self._answers.pop(sent.of[0], None)
        return id

    def poll(self, budget_s: float = 0.0) -> list[Response]:
        taken, self._due = self._due, []
        may_pause = not self._paused
        for due in self._answers.values():
            n = int(self._random.integers(0 if may_pause else 1, 3))
            self._paused = n == 0
            taken, due[:n] = taken + due[:n], []
        for response in taken:
            if isinstance(response, LayerPicture):
                self._made[response.key] = response
        return taken

    @property
    def idle(self) -> bool:
        """Whether all that was asked has been answered."""
        return not any((self._due, *self._answers.values()))

    def _stage(self, request: ComputeTransport, stage: str, last: str) -> list[Response]:
        answers: list[Response] = []
        for layer in request.scene.layers:
            answers.append(LayerPicture(layer.key, stage, np.zeros((4, 3)), layer.coefficients))
            if self._selected.get(layer.key) in layer.factors and not layer.fixed:
                answers.append(transport(layer.key, self._selected[layer.key], stage, self._precision))
        answers.append(StageDone(stage, stage == last, 0.1))
        return [with_numbers(answer, request.id, request.revision) for answer in answers]

    def _contraction(self, request: ContractTransport) -> list[Response]:
        layer = request.layer
        if layer.key not in self._made:
            return []
        (work,) = (each for each in self.sent(ComputeTransport)[-1].scene.layers if each.key == layer.key)
        assert not work.fixed  # it has no bands
        assert (work.factors, work.bands) == (layer.factors, layer.bands)
        picture = LayerPicture(layer.key, self._made[layer.key].stage, np.zeros((4, 3)), layer.coefficients)
        answers: list[Response] = [picture] if request.picture else []
        if request.factor is not None:
            answers.append(transport(layer.key, request.factor, picture.stage, request.precision))
        return [with_numbers(answer, request.id, request.revision) for answer in answers]


def computed(client: FakeClient) -> list[ComputeTransport]:
    """The transport that was asked for."""
    return client.sent(ComputeTransport)
