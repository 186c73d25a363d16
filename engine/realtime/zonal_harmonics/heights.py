"""Height fields of small patches that repeat over a surface, by formula or from an image's brightness.

Each is (H, W), in units of the patch's side, row 0 at the top, and continues without a seam on all sides.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]

SIDE = 128


def bumps(side: int = SIDE) -> Float64Array:
    """Hemispheres in staggered rows."""
    u, v = _places(side)
    radius, height = 0.19, np.zeros((side, side))
    for at_u, at_v in ((0.25, 0.25), (0.75, 0.25), (0.0, 0.75), (0.5, 0.75)):
        square = _periodic_distance(u, at_u) ** 2 + _periodic_distance(v, at_v) ** 2
        height = np.maximum(height, np.sqrt(np.maximum(radius**2 - square, 0.0)))
    return height


def waffle(side: int = SIDE) -> Float64Array:
    """Square pits with slanting sides between bars."""
    u, v = _places(side)
    to_bar = np.minimum(*(0.125 - np.abs(np.mod(each, 0.25) - 0.125) for each in (u, v)))
    return 0.12 * (1.0 - _smooth((to_bar - 0.02) / 0.045))


def swirl(side: int = SIDE) -> Float64Array:
    """Ridges that spiral around the patch's centre and flatten towards its edge."""
    u, v = _places(side)
    x, y = u - 0.5, v - 0.5
    radius = np.hypot(x, y)
    wave = 0.5 + 0.5 * np.cos(3.0 * np.arctan2(y, x) + 40.0 * radius)
    return 0.06 * wave * _smooth(radius / 0.06) * (1.0 - _smooth((radius - 0.3) / 0.18))


def weave(side: int = SIDE) -> Float64Array:
    """Four round threads in each direction that pass over and under each other."""
    u, v = _places(side)
    up, across = (_thread(each) for each in (u, v))
    # At a crossing one thread is above: crossings alternate like the squares of a chess board.
    turn = np.cos(4.0 * np.pi * u) * np.cos(4.0 * np.pi * v)
    return np.asarray(0.03 * np.maximum(up * (1.0 + 0.8 * turn), across * (1.0 - 0.8 * turn)))


def of_image(image: ArrayLike, height: float = 0.1) -> Float64Array:
    """From an image's brightness (H, W) or linear RGB (H, W, 3): black at 0, the brightest at `height` [Sloan05, 6].

    Raises ValueError if it is not an image of finite numbers.
    """
    values = np.asarray(image, np.float64)
    if values.ndim not in (2, 3) or 0 in values.shape or not np.isfinite(values).all():
        raise ValueError(f"a picture of shape {values.shape}, expected finite (H, W) or (H, W, 3)")
    grey = values @ (0.2126, 0.7152, 0.0722) if values.ndim == 3 else values
    low, high = float(grey.min()), float(grey.max())
    return np.asarray((grey - low) * (height / (high - low)) if high > low else np.zeros(grey.shape))


PATTERNS: dict[str, Callable[..., Float64Array]] = {"bumps": bumps, "waffle": waffle, "swirl": swirl, "weave": weave}


def _places(side: int) -> tuple[Float64Array, Float64Array]:
    """u and v (H, W) of the texels' centres."""
    middle = (np.arange(side) + 0.5) / side
    return np.tile(middle, (side, 1)), np.tile(1.0 - middle[:, None], (1, side))


def _periodic_distance(value: Float64Array, place: float, period: float = 1.0) -> Float64Array:
    """Distance to the nearest of periodic places."""
    return np.abs(np.mod(value - place + period / 2.0, period) - period / 2.0)


def _thread(value: Float64Array) -> Float64Array:
    """Profile of threads that are a quarter apart."""
    return np.asarray(np.sqrt(np.maximum(1.0 - (_periodic_distance(value, 0.0, 0.25) / 0.11) ** 2, 0.0)))


def _smooth(value: Float64Array) -> Float64Array:
    """Smooth step from 0 below 0 to 1 above 1."""
    t = np.clip(value, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
