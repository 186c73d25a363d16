"""Picture events of Deform."""

from __future__ import annotations

from dataclasses import dataclass

from app.messages.picture_events import PictureEvent
from engine.realtime.core.gpu_parts import PictureExport
from engine.scene.description import Camera


@dataclass(frozen=True, eq=False)
class PoseArrived(PictureEvent):
    """The parts that the window draws a picture of, the camera, the resolution (width, height), and whether it has
    alpha, without the environment."""

    export: PictureExport
    camera: Camera
    resolution: tuple[int, int]
    transparent: bool = False
