"""Compiled: vectors to and from local frames, see `engine.core.frames`. The precision is that of frame and vector."""

from __future__ import annotations

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
