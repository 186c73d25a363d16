"""Pictures (H, W, 8) of which some objects' part comes apart: light and alpha of all, then the same of these alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]


def with_part(values: Float32Array, is_apart: NDArray[np.bool_]) -> Float32Array:
    """Light and alpha (..., 4), followed by the same where `is_apart` (...) and by 0 elsewhere."""
    return np.concatenate([values, np.where(is_apart[..., None], values, np.float32(0.0))], axis=-1)


def parts_of(picture: Float32Array) -> tuple[Float32Array, Float32Array | None]:
    """A picture (H, W, 3 or 4), and where it has one the part (H, W, 4) that comes apart."""
    return (picture[..., :4], picture[..., 4:]) if picture.shape[2] == 8 else (picture, None)
