"""Requests served in this process; opening a scene as the editor does: load it, and look at it."""

from __future__ import annotations

from app.messages.worker_messages import OpenScene, Request, Response, SetCamera, WorkerClient
from app.worker.schedule import InProcessClient, RequestHandler
from engine.scene.description import Camera


def ask_for_scene(
    client: WorkerClient, source: str, camera: Camera | None = None, resolution: tuple[int, int] | None = None
) -> int:
    """Ask for a scene and a look at it; the number of the look."""
    return client.send(SetCamera(client.send(OpenScene(source)), camera, resolution))


def open_in_process(
    handler: RequestHandler, source: str, camera: Camera | None = None, resolution: tuple[int, int] | None = None
) -> list[Response]:
    """All answers to both."""
    client = InProcessClient(handler)
    ask_for_scene(client, source, camera, resolution)
    return client.poll(budget_s=float("inf"))


def run_in_process(handler: RequestHandler, request: Request) -> list[Response]:
    """All answers to one request, computed here and now, as the worker would give them."""
    client = InProcessClient(handler)
    client.send(request)
    return client.poll(budget_s=float("inf"))
