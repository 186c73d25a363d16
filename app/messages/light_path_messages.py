"""The request for what becomes of a light that was placed in the picture, and its response."""

from __future__ import annotations

from dataclasses import dataclass

from app.messages.worker_messages import OpenScene, Request, Response
from engine.scene.light_paths import LightPath


@dataclass(frozen=True)
class TraceLightPath(Request):
    """Trace the way of a placed light in the traced scene. Answered by `LightPathTraced`."""

    built_on = (OpenScene,)
    priority = 3
    answered_once = True
    is_stopped_by_user = False

    path: LightPath


@dataclass(frozen=True)
class LightPathTraced(Response):
    """What keeps the light from doing what it was placed for; "" where nothing does."""

    line: str
