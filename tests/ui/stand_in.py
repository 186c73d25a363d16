"""A worker that answers at once with made-up arrays, so that the window's tests need no transport.

The scene: a "teapot" with a diffuse base and a glossy coat, a "tray", a fixed "wall" and a "lamp" that shines, seen as
four upright stripes of a picture 48 x 32.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from app.document.described import document_from_description
from app.messages.file_messages import MeasurementsRead, ReadColourView, ReadCurveTable, ReadMeasured, ReadPicture
from app.messages.light_path_messages import LightPathTraced, TraceLightPath
from app.messages.worker_messages import (
    OpenScene,
    Progress,
    Request,
    RequestFailed,
    Response,
    SceneOpened,
    SetCamera,
    SkyImage,
    ViewTraced,
    with_numbers,
)
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    LayerPicture,
    LayerTransport,
    PlanBands,
    StageDone,
    StageFootprint,
)
from app.worker.file_tasks import read_colour_view, read_curve_table, read_stored_picture
from app.worker.planning import plan_bands
from engine.core.errors import LoadError
from engine.curve.wavelet import forward
from engine.planner import band_counts
from engine.scene.description import SceneDescription
from engine.scene.picture_frame import PictureFrame
from engine.settings import Precision
from tests.naive.measured import drawn_measurement

WIDTH, HEIGHT = 48, 32
READERS: dict[type[Request], Any] = {
    ReadCurveTable: read_curve_table, ReadColourView: read_colour_view, ReadPicture: read_stored_picture,
}  # fmt: skip
STRIPES = ("teapot", "tray", "wall", "lamp")
SCENE = {
    "version": 1,
    "name": "stand-in",
    "camera": {"position": [0.0, 1.0, 4.0], "target": [0.0, 0.5, 0.0], "fov_y": 40.0, "resolution": [WIDTH, HEIGHT]},
    "environment": {"radiance": [0.5, 0.6, 0.8]},
    "object": [
        {
            "name": "teapot",
            "primitive": "sphere",
            "editable": True,
            "layers": [
                {"model": "lambert", "name": "base", "albedo": [0.35, 0.12, 0.08]},
                {"model": "rough_conductor", "name": "coat", "distribution": "ggx", "alpha": 0.2},
            ],
        },
        {"name": "tray", "primitive": "cube", "editable": True, "layers": [{"model": "rough_conductor"}]},
        {"name": "wall", "primitive": "quad", "editable": False, "layers": [{"model": "lambert"}]},
        {
            "name": "lamp",
            "primitive": "quad",
            "emission": [5.0, 5.0, 4.0],
            "transform": [1, 0, 0, 0, 0, 1, 0, 2, 0, 0, 1, 0, 0, 0, 0, 1],
        },
    ],
}


def scene_frame() -> PictureFrame:
    """Primary hits of the four stripes; the lamp is an emitter and has no shaded pixels."""
    column = np.broadcast_to(np.arange(WIDTH) * len(STRIPES) // WIDTH, (HEIGHT, WIDTH))
    pixels = [np.flatnonzero(column == i) for i in range(3)]
    ends = np.cumsum([0, *map(len, pixels), 0])
    emission = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    emission[column == 3] = (5.0, 5.0, 4.0)
    directions = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    directions[..., 2] = -1.0
    return PictureFrame(
        object_image=column.astype(np.int16),
        pixel=np.concatenate(pixels).astype(np.int32),
        object_ranges=np.stack([ends[:-1], ends[1:]], axis=1).astype(np.int32),
        distance=np.full(int(ends[3]), 4.0, np.float32),
        front=np.ones(int(ends[3]), bool),
        theta_o=np.full(int(ends[3]), 0.4, np.float32),
        normal=np.tile(np.array([0.0, 0.0, 1.0], np.float16), (int(ends[3]), 1)),
        tangent=np.tile(np.array([1.0, 0.0, 0.0], np.float16), (int(ends[3]), 1)),
        emission_image=emission,
        ray_directions=directions,
    )


@functools.lru_cache(maxsize=64)
def transport_of(key: str, n_bands: int) -> np.ndarray:
    """(J,p,3) in the domain of bands: each pixel sees all bands, by amounts of its own. To be read alone."""
    index = STRIPES.index(key.partition(".")[0])
    n_samples = int(np.diff(scene_frame().object_ranges[index])[0])
    generator = np.random.default_rng(index)
    return generator.uniform(0.2, 1.0, (n_bands, n_samples, 3)) / n_bands


@functools.lru_cache(maxsize=64)
def wavelets_of(key: str, n_bands: int, precision: Precision) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same in the wavelet domain as the worker sends it: numbers (J,p,3), norms (J,) and scale (J,)."""
    waves = forward(transport_of(key, n_bands))
    norms = np.sqrt(np.sum(waves**2, axis=1))
    scale = np.abs(waves).max(axis=(1, 2))
    numbers = (waves / scale[:, None, None]).astype(np.float16 if precision == "half" else np.float32)
    return numbers, norms, scale


@functools.cache
def scene_opened() -> SceneOpened:
    """What is told of the scene: the same each time, and its bands take longer to plan than a window to open."""
    description = SceneDescription.model_validate(SCENE)
    layers = document_from_description("stand-in", description).layers()
    planned = tuple((layer, band_counts(layer)) for _, layer in layers)
    boxes = np.tile([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]], (len(STRIPES), 1, 1))
    return SceneOpened(description.model_dump_json(by_alias=True), planned=planned, boxes=boxes)


class StandInClient:
    """Answers requests in the next poll; what was asked is in `requests`."""

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self.closed = False
        self.light_path = ""  # what is in the way of lights that are placed
        self.arriving = False
        self._due: list[Response] = []
        self._view_id = 0

    @property
    def alive(self) -> bool:
        return True

    @property
    def pid(self) -> int | None:
        return None

    def send(self, request: Request) -> int:
        number = len(self.requests) + 1
        request = replace(request, id=number)
        self.requests.append(request)
        if isinstance(request, SetCamera):
            self._view_id = number
        self._due += [with_numbers(r, r.id or number, request.revision) for r in self._answers(request)]
        return number

    def say(self, response: Response) -> None:
        """Put an answer of the test's own into the next poll."""
        self._due.append(response)

    def poll(self, budget_s: float = 0.0) -> list[Response]:
        answers, self._due = self._due, []
        return answers

    def close(self) -> None:
        self.closed = True

    def _answers(self, request: Request) -> Iterator[Response]:
        if isinstance(request, OpenScene):
            yield scene_opened()
        elif isinstance(request, TraceLightPath):
            yield LightPathTraced(self.light_path)
        elif isinstance(request, SetCamera):
            yield ViewTraced(scene_frame())
        elif isinstance(request, ComputeTransport):
            yield from self._compute(request)
        elif isinstance(request, ContractTransport):
            yield from self._contract(request)
        elif isinstance(request, PlanBands):
            yield from (answer for answer in plan_bands(request) if answer is not None)
        elif type(request) in READERS:
            try:
                yield from (answer for answer in READERS[type(request)](request) if answer is not None)
            except LoadError as error:
                yield RequestFailed(str(error))
        elif isinstance(request, ReadMeasured):
            yield MeasurementsRead({file: replace(drawn_measurement(), file=file) for file in request.files})

    def _compute(self, request: ComputeTransport) -> Iterator[Response]:
        frame = scene_frame()
        n = frame.n_points
        rows = np.concatenate([np.arange(stop - start) for start, stop in frame.object_ranges])
        weights = np.zeros((n, 4), np.float32)
        weights[:, 0] = 1.0
        yield SkyImage(np.full((8, 16, 3), (0.5, 0.6, 0.8), np.float32), id=self._view_id)
        yield Progress("transport", 0.5, 1.0)
        rows = np.repeat(rows[:, None], 4, axis=1).astype(np.int32)
        yield StageFootprint(rows, weights, "final", id=self._view_id)
        for layer in request.scene.layers:
            contracted = transport_of(layer.key, layer.bands[0])
            radiance = np.einsum("jpc,jc->pc", contracted, layer.coefficients[0]).astype(np.float32)
            yield LayerPicture(layer.key, "final", radiance, layer.coefficients)
            if layer.key in (request.selected, *request.followers) and request.factor is not None:
                made_with = dict(zip(layer.factors, layer.coefficients, strict=True))
                yield self._transport(layer.key, request.factor, made_with, request.precision)
        yield StageDone("final", True, 0.1, 1_000_000, 26.4)

    def _contract(self, request: ContractTransport) -> Iterator[Response]:
        layer, first = request.layer, request.layer.coefficients[0]
        coefficients = dict(zip(layer.factors, layer.coefficients, strict=True))
        radiance = np.einsum("jpc,jc->pc", transport_of(layer.key, len(first)), first).astype(np.float32)
        if request.picture:
            yield LayerPicture(layer.key, "final", radiance, layer.coefficients)
        if request.factor is not None:
            yield self._transport(layer.key, request.factor, coefficients, request.precision)

    def _transport(
        self, key: str, factor: str, coefficients: dict[str, np.ndarray], precision: Precision
    ) -> LayerTransport:
        return LayerTransport(key, factor, "final", *wavelets_of(key, len(coefficients[factor]), precision))
