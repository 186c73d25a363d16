"""Slow, obvious twin of glossy transfer: one point and one direction of light at a time."""

import math

import numpy as np

from engine.material.layer import evaluate_layer
from engine.sphere.harmonics import basis


def gloss(layer, wo, frame, sees, light, n_polar=48):
    """Radiance (3,) that a point sends along wo, in its own axes, under light (n^2, 3) given in world axes.

    frame (3, 3): the point's axes as rows; sees: whether light comes from a direction in those axes. The integral of
    reflection, cosine and light over all that is seen, by midpoints of cells of equal solid angle.
    """
    n, total = math.isqrt(len(light)), np.zeros(3)
    for i in range(n_polar):
        z = (i + 0.5) / n_polar
        for k in range(4 * n_polar):
            angle = (k + 0.5) * math.pi / (2 * n_polar)
            wi = np.array([math.sqrt(1 - z * z) * math.cos(angle), math.sqrt(1 - z * z) * math.sin(angle), z])
            if sees(wi):
                arriving = basis(frame.T @ wi, n) @ light
                total += evaluate_layer(layer, wi[None], wo[None])[0] * arriving
    return total * 2 * math.pi / (4 * n_polar * n_polar)
