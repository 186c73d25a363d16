"""What is shown of objects before anything is computed: their colours in light from the eye, without a shadow.

The first picture may take a while (a scene that is large, kernels that have to be compiled); what there is, where it is
and roughly how it is coloured can be seen at once, from what came with the scene.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer

_SIDE = 24
_EYE = 0.5  # radians between the normal and the eye for which a colour is found
_UNREAD = 0.5  # of what is known by a file that the window does not read
_FACING, _AROUND = 0.75, 0.25


def plain_colour(layers: Iterable[Layer]) -> NDArray[np.float64]:
    """How much of white light from all around the layers reflect, (3,), each channel at most 1: rough, for a glance."""
    wi, weight = _directions()
    wo = np.broadcast_to([np.sin(_EYE), 0.0, np.cos(_EYE)], wi.shape)
    total = np.zeros(3)
    for layer in layers:
        total += _UNREAD if layer.model.needs_file else weight @ layer.brdf(wi, wo)
    return np.clip(total, 0.0, 1.0)


def plain_radiance(colour: NDArray[np.float64], theta_o: NDArray[np.floating]) -> NDArray[np.float32]:
    """Radiance (p, 3) where the normal is at these angles (p,), in radians, to the eye."""
    shade = _AROUND + _FACING * np.cos(theta_o)
    return np.asarray(shade[:, None] * colour, np.float32)


def _directions() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Even by cos θ dω: unit vectors (N, 3) about +Z, and π over their number for each, (N,)."""
    u, v = np.meshgrid((np.arange(_SIDE) + 0.5) / _SIDE, (np.arange(_SIDE) + 0.5) / _SIDE)
    cosine, azimuth = np.sqrt(1.0 - u.ravel()), 2 * np.pi * v.ravel()
    sine = np.sqrt(u.ravel())
    wi = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1)
    return wi, np.full(len(wi), np.pi / len(wi))
