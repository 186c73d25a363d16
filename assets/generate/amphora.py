"""Amphora: a bellied jar with texture coordinates all over, for patches of detail; after [Sloan05, fig. 7]."""

import numpy as np

from .mesh import Floats, Mesh, with_coordinates
from .surfaces import bezier, carried, circle, grid_faces, rounded_profile

AROUND, TILES = 96, 9  # patches round the belly, each as high as it is wide there


def meshes() -> dict[str, Mesh]:
    return {"jar": jar(), "foot": carried(rounded_profile(_FOOT, arc_points=4), circle(64))}


# (radius, height, fillet) from the floor outward and up.
_FOOT = [(0.0, 0.0, 0), (0.13, 0.0, 0.002), (0.13, 0.016, 0.006), (0.115, 0.026, 0.006), (0.0, 0.03, 0)]


def jar() -> Mesh:
    """Its wall from the foot to the lip and some way down inside; open above, and patches as large everywhere."""
    t = np.linspace(0, 1, 20)
    curves = [
        [(0.050, 0.030), (0.085, 0.060), (0.128, 0.130), (0.128, 0.205)],
        [(0.128, 0.205), (0.128, 0.290), (0.045, 0.300), (0.045, 0.365)],
        [(0.045, 0.365), (0.045, 0.395), (0.055, 0.410), (0.072, 0.418)],
        [(0.072, 0.418), (0.076, 0.422), (0.072, 0.424), (0.066, 0.418)],
        [(0.066, 0.418), (0.050, 0.408), (0.040, 0.395), (0.040, 0.330)],
    ]
    profile = np.concatenate([bezier(np.array(curve), t[1 if i else 0 :]) for i, curve in enumerate(curves)])
    way = np.gradient(profile, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    turn = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)  # the seam's vertices are there twice, for u of 0 and of 9
    sine, cosine = -np.sin(turn), np.cos(turn)  # from the front to the left
    positions = _carried(profile[:, 0], profile[:, 1], sine, cosine)
    normals = _carried(way[:, 1], -way[:, 0], sine, cosine)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    size = 2.0 * np.pi * 0.128 / TILES
    u, v = np.broadcast_arrays(TILES * (1.0 - turn / (2.0 * np.pi)), along[:, None] / size)
    mesh = Mesh(positions, normals, grid_faces(len(profile), AROUND + 1))
    return with_coordinates(mesh, np.stack([u.ravel(), v.ravel()], axis=1))


def _carried(radius: Floats, height: Floats, sine: Floats, cosine: Floats) -> Floats:
    upright = np.broadcast_to(height[:, None], (len(radius), len(sine)))
    return np.stack([radius[:, None] * sine, upright, radius[:, None] * cosine], axis=-1).reshape(-1, 3)
