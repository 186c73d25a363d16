"""What Deform's talk tells the picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.messages.picture_events import PictureEvent
from engine.realtime.zonal_harmonics.gpu_parts import PictureExport
from engine.scene.description import Camera


@dataclass(frozen=True, eq=False)
class PoseArrived(PictureEvent):
    """What the window is to draw itself, from where, in how many pixels (width, height)."""

    export: PictureExport
    camera: Camera
    resolution: tuple[int, int]
