"""Camera moves: orbit, pan, dolly, focal length, level horizon, framing of a box, standard views.

Each takes a camera and returns another; the same one if a coordinate would leave its range. A camera with a level
horizon orbits about the world's Y, any other about its own `up`, and never across the poles. A trackball was rejected:
it tilts the horizon with every second drag. Lengths are those of film of 36 x 24 mm, whose height is the picture's.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from engine.core.camera import camera_frame, pixel_directions, unit
from engine.material.parameters import Parameter
from engine.scene.description import MAX_COORDINATE, Camera

FILM_HEIGHT = 24.0  # millimetres
LEAST_FOV, LARGEST_FOV = 0.01, 179.0
FOCAL_LENGTH = Parameter(
    "focal_length",
    "scalar",
    35.0,
    "Lens",
    "Focal length on film of 36 x 24 mm, whose 24 mm are the picture's height. The camera stays where it is.",
    minimum=4.0,
    maximum=1200.0,
    unit="mm",
    logarithmic=True,
)
MOST_ELEVATION = math.radians(89.99)
# A camera is level if its right vector is at most this far off the horizontal (a sine); if its up is further from Y
# than the second value, it orbits about its own axis.
LEVEL, NEAR_Y = 1e-6, 0.5
# Least distance to the target at which the view direction is defined: metres, and a share of the largest coordinate.
LEAST_DISTANCE, LEAST_SHARE = 1e-7, 1e-8
# Share of the picture that a framed box covers at most.
FRAMED_SHARE = 0.9
Side = Literal["front", "back", "right", "left", "top", "bottom"]
Float64Array = npt.NDArray[np.float64]
Y = np.array([0.0, 1.0, 0.0])
SIDES: dict[Side, tuple[tuple[float, float, float], float]] = {
    "front": ((0.0, 0.0, 1.0), 0.0), "back": ((0.0, 0.0, -1.0), 0.0), "right": ((1.0, 0.0, 0.0), 0.0),
    "left": ((-1.0, 0.0, 0.0), 0.0), "top": ((0.0, 0.0, 1.0), MOST_ELEVATION),
    "bottom": ((0.0, 0.0, 1.0), -MOST_ELEVATION),
}  # fmt: skip


def focal_length(fov_y: float) -> float:
    """Focal length in millimetres on film 24 mm high, for a field of view in degrees."""
    return 0.5 * FILM_HEIGHT / math.tan(math.radians(fov_y) / 2.0)


def field_of_view(focal: float) -> float:
    """Field of view in degrees for a focal length in millimetres; the inverse of `focal_length` within a camera's
    range."""
    return min(max(math.degrees(2.0 * math.atan2(0.5 * FILM_HEIGHT, focal)), LEAST_FOV), LARGEST_FOV)


def with_focal_length(camera: Camera, focal: float) -> Camera:
    """From the same position with this focal length in millimetres."""
    return camera.model_copy(update={"fov_y": field_of_view(focal)})


def distance(camera: Camera) -> float:
    """Distance to its target, metres."""
    return math.dist(camera.position, camera.target)


def is_level(camera: Camera) -> bool:
    """Whether its horizon is level."""
    right, up, _ = camera_frame(camera)
    return abs(right[1]) <= LEVEL and up[1] >= -LEVEL


def level_horizon(camera: Camera) -> Camera:
    """Level the horizon from the same position."""
    return _rotated_to(camera, *_level_and_elevation(camera, Y), Y)


def orbit_camera(camera: Camera, right: float, up: float) -> Camera:
    """Orbit about its target to its right and up, radians; as far as the pole."""
    axis = _axis(camera)
    level, elevation = _level_and_elevation(camera, axis)
    rotated = math.cos(right) * level + math.sin(right) * np.cross(axis, level)
    return _rotated_to(camera, rotated, elevation + up, axis)


def pan_camera(camera: Camera, right: float, up: float, depth: float | None = None) -> Camera:
    """Pan to its right and up, in heights of the picture at a depth in metres (None: of its target)."""
    depth = distance(camera) if depth is None else depth
    height = 2.0 * depth * math.tan(math.radians(camera.fov_y) / 2.0)
    across, upwards, _ = camera_frame(camera)
    offset = height * (right * across + up * upwards)
    return _placed(camera, np.add(camera.position, offset), np.add(camera.target, offset), camera.up)


def dolly_camera(camera: Camera, factor: float, about: npt.ArrayLike | None = None) -> Camera:
    """Multiply the distance from a point (3,), which keeps its place in the picture (None: from its target)."""
    position, target = np.array(camera.position), np.array(camera.target)
    pivot = target if about is None else np.asarray(about, np.float64)
    factor = max(factor, _least_distance(target) / max(distance(camera), 1e-300))
    return _placed(camera, pivot + factor * (position - pivot), pivot + factor * (target - pivot), camera.up)


def frame_box(camera: Camera, box: npt.ArrayLike, aspect: float) -> Camera:
    """Keep the direction, and move to the nearest place from which a box (2, 3), given by minimum and maximum, is
    entirely visible in a picture of this aspect, width over height."""
    low, high = np.asarray(box, np.float64)
    centre = 0.5 * (low + high)
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T - centre
    right, up, depth = np.abs(camera_frame(camera) @ corners.T)
    half = FRAMED_SHARE * math.tan(math.radians(camera.fov_y) / 2.0)
    # A corner nearer to the camera must fit as well; the camera stays outside of the box.
    needed = max(float(np.max(np.maximum(right / aspect, up) / half + depth)), 1.1 * float(np.max(depth)))
    return _placed(camera, centre - needed * camera_frame(camera)[2], centre, camera.up)


def view_from_side(camera: Camera, side: Side) -> Camera:
    """View the scene from one side of its target: the front is on +Z, the right on +X, the top on +Y."""
    level, elevation = SIDES[side]
    return _rotated_to(camera, np.array(level), elevation, Y)


def point_at(camera: Camera, resolution: tuple[int, int], column: float, row: float, depth: float) -> Float64Array:
    """The point at a position in the picture, in pixels, at a depth in metres."""
    ray = pixel_directions(camera, resolution, column, row).astype(np.float64)
    return np.asarray(np.array(camera.position) + depth / float(ray @ camera_frame(camera)[2]) * ray)


def depth_of(camera: Camera, point: npt.ArrayLike) -> float:
    """Depth of a point (3,) in front of the camera, metres; negative behind it."""
    return float(np.subtract(point, camera.position) @ camera_frame(camera)[2])


def _axis(camera: Camera) -> Float64Array:
    """The axis about which the camera orbits."""
    up = unit(np.array(camera.up))
    return Y if is_level(camera) and up[1] >= NEAR_Y else up


def _level_and_elevation(camera: Camera, axis: Float64Array) -> tuple[Float64Array, float]:
    """Where the camera is relative to its target: the horizontal direction about an axis, and the elevation."""
    outwards = -camera_frame(camera)[2]
    height = float(np.clip(outwards @ axis, -1.0, 1.0))
    level = outwards - height * axis
    if np.linalg.norm(level) < 1e-5:  # at a pole: the picture's up direction decides
        upwards = camera_frame(camera)[1]
        level = -math.copysign(1.0, height) * (upwards - (upwards @ axis) * axis)
    return unit(level), math.asin(height)


def _rotated_to(camera: Camera, level: Float64Array, elevation: float, axis: Float64Array) -> Camera:
    """Place the camera at the same distance from its target in that direction."""
    elevation = min(max(elevation, -MOST_ELEVATION), MOST_ELEVATION)
    outwards = math.cos(elevation) * level + math.sin(elevation) * axis
    target = np.array(camera.target)
    away = max(distance(camera), 1.01 * _least_distance(target))
    return _placed(camera, target + away * outwards, target, tuple(axis))


def _placed(camera: Camera, position: Float64Array, target: Float64Array, up: tuple[float, ...]) -> Camera:
    """Place the camera, no nearer to its target than can be resolved; the same camera if that is out of range."""
    offset, least = position - target, _least_distance(target)
    if not np.linalg.norm(offset) >= least:
        position = target - least * camera_frame(camera)[2]
    if not max(np.abs(position).max(), np.abs(target).max()) <= MAX_COORDINATE:
        return camera
    return Camera(position=_point(position), target=_point(target), up=_point(up), fov_y=camera.fov_y)


def _point(vector: npt.ArrayLike) -> tuple[float, float, float]:
    x, y, z = map(float, np.asarray(vector))
    return x, y, z


def _least_distance(target: Float64Array) -> float:
    return max(LEAST_DISTANCE, LEAST_SHARE * float(np.abs(target).max()))
