"""The point of a surface that a pixel of the picture sees."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from engine.scene.description import Camera
    from engine.scene.picture_frame import PictureFrame

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurfaceSpot:
    """The surface that a pixel sees: a point (3,) of the world, the normal (3,) of the side that is seen, and the size
    of a pixel there in metres."""

    place: Float64Array
    normal: Float64Array
    metres: float


def spot_in(frame: PictureFrame, camera: Camera, column: int, row: int) -> SurfaceSpot | None:
    """The point that a pixel of the picture sees; None for emitters and the background."""
    sample = frame.sample_at(column, row)
    if sample is None:
        return None
    ray, distance = frame.ray_directions[row, column].astype(np.float64), float(frame.distance[sample])
    eye, target = np.array(camera.position), np.array(camera.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    metres = 2.0 * distance * float(ray @ forward) * math.tan(math.radians(camera.fov_y) / 2.0) / frame.height
    normal = frame.normal[sample].astype(np.float64)
    normal /= np.linalg.norm(normal)
    return SurfaceSpot(eye + distance * ray, normal if frame.front[sample] else -normal, metres)
