"""Compiled: vectors to and from local frames, see `engine.core.frames`. The precision is that of frame and vector."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def to_local(frame: NDArray[np.floating], x: float, y: float, z: float) -> tuple[Any, Any, Any]:
    """A world vector's coordinates in a frame: its products with the rows of frame (3, 3)."""
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def to_world(frame: NDArray[np.floating], x: float, y: float, z: float) -> tuple[Any, Any, Any]:
    """A world vector from its coordinates in a frame: the sum of the rows of frame (3, 3), weighted."""
    return (
        frame[0, 0] * x + frame[1, 0] * y + frame[2, 0] * z,
        frame[0, 1] * x + frame[1, 1] * y + frame[2, 1] * z,
        frame[0, 2] * x + frame[1, 2] * y + frame[2, 2] * z,
    )


_SHORT = 1e-12  # length below which a vector has no direction


@njit(cache=True, nogil=True, error_model="numpy")
def orthonormal_range(
    start: int, stop: int, frames: NDArray[np.float64], instead: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Fill out[start:stop] (V, 3, 3) as `engine.core.frames.orthonormal` documents."""
    for v in range(start, stop):
        orthonormalize(frames[v, 0], frames[v, 2], instead[v], out[v])


@njit(cache=True, nogil=True, error_model="numpy")
def orthonormalize(
    tangent: NDArray[np.float64], normal: NDArray[np.float64], instead: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Fill out (3, 3) with the unit normal, the unit tangent perpendicular to it, and their bitangent; where a vector
    has no length, with that of instead (3, 3)."""
    n = _unit(normal[0], normal[1], normal[2], instead[2, 0], instead[2, 1], instead[2, 2])
    own, other = _across(tangent[0], tangent[1], tangent[2], n), _across(instead[0, 0], instead[0, 1], instead[0, 2], n)
    t = _unit(own[0], own[1], own[2], other[0], other[1], other[2])
    last = _cross((instead[1, 0], instead[1, 1], instead[1, 2]), n)
    t = _unit(t[0], t[1], t[2], last[0], last[1], last[2])
    b = _cross(n, t)
    for i in range(3):
        out[0, i], out[1, i], out[2, i] = t[i], b[i], n[i]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _unit(x: float, y: float, z: float, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Normalize (x, y, z); where it has no length, (a, b, c)."""
    length = math.sqrt(x * x + y * y + z * z)
    if length > _SHORT:
        return x / length, y / length, z / length
    length = max(math.sqrt(a * a + b * b + c * c), _SHORT)
    return a / length, b / length, c / length


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _across(x: float, y: float, z: float, n: tuple[float, float, float]) -> tuple[float, float, float]:
    """The part of a vector perpendicular to a unit normal."""
    along = x * n[0] + y * n[1] + z * n[2]
    return x - along * n[0], y - along * n[1], z - along * n[2]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
