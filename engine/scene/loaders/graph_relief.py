"""Normals of heights: `heighttonormal` of MaterialX, and `bump`, which is made of it [MaterialX, Standard Nodes].

With heights H and coordinates (s, t), all of them functions of texture coordinates (u, v), the normal in the frame of
s and t is that of the surface (s, t, c H), c = scale / 16:

    n ~ (∂s/∂u, ∂t/∂u, c ∂H/∂u) x (∂s/∂v, ∂t/∂v, c ∂H/∂v),      as colours 0.5 + 0.5 n.

The number 16 makes it what Sobel's filter makes of the texels of an image [MaterialX]. Derivatives are differences over
one texel of the finest image, central ones.
"""

from __future__ import annotations

import numpy as np

from engine.scene.loaders.graph_fields import Array, Field, Samples, texels_of_unit_square

_SOBEL = np.float32(1.0 / 16.0)
_DEGENERATE = 1e-24  # squared length of a normal that coordinates do not define


def normals_of_heights(heights: Field, scale: Field, coordinates: Field) -> Field:
    """The normals of a field of one channel as colours (N, 3)."""
    steps = [1.0 / n for n in texels_of_unit_square(heights)]

    def differences(samples: Samples, axis: int) -> Array:
        """The derivatives (N, 3) of coordinates and heights along u or v."""
        ends = []
        for sign in (-0.5, 0.5):
            uv = samples.uv.copy()
            uv[:, axis] += np.float32(sign * steps[axis])
            there = Samples(uv)
            parts = (coordinates.at(there), heights.at(there) * scale.at(there) * _SOBEL)
            ends.append(np.concatenate([np.broadcast_to(each, (len(uv), each.shape[1])) for each in parts], axis=1))
        return (ends[1] - ends[0]) / np.float32(steps[axis])

    def evaluate(samples: Samples) -> Array:
        normals = np.cross(differences(samples, 0), differences(samples, 1))
        length2 = (normals * normals).sum(axis=1, keepdims=True)
        # Mirrored coordinates turn the normal below the surface; where they do not vary, there is none.
        upward = np.where(normals[:, 2:] < 0.0, -normals, normals) / np.sqrt(np.maximum(length2, _DEGENERATE))
        normals = np.where(length2 < _DEGENERATE, np.array([0.0, 0.0, 1.0], np.float32), upward)
        return np.asarray(0.5 + 0.5 * normals, np.float32)

    return Field(evaluate, heights.is_constant, (*heights.images, *coordinates.images), heights.is_pattern)
