"""Patterns of MaterialX that are computed from coordinates: gradient noise, its octaves, cells and Worley's distances
[MaterialX, Procedural Nodes; Perlin02; Worley96].

Each is on a lattice of unit cells, in two or three dimensions, and random by a hash of the cell's integers, Jenkins'
lookup3 [Jenkins06]. Values are in single precision, in the order of operations of the reference, so that they are the
numbers that other programs have: the hash, and so cells, bit for bit, the rest to rounding.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from engine.scene.loaders.graph_fields import Array

UInt32Array = NDArray[np.uint32]

MOST_OCTAVES = 16  # of one node: further ones are finer than a texel of any map
_FINAL_TURNS = (14, 11, 25, 16, 4, 14, 24)
_MIXING_TURNS = (4, 6, 8, 16, 19, 4)
# What normalizes noise of two and of three dimensions, whose gradients are not of length 1.
_GRADIENT_SCALE = {2: np.float32(0.6616), 3: np.float32(0.982)}
# What is added to coordinates for a channel of its own, in noise and in fractals.
_FOURTH = {2: (19.0, 73.0), 3: (19.0, 73.0, 29.0)}
_OTHER = {2: (19.0, 193.0), 3: (19.0, 193.0, 17.0)}
_FAR = np.float32(1e6)
# By category: the coordinates, and what else there is.
_NOISE, _FRACTAL, _WORLEY = (
    ("amplitude", "pivot"),
    ("amplitude", "octaves", "lacunarity", "diminish"),
    ("jitter", "style"),
)
PATTERNS: Mapping[str, tuple[str, ...]] = {
    "noise2d": ("texcoord", *_NOISE), "noise3d": ("position", *_NOISE),
    "fractal2d": ("texcoord", *_FRACTAL), "fractal3d": ("position", *_FRACTAL),
    "cellnoise2d": ("texcoord",), "cellnoise3d": ("position",),
    "worleynoise2d": ("texcoord", *_WORLEY), "worleynoise3d": ("position", *_WORLEY),
}  # fmt: skip
"""The inputs of each node, its coordinates first."""


def pattern(category: str, n: int, places: Array, *inputs: Array) -> Array:
    """Values (N, n) of a node at places (N, 2 or 3), for its further inputs (N, C) in the order of `PATTERNS`."""
    if category.startswith("noise"):
        amplitude, pivot = inputs
        return noise(places, n) * amplitude + pivot
    if category.startswith("fractal"):
        amplitude, octaves, lacunarity, diminish = inputs
        return fractal(places, n, int(octaves.flat[0]), lacunarity, diminish) * amplitude
    if category.startswith("cellnoise"):
        return cells(_lattice(places)[0], 1)
    jitter, style = inputs
    return worley(places, n, jitter, is_solid=int(style.flat[0]) == 1)


# --------------------------------------------------------------------------------------------------------- the hash


def lattice_hash(*integers: UInt32Array) -> UInt32Array:
    """lookup3 of one to five 32-bit integers [Jenkins06], as one number (N,)."""
    start = np.uint32((0xDEADBEEF + 4 * len(integers) + 13) & 0xFFFFFFFF)
    state = [np.full_like(integers[0], start) for _ in range(3)]
    for k, each in enumerate(integers):
        if k == 3:
            _mix(state)
        state[k % 3] = state[k % 3] + each
    for k, turn in enumerate(_FINAL_TURNS):
        into, of = (k + 2) % 3, (k + 1) % 3
        state[into] = (state[into] ^ state[of]) - _turned(state[of], turn)
    return state[2]


def _mix(state: list[UInt32Array]) -> None:
    for k, turn in enumerate(_MIXING_TURNS):
        into, other, of = k % 3, (k + 1) % 3, (k + 2) % 3
        state[into] = (state[into] - state[of]) ^ _turned(state[of], turn)
        state[of] = state[of] + state[other]


def _turned(words: UInt32Array, n_bits: int) -> UInt32Array:
    """Bits that are shifted to the left and come in again on the right."""
    return (words << np.uint32(n_bits)) | (words >> np.uint32(32 - n_bits))


def _lattice(places: Array) -> tuple[list[UInt32Array], Array]:
    """The integers of the cells of places (N, D), one array for each coordinate, and the places within their cells."""
    low = np.floor(places)
    whole = np.clip(np.nan_to_num(low.astype(np.float64)), -(2.0**31), 2.0**31 - 1.0).astype(np.int64)
    return [each.astype(np.uint32) for each in (whole & 0xFFFFFFFF).T], places - low


# -------------------------------------------------------------------------------------------------------- the patterns


def cells(lattice: list[UInt32Array], n: int) -> Array:
    """Numbers in [0, 1] (N, n), the same all over a cell."""
    words = (
        [lattice_hash(*lattice)] if n == 1 else [lattice_hash(*lattice, np.full_like(lattice[0], k)) for k in range(n)]
    )
    return np.stack([each.astype(np.float32) / np.float32(0xFFFFFFFF) for each in words], axis=1)


def noise(places: Array, n: int) -> Array:
    """Gradient noise [Perlin02] (N, n) about 0. A fourth channel is that of another place."""
    if n == 4:
        return np.concatenate([noise(places, 3), noise(_moved(places, _FOURTH), 1)], axis=1)
    lattice, within = _lattice(places)
    n_axes = within.shape[1]
    # The dot products with the gradients of the cell's corners, x fastest.
    found: list[Array] = []
    for corner in itertools.product((0, 1), repeat=n_axes):
        steps = corner[::-1]
        word = lattice_hash(*(each + np.uint32(step) for each, step in zip(lattice, steps, strict=True)))
        away = [within[:, k] - np.float32(step) for k, step in enumerate(steps)]
        # Channels take their gradients from one byte each of the hash.
        found.append(np.stack([_slope(word >> np.uint32(8 * k), away) for k in range(n)], axis=1))
    for k in range(n_axes):
        t = within[:, k : k + 1]
        share = t * t * t * (t * (t * np.float32(6.0) - np.float32(15.0)) + np.float32(10.0))
        rest = np.float32(1.0) - share
        ends = zip(found[::2], found[1::2], strict=True)
        found = [np.asarray(rest * low + share * high, np.float32) for low, high in ends]
    return _GRADIENT_SCALE[n_axes] * found[0]


def _slope(word: UInt32Array, away: list[Array]) -> Array:
    """The dot product of a vector (N,) for each axis with the gradient that the low bits of a hash choose: in the plane
    (±1, ±2) or (±2, ±1), in space from the middle of a cube to one of its edges."""
    if len(away) == 2:
        bits, (x, y) = word & np.uint32(7), away
        is_steep = bits < 4
        first, second = np.where(is_steep, x, y), np.float32(2.0) * np.where(is_steep, y, x)
    else:
        bits, (x, y, z) = word & np.uint32(15), away
        first = np.where(bits < 8, x, y)
        second = np.where(bits < 4, y, np.where((bits == 12) | (bits == 14), x, z))
    return np.where(bits & np.uint32(1), -first, first) + np.where(bits & np.uint32(2), -second, second)


def fractal(places: Array, n: int, octaves: int, lacunarity: Array, diminish: Array) -> Array:
    """Octaves of noise (N, n), each as often as the last times `lacunarity`, and as strong as it times `diminish`."""
    if n in (2, 4):  # a second or fourth channel is that of another place
        first = fractal(places, n - 1, octaves, lacunarity, diminish)
        other = fractal(_moved(places, _OTHER), 1, octaves, lacunarity, diminish)
        return np.concatenate([first, other], axis=1)
    found, amplitude = np.zeros((len(places), n), np.float32), np.ones((1, 1), np.float32)
    for _ in range(min(octaves, MOST_OCTAVES)):
        found = found + amplitude * noise(places, n)
        amplitude, places = amplitude * diminish, places * lacunarity
    return found


def _moved(places: Array, by: Mapping[int, tuple[float, ...]]) -> Array:
    return places + np.array(by[places.shape[1]], np.float32)


def worley(places: Array, n: int, jitter: Array, is_solid: bool = False) -> Array:
    """Distances (N, n) to the nearest of the points that lie one in each cell, up to `jitter` / 2 from its middle
    [Worley96]; is_solid: a colour of the cell that has the nearest instead."""
    lattice, within = _lattice(places)
    n_axes, half = within.shape[1], np.float32(0.5)
    nearest = [np.full(len(places), _FAR) for _ in range(n)]
    way = np.zeros_like(within)
    for steps in itertools.product((-1, 0, 1), repeat=n_axes):
        there = [each + np.uint32(step & 0xFFFFFFFF) for each, step in zip(lattice, steps, strict=True)]
        point = np.array(steps, np.float32) + ((cells(there, 3)[:, :n_axes] - half) * jitter + half)
        to_point = point - within
        distance = (to_point * to_point).sum(axis=1, dtype=np.float32)
        way = np.where((distance < nearest[0])[:, None], to_point, way)
        for k in range(n):  # the list stays sorted: what is farther moves on
            nearest[k], distance = np.minimum(nearest[k], distance), np.maximum(nearest[k], distance)
    if is_solid:
        return cells(_lattice(way + places)[0], n)
    return np.sqrt(np.stack(nearest, axis=1))
