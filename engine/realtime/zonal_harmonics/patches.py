"""Patches of detail that repeat over a surface: height fields, and their transfer as a texture [Sloan05, 6].

A height field (H, W), by formula or from an image's brightness, is in units of the patch's side, with row 0 at the top,
and continues without a seam on all sides. It is simulated once among copies of itself. Its texels hold zonal lobes in
the axes of the surface below: tangent along u, bitangent along v, normal. So it fits any surface with texture
coordinates, however that bends, at no further cost. Detail shades itself, but does not displace the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.frames import orthonormal
from engine.core.generators import map_steps
from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _shading_kernels as kernels
from engine.realtime.zonal_harmonics.shading import Lobes, lobes
from engine.realtime.zonal_harmonics.transfer import (
    N_RAYS,
    Medium,
    Sources,
    TransferPoints,
    cosine_directions,
    rotate_transfer,
    simulate,
    subsurface,
)
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.scene.raycaster import RayCaster, surface_points

Float64Array = NDArray[np.float64]

UNDER_EVERY = 4  # texels between the places where light enters from below

N_TEXELS = 128


@dataclass(frozen=True)
class Slab:
    """The material of a patch that transmits light: a medium, in units of the patch's side instead of metres, and the
    depth of its flat underside, which is lit from below, below height 0."""

    medium: Medium
    thickness: float


def simulate_patch(
    heights: ArrayLike, n: int, albedo: float = 0.0, n_bounces: int = 0, slab: Slab | None = None, n_rays: int = N_RAYS
) -> Generator[float, None, Float64Array]:
    """Compute the vectors (H W, n^2) of a patch's texels, row by row, with its shadows and either its reflections onto
    itself or, of a slab, the light that it transmits. heights (H, W): see `heights`. Yields the share that is done.

    Raises ValueError if heights are not finite, or the slab has no thickness somewhere.
    """
    heights = np.asarray(heights, np.float64)
    if heights.ndim != 2 or min(heights.shape) < 2 or not (np.abs(heights) <= 10.0).all():
        raise ValueError(f"heights of shape {heights.shape}, expected a map of finite ones up to 10 sides")
    if slab is not None and not heights.min() > -slab.thickness:
        raise ValueError(f"a slab {slab.thickness:g} thick, expected more than {-heights.min():g}")
    mesh, caster = _among_copies(heights)
    end = 0.6 if slab else 1.0
    vectors = yield from map_steps(simulate(mesh, caster, n, albedo, n_bounces, n_rays), lambda share: end * share)
    flat = rotate_transfer(vectors, mesh.frames.transpose(0, 2, 1))
    if slab is None:
        return flat
    places = mesh.points.position.astype(np.float64)
    below = cosine_directions(n_rays, n)[1].mean(axis=0) * _mirrored(n)
    sources = _sources(places, mesh.frames[:, 2, 2], heights.shape, slab)
    leaving = subsurface(np.vstack([flat, below]), places, sources, slab.medium)
    return (yield from map_steps(leaving, lambda share: 0.6 + 0.4 * share))


@dataclass(frozen=True, eq=False)
class Patch:
    """A patch's lobes for look-ups: low (H, W, 4), axes (H, W, N, 3), coefficients (H, W, N, n); errors (H, W) of their
    fit, relative; normals (H, W, 3) of the heights."""

    low: NDArray[np.float32]
    axes: NDArray[np.float32]
    coefficients: NDArray[np.float32]
    errors: Float64Array
    normals: Float64Array

    def at(self, uvs: ArrayLike) -> Lobes:
        """Look up the lobes at texture coordinates (P, 2), which repeat: the exact low bands are interpolated, lobes
        are the nearest texel's, because those of neighbours do not correspond."""
        uvs = np.ascontiguousarray(uvs, np.float64)
        found = Lobes(*(np.empty((len(uvs), *each.shape[2:]), np.float32) for each in self._maps()))
        on_threads(
            lambda start, stop: kernels.look_up_range(
                *self._maps(), uvs, start, stop, found.low, found.axes, found.coefficients
            ),
            *even_parts(len(uvs)),
        )
        return found

    def normals_at(self, uvs: ArrayLike) -> Float64Array:
        """Normals (P, 3) at texture coordinates (P, 2), interpolated."""
        height, width = self.errors.shape
        u, v = np.mod(np.asarray(uvs, np.float64), 1.0).T
        column, row = u * width - 0.5, (1.0 - v) * height - 0.5
        left, top = np.floor(column).astype(int), np.floor(row).astype(int)
        beside, below = (column - left)[:, None], (row - top)[:, None]
        above, under = (
            (1.0 - beside) * self.normals[i % height, left % width]
            + beside * self.normals[i % height, (left + 1) % width]
            for i in (top, top + 1)
        )
        mean = (1.0 - below) * above + below * under
        return np.asarray(mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12))

    def errors_at(self, uvs: ArrayLike) -> Float64Array:
        """Errors of the texels (P,) that contain texture coordinates (P, 2)."""
        height, width = self.errors.shape
        u, v = np.mod(np.asarray(uvs, np.float64), 1.0).T
        return self.errors[np.minimum(((1.0 - v) * height).astype(int), height - 1), (u * width).astype(int) % width]

    def _maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        return self.low, self.axes, self.coefficients


def patch(zonal: Zonal, heights: Float64Array) -> Patch:
    """Make a patch of its heights (H, W) and lobes fitted to the vectors of its texels."""
    flat, shape = lobes(zonal), heights.shape
    maps = flat.low, flat.axes, flat.coefficients
    low, axes, coefficients = (each.reshape(*shape, *each.shape[1:]) for each in maps)
    return Patch(low, axes, coefficients, zonal.relative_errors.reshape(shape), normals_of(heights))


def normals_of(heights: Float64Array) -> Float64Array:
    """Normals (H, W, 3) of the texels of a height field, in axes along u, along v, outwards."""
    n_rows, n_columns = heights.shape
    slope_u = (np.roll(heights, -1, axis=1) - np.roll(heights, 1, axis=1)) * (n_columns / 2.0)
    slope_v = (np.roll(heights, 1, axis=0) - np.roll(heights, -1, axis=0)) * (n_rows / 2.0)
    normals = np.stack([-slope_u, -slope_v, np.ones_like(slope_u)], axis=2)
    return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))


def _among_copies(heights: Float64Array) -> tuple[TransferPoints, RayCaster]:
    """Make the mesh of a patch's texels and its surroundings: the patch and its eight neighbours."""
    n_rows, n_columns = heights.shape
    row, column = np.mgrid[-n_rows : 2 * n_rows + 1, -n_columns : 2 * n_columns + 1]
    height = heights[row % n_rows, column % n_columns]
    places = np.stack([(column + 0.5) / n_columns, 1.0 - (row + 0.5) / n_rows, height], axis=2)
    grid = np.arange(row.size, dtype=np.int32).reshape(row.shape)
    a, b, c, d = (each.ravel() for each in (grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:], grid[:-1, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    caster = RayCaster(places.reshape(-1, 3), triangles)
    inside = places[n_rows : 2 * n_rows, n_columns : 2 * n_columns].reshape(-1, 3)
    normals = normals_of(heights).reshape(-1, 3)
    upright = np.tile(np.eye(3), (len(normals), 1, 1))
    frames = orthonormal(np.concatenate([upright[:, :2], normals[:, None]], axis=1), upright)
    numbers = ((row % n_rows) * n_columns + column % n_columns).ravel().astype(np.int32)
    corners = numbers[triangles]  # a copy has the patch's own vertices: only its normals give its orientation
    points = surface_points(caster, inside, normals)
    return TransferPoints(points, frames, corners, normals[corners].sum(axis=1)), caster


def _sources(places: Float64Array, upright: Float64Array, shape: tuple[int, int], slab: Slab) -> Sources:
    """Make the places where light enters a slab from above and from below, in the patch and as far around it as the
    medium's reach; one vector, after those of the texels, describes all light from below."""
    reach = min(slab.medium.reach, 2.0)
    texel = 1.0 / (shape[0] * shape[1])
    under = [np.arange(0, size, UNDER_EVERY) for size in shape]
    u, v = np.meshgrid((under[1] + 0.5) / shape[1], 1.0 - (under[0] + 0.5) / shape[0])
    bottom = np.stack([u.ravel(), v.ravel(), np.full(u.size, -slab.thickness)], axis=1)
    one = np.concatenate([places, bottom])
    areas = np.concatenate([texel / upright, np.full(len(bottom), 1.0 / len(bottom))])
    numbers = np.concatenate([np.arange(len(places)), np.full(len(bottom), len(places))]).astype(np.int32)
    around = range(-int(np.ceil(reach)), int(np.ceil(reach)) + 1)
    copies = np.array([(x, y, 0.0) for x in around for y in around])
    all_places = (one + copies[:, None]).reshape(-1, 3)
    near = (np.abs(all_places[:, :2] - 0.5) <= 0.5 + reach).all(axis=1)
    return Sources(all_places[near], np.tile(areas, len(copies))[near], np.tile(numbers, len(copies))[near])


def _mirrored(n: int) -> Float64Array:
    """Factors (n^2,) that reflect a function of order n at the plane z = 0."""
    return np.array([(-1.0) ** (band + m) for band in range(n) for m in range(-band, band + 1)])


def bumps(side: int = N_TEXELS) -> Float64Array:
    """Hemispheres in staggered rows."""
    u, v = _texel_centres(side)
    radius, height = 0.19, np.zeros((side, side))
    for at_u, at_v in ((0.25, 0.25), (0.75, 0.25), (0.0, 0.75), (0.5, 0.75)):
        square = _periodic_distance(u, at_u) ** 2 + _periodic_distance(v, at_v) ** 2
        height = np.maximum(height, np.sqrt(np.maximum(radius**2 - square, 0.0)))
    return height


def waffle(side: int = N_TEXELS) -> Float64Array:
    """Square pits with slanting sides between bars."""
    u, v = _texel_centres(side)
    to_bar = np.minimum(*(0.125 - np.abs(np.mod(each, 0.25) - 0.125) for each in (u, v)))
    return 0.12 * (1.0 - _smooth_step((to_bar - 0.02) / 0.045))


def swirl(side: int = N_TEXELS) -> Float64Array:
    """Ridges that spiral around the patch's centre and flatten towards its edge."""
    u, v = _texel_centres(side)
    x, y = u - 0.5, v - 0.5
    radius = np.hypot(x, y)
    wave = 0.5 + 0.5 * np.cos(3.0 * np.arctan2(y, x) + 40.0 * radius)
    return 0.06 * wave * _smooth_step(radius / 0.06) * (1.0 - _smooth_step((radius - 0.3) / 0.18))


def weave(side: int = N_TEXELS) -> Float64Array:
    """Four round threads in each direction that pass over and under each other."""
    u, v = _texel_centres(side)
    up, across = (_thread(each) for each in (u, v))
    # At a crossing one thread is above: crossings alternate like the squares of a chess board.
    turn = np.cos(4.0 * np.pi * u) * np.cos(4.0 * np.pi * v)
    return np.asarray(0.03 * np.maximum(up * (1.0 + 0.8 * turn), across * (1.0 - 0.8 * turn)))


def heights_of_image(image: ArrayLike, height: float = 0.1) -> Float64Array:
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


def _texel_centres(side: int) -> tuple[Float64Array, Float64Array]:
    """u and v (H, W) of the texels' centres."""
    middle = (np.arange(side) + 0.5) / side
    return np.tile(middle, (side, 1)), np.tile(1.0 - middle[:, None], (1, side))


def _periodic_distance(value: Float64Array, place: float, period: float = 1.0) -> Float64Array:
    """Distance to the nearest of periodic places."""
    return np.abs(np.mod(value - place + period / 2.0, period) - period / 2.0)


def _thread(value: Float64Array) -> Float64Array:
    """Profile of threads that are a quarter apart."""
    return np.asarray(np.sqrt(np.maximum(1.0 - (_periodic_distance(value, 0.0, 0.25) / 0.11) ** 2, 0.0)))


def _smooth_step(value: Float64Array) -> Float64Array:
    """Smooth step from 0 below 0 to 1 above 1."""
    t = np.clip(value, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
