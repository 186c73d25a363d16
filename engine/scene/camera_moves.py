"""How a camera moves about a scene: orbit, pan, dolly, focal length, level horizon, framing of a box, standard views.

Each takes a camera and returns another; where a coordinate would leave its range, the same. A camera turns about the
world's Y where its horizon is level, else about its own `up`, and never through the poles: rejected was a trackball,
which tilts the horizon with every second drag. Lengths are those of film of 36 x 24 mm, whose height is the picture's.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from engine.scene.camera import camera_frame, pixel_directions, unit
from engine.scene.description import MAX_COORDINATE, Camera

FILM_HEIGHT = 24.0  # millimetres
LEAST_FOV, LARGEST_FOV = 0.01, 179.0
MOST_ELEVATION = math.radians(89.99)
# A camera whose right is no farther off the horizontal (a sine) is level; one whose up is farther from Y has an axis of
# its own.
LEVEL, NEAR_Y = 1e-6, 0.5
# Nearer to its target a camera would not know where it looks: metres, and a share of the largest coordinate.
LEAST_DISTANCE, LEAST_SHARE = 1e-7, 1e-8
# Of the picture, what a framed box covers at most.
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
    """Millimetres on film 24 mm high, of a field of view in degrees."""
    return 0.5 * FILM_HEIGHT / math.tan(math.radians(fov_y) / 2.0)


def field_of_view(focal: float) -> float:
    """Degrees, of a focal length in millimetres; the inverse of `focal_length` within what a camera may have."""
    return min(max(math.degrees(2.0 * math.atan2(0.5 * FILM_HEIGHT, focal)), LEAST_FOV), LARGEST_FOV)


def with_focal_length(camera: Camera, focal: float) -> Camera:
    """From the same place through a lens of so many millimetres."""
    return camera.model_copy(update={"fov_y": field_of_view(focal)})


def distance(camera: Camera) -> float:
    """To its target, metres."""
    return math.dist(camera.position, camera.target)


def is_level(camera: Camera) -> bool:
    """Whether its horizon is."""
    right, up, _ = camera_frame(camera)
    return abs(right[1]) <= LEVEL and up[1] >= -LEVEL


def level_horizon(camera: Camera) -> Camera:
    """With its horizon level, from the same place."""
    return _turned_to(camera, *_level_and_elevation(camera, Y), Y)


def orbit_camera(camera: Camera, right: float, up: float) -> Camera:
    """About its target to its right and up, radians; up to the pole at most."""
    axis = _axis(camera)
    level, elevation = _level_and_elevation(camera, axis)
    turned = math.cos(right) * level + math.sin(right) * np.cross(axis, level)
    return _turned_to(camera, turned, elevation + up, axis)


def pan_camera(camera: Camera, right: float, up: float, depth: float | None = None) -> Camera:
    """To its right and up, in heights of the picture at so many metres before it (None: at its target)."""
    depth = distance(camera) if depth is None else depth
    height = 2.0 * depth * math.tan(math.radians(camera.fov_y) / 2.0)
    across, upwards, _ = camera_frame(camera)
    gone = height * (right * across + up * upwards)
    return _placed(camera, np.add(camera.position, gone), np.add(camera.target, gone), camera.up)


def dolly_camera(camera: Camera, factor: float, about: npt.ArrayLike | None = None) -> Camera:
    """So many times as far from a point (3,), which stays where it is in the picture (None: from its target)."""
    position, target = np.array(camera.position), np.array(camera.target)
    pivot = target if about is None else np.asarray(about, np.float64)
    factor = max(factor, _least_distance(target) / max(distance(camera), 1e-300))
    return _placed(camera, pivot + factor * (position - pivot), pivot + factor * (target - pivot), camera.up)


def frame_box(camera: Camera, box: npt.ArrayLike, aspect: float) -> Camera:
    """In the same direction, so near that a box (2, 3), its least and its largest corner, is seen whole in a picture
    `aspect` times as wide as high."""
    low, high = np.asarray(box, np.float64)
    centre = 0.5 * (low + high)
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T - centre
    right, up, depth = np.abs(camera_frame(camera) @ corners.T)
    half = FRAMED_SHARE * math.tan(math.radians(camera.fov_y) / 2.0)
    # A corner nearer to the eye by its depth has to fit, too; the eye stays outside of the box.
    needed = max(float(np.max(np.maximum(right / aspect, up) / half + depth)), 1.1 * float(np.max(depth)))
    return _placed(camera, centre - needed * camera_frame(camera)[2], centre, camera.up)


def view_from_side(camera: Camera, side: Side) -> Camera:
    """From one side of the scene at its target: the front is on +Z, the right on +X, the top on +Y."""
    level, elevation = SIDES[side]
    return _turned_to(camera, np.array(level), elevation, Y)


def point_at(camera: Camera, resolution: tuple[int, int], column: float, row: float, depth: float) -> Float64Array:
    """What stands at a place of the picture, pixels, so many metres before the camera."""
    ray = pixel_directions(camera, resolution, column, row).astype(np.float64)
    return np.asarray(np.array(camera.position) + depth / float(ray @ camera_frame(camera)[2]) * ray)


def depth_of(camera: Camera, point: npt.ArrayLike) -> float:
    """How far before the camera a point (3,) is, metres; negative behind it."""
    return float(np.subtract(point, camera.position) @ camera_frame(camera)[2])


def _axis(camera: Camera) -> Float64Array:
    """What it turns about."""
    up = unit(np.array(camera.up))
    return Y if is_level(camera) and up[1] >= NEAR_Y else up


def _level_and_elevation(camera: Camera, axis: Float64Array) -> tuple[Float64Array, float]:
    """Where the camera stands seen from its target: the direction along the ground of an axis, and the angle above."""
    outwards = -camera_frame(camera)[2]
    height = float(np.clip(outwards @ axis, -1.0, 1.0))
    level = outwards - height * axis
    if np.linalg.norm(level) < 1e-5:  # at a pole: what is up in the picture says
        upwards = camera_frame(camera)[1]
        level = -math.copysign(1.0, height) * (upwards - (upwards @ axis) * axis)
    return unit(level), math.asin(height)


def _turned_to(camera: Camera, level: Float64Array, elevation: float, axis: Float64Array) -> Camera:
    """At the same distance from its target in that direction."""
    elevation = min(max(elevation, -MOST_ELEVATION), MOST_ELEVATION)
    outwards = math.cos(elevation) * level + math.sin(elevation) * axis
    target = np.array(camera.target)
    away = max(distance(camera), 1.01 * _least_distance(target))
    return _placed(camera, target + away * outwards, target, tuple(axis))


def _placed(camera: Camera, position: Float64Array, target: Float64Array, up: tuple[float, ...]) -> Camera:
    """There, no nearer to its target than can be told apart; the same camera where that is out of range."""
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
