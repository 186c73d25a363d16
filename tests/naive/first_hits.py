"""The slow, obvious twin of the ray caster: every ray against every triangle [MollerTrumbore97]."""

import numpy as np


def first_hits(vertices, triangles, origins, directions):
    """Triangle (R,) of each ray's nearest hit, −1 for none, and its distance (R,), inf for none; all in float64."""
    a, b, c = np.asarray(vertices, np.float64)[triangles].transpose(1, 0, 2)
    one, two = b - a, c - a
    nearest, distance = np.full(len(origins), -1), np.full(len(origins), np.inf)
    for k, (origin, direction) in enumerate(zip(np.float64(origins), np.float64(directions), strict=True)):
        p = np.cross(direction, two)
        determinant = (one * p).sum(1)
        usable = np.abs(determinant) > 1e-300
        inverse = np.where(usable, 1.0 / np.where(usable, determinant, 1.0), 0.0)
        s = origin - a
        u = (s * p).sum(1) * inverse
        q = np.cross(s, one)
        v = (q @ direction) * inverse
        t = (two * q).sum(1) * inverse
        hit = usable & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if hit.any():
            nearest[k] = np.argmin(np.where(hit, t, np.inf))
            distance[k] = t[nearest[k]]
    return nearest, distance
