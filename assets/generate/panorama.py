"""Lat-long pictures of generated surroundings: their directions, supersampling, noise, and the half-float EXR file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR

from .mesh import Floats

WIDTH, HEIGHT = 512, 256


def directions(height: int, width: int) -> Floats:
    """Unit directions (height, width, 3) of the pixel centres; frames as in docs/conventions.md."""
    theta = np.pi * (np.arange(height)[:, None] + 0.5) / height
    phi = 2 * np.pi * ((np.arange(width)[None] + 0.5) / width - 0.5)
    return np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta) * np.ones_like(phi), -np.sin(theta) * np.cos(phi)], axis=-1
    )


def panorama(radiance: Callable[[Floats], Floats], samples: int = 4) -> Floats:
    """The picture (HEIGHT, WIDTH, 3) of radiance (N, 3) -> (N, 3), `samples`² to a texel, averaged by solid angle."""
    fine = directions(HEIGHT * samples, WIDTH * samples)
    weight = np.sqrt(1 - fine[..., 1:2] ** 2)
    bands = np.array_split(np.arange(len(fine)), 16)
    values = np.concatenate([radiance(fine[rows].reshape(-1, 3)) for rows in bands]).reshape(fine.shape) * weight
    shape = (HEIGHT, samples, WIDTH, samples)
    return values.reshape(*shape, 3).sum(axis=(1, 3)) / weight.reshape(*shape, 1).sum(axis=(1, 3))


def save_exr(image: Floats, path: Path) -> None:
    """Half floats, R G B, ZIP; values must fit a half."""
    if not (np.isfinite(image).all() and image.min() >= 0 and image.max() < 65000):
        raise ValueError(f"radiance from {image.min()} to {image.max()} does not fit half floats")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(image, dtype=np.float16)}) as file:
        file.write(str(path))


def smooth_step(edge0: float, edge1: float, x: Floats) -> Floats:
    t = np.clip((x - edge0) / (edge1 - edge0), 0, 1)
    return t * t * (3 - 2 * t)


def hashed(cells: Floats, seed: int = 0) -> Floats:
    """A number in [0, 1) for each row of whole numbers (N, D), the same on every machine."""
    state = np.full(cells.shape[:-1], seed * 0x9E3779B9 + 0x85EBCA6B, np.uint64)
    for axis in range(cells.shape[-1]):
        state = state ^ (cells[..., axis].astype(np.int64).astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15))
        state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        state = state ^ (state >> np.uint64(31))
    return (state >> np.uint64(11)).astype(np.float64) / 2.0**53


def noise(points: Floats, seed: int = 0, octaves: int = 4) -> Floats:
    """Value noise of points (N, 2) in [0, 1], each octave half as strong and twice as fine as the one before."""
    total, weight = np.zeros(len(points)), 0.0
    for octave in range(octaves):
        scaled = points * 2.0**octave + 17.3 * octave
        cell = np.floor(scaled)
        f = scaled - cell
        f = f * f * (3 - 2 * f)
        corners = [hashed(cell + np.array(offset), seed + octave) for offset in ((0, 0), (1, 0), (0, 1), (1, 1))]
        low = corners[0] + (corners[1] - corners[0]) * f[:, 0]
        high = corners[2] + (corners[3] - corners[2]) * f[:, 0]
        total += (low + (high - low) * f[:, 1]) * 0.5**octave
        weight += 0.5**octave
    return total / weight
