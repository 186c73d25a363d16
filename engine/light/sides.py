"""The six sides of an environment, as the faces of a cube around the scene: each can be brighter or of another colour.

Side s has the weight w_s(d) = max(d · n_s, 0)^p / Σ_t max(d · n_t, 0)^p in direction d, with n_s the side's normal. The
weights are smooth and sum to one, so environments of single sides sum to the whole one, and no edge shows where
neighbours differ. Along the edge between two faces both have 1/2, at a corner three have 1/3.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from engine.light.environment import Environment

RGB = tuple[float, float, float]
# Their normals in the environment before it is rotated: the middle of its image is in front.
SIDES = MappingProxyType({
    "front": (0.0, 0.0, -1.0), "right": (1.0, 0.0, 0.0), "back": (0.0, 0.0, 1.0), "left": (-1.0, 0.0, 0.0),
    "up": (0.0, 1.0, 0.0), "down": (0.0, -1.0, 0.0),
})  # fmt: skip
# p: two neighbours fade into each other over 32 degrees (weights of 0.1 to 0.9).
POWER = 8
# Coarser images are refined: a weight must not change much from texel to texel.
_FEWEST_ROWS = 64


def side_weights(directions: NDArray[np.floating]) -> NDArray[np.float64]:
    """The weights (N, 6) of the sides, in the order of `SIDES`, in directions (N, 3), which need not be unit."""
    towards = np.asarray(directions, np.float64) @ np.array(list(SIDES.values())).T
    towards /= np.abs(towards).max(axis=1, keepdims=True)
    powers = np.maximum(towards, 0.0) ** POWER
    return np.asarray(powers / powers.sum(axis=1, keepdims=True))


@lru_cache(maxsize=8)  # the same object again, whose integrals are known
def with_side_gains(environment: Environment, gains: tuple[RGB, ...]) -> Environment:
    """The environment with each side times its colour, linear Rec. 709, in the order of `SIDES`; itself where all of
    them are white."""
    if all(gain == (1.0, 1.0, 1.0) for gain in gains):
        return environment
    image = environment.radiance
    repeats = -(-_FEWEST_ROWS // len(image)), -(-2 * _FEWEST_ROWS // image.shape[1])
    image = np.repeat(np.repeat(image, repeats[0], axis=0), repeats[1], axis=1)
    factors = _weights(*image.shape[:2]) @ np.array(gains, np.float32)
    return replace(environment, radiance=image * factors, base=None, suns=())


@lru_cache(maxsize=2)
def _weights(height: int, width: int) -> NDArray[np.float32]:
    """The weights (H, W, 6) at the centres of an image's texels."""
    theta = math.pi * (np.arange(height) + 0.5) / height
    phi = 2.0 * math.pi * ((np.arange(width) + 0.5) / width - 0.5)
    y = np.broadcast_to(np.cos(theta)[:, None], (height, width))
    x, z = np.sin(theta)[:, None] * np.sin(phi), -np.sin(theta)[:, None] * np.cos(phi)
    return side_weights(np.stack([x, y, z], axis=-1).reshape(-1, 3)).astype(np.float32).reshape(height, width, 6)
