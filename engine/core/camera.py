"""The pinhole camera: rays through pixel centres, or any other place in a pixel.

right = forward × up, true up = right × forward; the picture's height spans `fov_y`, its width follows from the
resolution's aspect. Pixel (0, 0) is the upper left.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from engine.scene.description import Camera


def camera_frame(camera: Camera) -> npt.NDArray[np.float64]:
    """Rows right, up, forward of the camera, orthonormal (3, 3)."""
    forward = unit(np.subtract(camera.target, camera.position))
    right = unit(np.cross(forward, unit(np.array(camera.up))))
    return np.stack([right, np.cross(right, forward), forward])


def unit(vector: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Normalize a vector (3,), however short it is: the square of 1e-170 would be zero."""
    vector = vector / np.abs(vector).max()
    return np.asarray(vector / np.linalg.norm(vector))


def pixel_directions(
    camera: Camera, resolution: tuple[int, int], columns: npt.ArrayLike, rows: npt.ArrayLike
) -> npt.NDArray[np.float32]:
    """Unit directions (..., 3) through the picture's points (columns, rows), in pixels from the upper left corner.

    A pixel's centre is at its index plus ½. resolution is (width, height).
    """
    width, height = resolution
    half = math.tan(math.radians(camera.fov_y) / 2)
    x = (np.asarray(columns, np.float64) / width * 2 - 1) * half * width / height
    y = (1 - np.asarray(rows, np.float64) / height * 2) * half
    right, up, forward = camera_frame(camera)
    directions = forward + x[..., None] * right + y[..., None] * up
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return directions.astype(np.float32)


def camera_plane(camera: Camera, resolution: tuple[int, int]) -> npt.NDArray[np.float64]:
    """The picture's plane at depth 1 (3, 3): rows from the camera to the upper left corner, one pixel to the right, one
    pixel down. Row 0 + column · row 1 + row · row 2 has the direction of `pixel_directions`.

    resolution is (width, height).
    """
    (width, height), half = resolution, math.tan(math.radians(camera.fov_y) / 2)
    right, up, forward = camera_frame(camera)
    corner = forward - half * width / height * right + half * up
    return np.stack([corner, right * (2.0 * half / height), up * (-2.0 * half / height)])


def project(
    camera: Camera, resolution: tuple[int, int], directions: npt.NDArray[np.floating]
) -> npt.NDArray[np.float64]:
    """Project directions (..., 3) from the camera, of any length and in front of it, to columns and rows (..., 2),
    pixels from the upper left corner; the inverse of `pixel_directions`."""
    width, height = resolution
    half = math.tan(math.radians(camera.fov_y) / 2)
    x, y, depth = np.moveaxis(np.asarray(directions, np.float64) @ camera_frame(camera).T, -1, 0)
    depth = np.maximum(depth, 1e-9)
    columns = 0.5 * width + 0.5 * height * x / (depth * half)
    return np.stack([columns, 0.5 * height * (1.0 - y / (depth * half))], axis=-1)


def centre_directions(camera: Camera, resolution: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Unit directions (H, W, 3) through all pixel centres, row 0 at the top."""
    width, height = resolution
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return pixel_directions(camera, resolution, columns, rows)
