"""A worker that only listens: it keeps what it was asked and hands out the answers that a test puts in its mouth."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.jobs.messages import (
    ComputeTransport,
    Contract,
    LayerPicture,
    LayerTransport,
    OpenScene,
    Request,
    Response,
    SceneOpened,
    StageDone,
    stamped,
)
from engine.scene.description import parse_description

METAL = {"model": "rough_conductor", "alpha": 0.15}
SCENE: dict[str, Any] = {
    "version": 1,
    "name": "shelf",
    "camera": {"position": [0, 1, 4], "target": [0, 0, 0], "resolution": [8, 6]},
    "environment": {"radiance": 1.0, "rotation": 30.0},
    "object": [
        {"name": "pot", "primitive": "sphere", "layer": [{"model": "lambert", "name": "base"}, METAL]},
        {"name": "floor", "primitive": "quad", "layer": [{"model": "lambert", "albedo": 0.3}]},
        {"name": "lamp", "primitive": "quad", "emission": 5.0},
    ],
}


class FakeClient:
    """Satisfies ``app.editor.WorkerClient``. ``requests`` holds all that was sent, oldest first, with ids from 1."""

    def __init__(self) -> None:
        self.alive = True
        self.pid: int | None = None
        self.requests: list[Request] = []
        self.closed = False
        self._due: list[Response] = []
        self._id = 0

    def send(self, request: Request) -> int:
        self._id += 1
        self.requests.append(stamped(request, self._id, request.revision))
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
        self._due += [stamped(response, request.id, request.revision) for response in responses]

    def open_scene(self, scene: dict[str, Any] = SCENE) -> None:
        """Answer the newest OpenScene."""
        text = parse_description(scene, "scene.toml").model_dump_json(by_alias=True)
        self.answer(self.sent(OpenScene)[-1], SceneOpened(text, ("a note",)))

    def finish_stage(self, stage: str, exact: bool) -> None:
        """Answer the newest ComputeTransport with one stage: all layers' pictures, then the selected's transport."""
        request: ComputeTransport = self.sent(ComputeTransport)[-1]
        for layer in request.layers:
            self.answer(request, LayerPicture(layer.key, stage, np.zeros((4, 3)), layer.coefficients))
            if layer.key == request.selected and request.factor is not None:
                self.answer(request, transport(layer.key, request.factor, stage))
        self.answer(request, StageDone(stage, exact, 0.1, 2_000_000))

    def contract(self, stage: str) -> None:
        """Answer the newest Contract."""
        request: Contract = self.sent(Contract)[-1]
        values = tuple(values for _, values in request.coefficients)
        self.answer(request, LayerPicture(request.key, stage, np.zeros((4, 3)), values))
        self.answer(request, transport(request.key, request.factor, stage))


def transport(key: str, factor: str, stage: str) -> LayerTransport:
    """A curve's transport for four pixels, all zero."""
    return LayerTransport(key, factor, stage, np.zeros((8, 4, 3)), np.ones((8, 3)), np.ones(8))
