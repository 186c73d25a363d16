"""A brush on the picture: which points of a surface lie on its path."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.strokes import Stroke, pack_dabs
from engine.scene.description import Camera
from engine.scene.picture_frame import PictureFrame

# Dabs are this share of the radius apart: between them the edge of a stroke recedes by a hundredth of it.
SPACING = 0.3
MOST_DABS = 400  # in one frame
_NEAR = 1024.0

Float64Array = NDArray[np.float64]
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class SurfaceSpot:
    """The surface that a pixel sees: a point (3,) of the world, the outward normal (3,), and the size of a pixel there
    in metres."""

    place: Float64Array
    normal: Float64Array
    metres: float


SpotAt = Callable[[int, int], SurfaceSpot | None]


def spot_of(frame: PictureFrame, camera: Camera, column: int, row: int, sample: int) -> SurfaceSpot:
    """The spot at a pixel that the given sample of the primary hits belongs to."""
    ray, distance = frame.ray_directions[row, column].astype(np.float64), float(frame.distance[sample])
    eye, target = np.array(camera.position), np.array(camera.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    metres = 2.0 * distance * float(ray @ forward) * math.tan(math.radians(camera.fov_y) / 2.0) / frame.height
    normal = frame.normal[sample].astype(np.float64)
    normal /= np.linalg.norm(normal)
    return SurfaceSpot(eye + distance * ray, normal if frame.front[sample] else -normal, metres)


def sample_path(points: Sequence[Point], radius: float) -> list[Point]:
    """Points on the path through these, pixels, close enough together for dabs; without the first one."""
    found: list[Point] = []
    step = max(SPACING * radius, 0.5)
    for (x, y), (to_x, to_y) in zip(points, points[1:], strict=False):
        n = min(max(math.ceil(math.hypot(to_x - x, to_y - y) / step), 1), MOST_DABS)
        found += [(x + (to_x - x) * i / n, y + (to_y - y) * i / n) for i in range(1, n + 1)]
    return found


def spots_at(spot_at: SpotAt, places: Sequence[Point]) -> list[SurfaceSpot]:
    """The spots at places of the picture that see the surface."""
    found = (spot_at(math.floor(x), math.floor(y)) for x, y in places)
    return [spot for spot in found if spot is not None]


def stroke_at(spots: Sequence[SurfaceSpot], metres: float, value: float, strength: float, hardness: float) -> Stroke:
    """A stroke over these spots, at least one, with a brush of so many metres; see `Stroke`."""
    # About a near place, and the same one for most strokes: 500 m away single precision resolves 0.03 mm.
    x, y, z = (np.round(spots[0].place / _NEAR) * _NEAR + 0.0).tolist()
    dabs = pack_dabs([spot.place - (x, y, z) for spot in spots], [spot.normal for spot in spots])
    return Stroke(metres, value, strength, hardness, dabs, (x, y, z))
