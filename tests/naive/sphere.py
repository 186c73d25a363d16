"""Slow, obvious twins of the geodesic sphere and of integrals over it."""

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import Environment
from engine.sphere.geodesic import geodesic


def holds(directions: NDArray[np.float64], corners: NDArray[np.float64], slack: float = 0.0) -> NDArray[np.bool_]:
    """(N, T): whether triangle corners (T, 3, 3) hold directions (N, 3), that is, left of all three edges."""
    inside = np.ones((len(directions), len(corners)), bool)
    for k in range(3):
        normals = np.cross(corners[:, k], corners[:, (k + 1) % 3])
        inside &= directions @ normals.T >= -slack
    return inside


def vertex_neighbours(triangles: NDArray[np.integer]) -> NDArray[np.int32]:
    """(T, 12): every other triangle that shares a vertex, ascending, padded with -1 at the end."""
    around = np.full((len(triangles), 12), -1, np.int32)
    for i, corners in enumerate(triangles):
        there = np.flatnonzero(np.isin(triangles, corners).any(axis=1))
        there = there[there != i]
        around[i, : len(there)] = there
    return around


def directions_of_texels(height: int, width: int) -> NDArray[np.float64]:
    """(H, W, 3): the direction of every texel's centre, by the formula of docs/conventions.md."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2.0 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    sine = np.sin(theta)[:, None]
    return np.stack(
        [sine * np.sin(phi), np.broadcast_to(np.cos(theta)[:, None], (height, width)), -sine * np.cos(phi)], axis=2
    )


def nearest_radiance(environment: Environment, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3): radiance of the texel that holds each unit direction, no rotation."""
    height, width, _ = environment.radiance.shape
    u = np.arctan2(directions[:, 0], -directions[:, 2]) / (2.0 * np.pi) + 0.5
    v = np.arccos(np.clip(directions[:, 1], -1.0, 1.0)) / np.pi
    row = np.minimum((v * height).astype(int), height - 1)
    return environment.radiance[row, (u * width).astype(int) % width].astype(np.float64)


def integral_by_descendants(environment: Environment, level: int, finer: int) -> NDArray[np.float64]:
    """(T, 3): sum of radiance at the centres of the descendants `finer` levels down times their solid angles."""
    sphere = geodesic(level + finer)
    light = nearest_radiance(environment, sphere.centres) * sphere.solid_angles[:, None]
    return light.reshape(-1, 4**finer, 3).sum(axis=1)
