"""Validates one camera's view before its arrays go to the graphics card."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.scene.picture_frame import PictureFrame
from ui.gl.context import GraphicsError


def require_sound(frame: PictureFrame) -> None:
    """Raise GraphicsError naming the array that does not fit."""
    image, n_image = (frame.height, frame.width), frame.width * frame.height
    shapes = {
        "object_ranges": (frame.object_ranges.shape, (frame.n_objects, 2)),
        "theta_o": (frame.theta_o.shape, (frame.n_points,)),
        "emission_image": (frame.emission_image.shape, (*image, 3)),
        "ray_directions": (frame.ray_directions.shape, (*image, 3)),
        "share": (frame.share.shape, (frame.n_points,)),
        "open_image": (frame.open_image.shape, image),
    }
    for name, (found, expected) in shapes.items():
        if found != expected:
            raise GraphicsError(f"{name} of shape {found}, expected {expected}")
    _refuse_outside("pixel", frame.pixel, n_image)
    _refuse_outside("object_ranges", frame.object_ranges, frame.n_points + 1)


def _refuse_outside(name: str, indices: NDArray[np.integer], end: int) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= end):
        raise GraphicsError(f"{name} holds {indices.min()} to {indices.max()}, expected 0 to {end - 1}")
