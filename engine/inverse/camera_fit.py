"""Finds the camera of a photograph from points of the scene whose places in it are known.

Position, direction and angle of view, seven numbers, bring the points nearest to their places, by squared distance in
pixels: four pairs give eight. It is solved from several cameras around the points by Levenberg and Marquardt's method
[More78], because from the wrong side there is another minimum. The centre of the photograph is that of the lens: it is
not cropped to one side, and not distorted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.camera import camera_frame
from engine.core.errors import InsituError
from engine.scene.description import Camera

Vector = tuple[float, float, float]
Float64Array = NDArray[np.float64]

LEAST_PAIRS = 4
# The largest number of a pair: cameras around such points are within what a camera may have.
FARTHEST = 1e8
# Root mean square distance from which on pairs do not belong together, relative to the photograph's diagonal.
MOST_MISSED = 0.02
_NARROWEST, _WIDEST = 1.0, 150.0
# One pixel of the picture counts as much as this change of the tangent of half the angle of view, by its logarithm:
# with few pairs a camera that is nearly right stays near.
_VIEW_WEIGHT = 1e-2
_BEHIND = 1e3


class PointPair(NamedTuple):
    """A place in the photograph, column and row in pixels from its upper left corner, and the point there, metres."""

    place: tuple[float, float]
    point: Vector


@dataclass(frozen=True)
class CameraFit:
    """missed: the distance of each point from its place, in pixels of the photograph."""

    camera: Camera
    missed: tuple[float, ...]

    @property
    def error(self) -> float:
        """By root mean square, pixels."""
        return math.sqrt(sum(each * each for each in self.missed) / len(self.missed))


def fit_camera(pairs: Sequence[PointPair], size: tuple[int, int], start: Camera) -> CameraFit:
    """The camera of a photograph of this (width, height); start: one that may be near. Raises InsituError where pairs
    say too little or contradict each other."""
    places, points = _checked(pairs, size)
    most = MOST_MISSED * math.hypot(*size)
    found = _nearest(places, points, size, start)
    if found is not None and found.error <= most:
        return found
    for number in range(len(pairs) if len(pairs) > LEAST_PAIRS else 0):
        others = _nearest(np.delete(places, number, 0), np.delete(points, number, 0), size, start)
        if others is not None and others.error <= most:
            raise InsituError(
                f"pair {number + 1} contradicts the others: without it a camera sees them at their places"
            )
    missed = "" if found is None else f" within {most:.0f} pixels, the nearest misses them by {found.error:.0f}"
    raise InsituError(f"no camera sees these points at their places{missed}")


def _nearest(places: Float64Array, points: Float64Array, size: tuple[int, int], start: Camera) -> CameraFit | None:
    """The camera that sees the points nearest to their places; None where none has all of them before it."""
    refined = (_refined(each, places, points, size) for each in _starts(start, points))
    return min((each for each in refined if each is not None), key=lambda each: each.error, default=None)


def _checked(pairs: Sequence[PointPair], size: tuple[int, int]) -> tuple[Float64Array, Float64Array]:
    """Places (n, 2) and points (n, 3)."""
    if len(pairs) < LEAST_PAIRS:
        raise InsituError(f"{len(pairs)} point pairs, expected {LEAST_PAIRS} or more")
    places = np.array([pair.place for pair in pairs], np.float64)
    points = np.array([pair.point for pair in pairs], np.float64)
    for number, values in enumerate(np.hstack([places, points]), 1):
        if not np.isfinite(values).all() or np.abs(values).max() > FARTHEST:
            raise InsituError(f"pair {number}: {values.tolist()}, expected finite numbers up to {FARTHEST:g}")
    for what, values, least in (("places", places, 1e-3 * math.hypot(*size)), ("points", points, 0.0)):
        spread = np.linalg.svd(values - values.mean(axis=0), compute_uv=False)
        if not spread[1] > max(least, 1e-3 * spread[0]):
            raise InsituError(f"the {what} of the pairs are on one line, expected them spread over the picture")
    return places, points


def _starts(start: Camera, points: Float64Array) -> list[Camera]:
    """Cameras to begin with: the given one, and others that look at the points from all sides."""
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(points - middle, axis=1).max())
    starts = [start]
    for elevation in (-0.3, 0.35, 1.0):
        for azimuth in np.arange(8) * (math.pi / 4.0):
            level = math.cos(elevation)
            direction = np.array([level * math.sin(azimuth), math.sin(elevation), level * math.cos(azimuth)])
            x, y, z = (middle + 4.0 * size * direction).tolist()
            starts.append(Camera(position=(x, y, z), target=_vector(middle), fov_y=start.fov_y))
    return starts


def _refined(start: Camera, places: Float64Array, points: Float64Array, size: tuple[int, int]) -> CameraFit | None:
    """The nearest minimum to a camera; None where points are behind it there."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    frame, (width, height) = camera_frame(start), size
    scale = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
    tangent = math.tan(math.radians(start.fov_y) / 2.0)

    def seen(x: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Places (n, 2) of the points and their depths (n,). x: changes of the position by the points' size, of the
        rotation, and of the tangent's logarithm."""
        turned = Rotation.from_rotvec(x[3:6]).as_matrix() @ frame
        right, up, depth = turned @ (points - np.array(start.position) - scale * x[:3]).T
        near = np.maximum(depth, 1e-6 * scale)
        half = height / (2.0 * tangent * math.exp(np.clip(x[6], -5.0, 5.0)))
        return np.stack([width / 2 + half * right / near, height / 2 - half * up / near], axis=1), depth

    def residuals(x: Float64Array) -> Float64Array:
        found, depth = seen(x)
        behind = _BEHIND * np.maximum(-depth / scale, 0.0)
        return np.concatenate([(found - places).ravel(), behind, [_VIEW_WEIGHT * x[6]]])

    found = least_squares(residuals, np.zeros(7), method="trf", x_scale="jac", max_nfev=200)
    at, depth = seen(found.x)
    fov = math.degrees(2.0 * math.atan(tangent * math.exp(found.x[6])))
    if not (depth > 0.0).all() or not np.isfinite(at).all() or not _NARROWEST <= fov <= _WIDEST:
        return None
    right, up, forward = Rotation.from_rotvec(found.x[3:6]).as_matrix() @ frame
    position = np.array(start.position) + scale * found.x[:3]
    camera = Camera(
        position=_vector(position), target=_vector(position + float(depth.mean()) * forward), up=_vector(up), fov_y=fov
    )
    return CameraFit(camera, tuple(np.linalg.norm(at - places, axis=1).tolist()))


def _vector(values: Float64Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
