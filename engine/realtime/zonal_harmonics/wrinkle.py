"""Wrinkles: grooves whose transfer is computed by formula, as zonal lobes over position in the groove and depth
[Sloan05, 4.2].

A groove is one period of a cosine, h(x) = d (1 - cos 2 pi x) / 2 over x in [0, 1], with its foot at x = 0 and 1, its
ridge at 1/2, and d its depth divided by its width; it repeats along x and is constant along y. Two horizons give what a
point sees of the sky, and the first crossing of each slope with the groove what it sees of the groove itself, so no
rays are traced. Three lobes a point, with axes and coefficients bilinear over a map of position and depth, are fitted
to all points at once; so the lobes of neighbours correspond, and can be interpolated.
Bands 0 and 1 are stored exactly. The axes are those of the wrinkled surface: across the groove, along it, outwards.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter
from scipy.optimize import minimize

from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _zonal_kernels as kernels
from engine.realtime.zonal_harmonics.transfer import cosine_directions
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.sphere.harmonics import bands, basis

Float64Array = NDArray[np.float64]

SIDE, N_LOBES, ORDER = 32, 3, 6
DEEPEST = 1.0  # widths
N_RAYS = 2000
_PER_CELL = 2  # samples of the fit in a cell, in each direction
_ROUNDS, _STEPS = 8, 30
_PARTS = 8  # of the samples, for any number of threads
_SPREADS = np.radians([15.0, 30.0, 45.0, 60.0, 75.0])  # first angles between the outer lobes and the middle one
_RIDGE = 1e-6
_HORIZON_STEPS = 512
_N_SLOPES = 512  # of rays in the plane across a groove


@dataclass(frozen=True, eq=False)
class Wrinkles:
    """Lobes at the nodes of a map, rows by position from 0 to 1, columns by depth from 0 to `DEEPEST`: low (H, W, 4),
    axes (H, W, N, 3), coefficients (H, W, N, n); errors (H, W): the length of the residual at a node and half way to
    the next."""

    low: Float64Array
    axes: Float64Array
    coefficients: Float64Array
    errors: Float64Array

    def at(self, position: ArrayLike, depth: ArrayLike) -> Zonal:
        """Interpolate the lobes of points (P,) of grooves; positions repeat, depths are clamped to 0 to `DEEPEST`."""
        maps = (self.low, self.axes, self.coefficients, self.errors)
        low, axes, coefficients, errors = (between_nodes(each, position, depth) for each in maps)
        return Zonal(low, _unit(axes), coefficients, errors)

    def rotate(self, rotation: Float64Array) -> Wrinkles:
        """Rotate all nodes by a rotation (3, 3)."""
        shape, maps = self.errors.shape, (self.low, self.axes, self.coefficients, self.errors)
        flat = Zonal(*(each.reshape(-1, *each.shape[2:]) for each in maps)).rotate(rotation)
        maps = flat.low, flat.axes, flat.coefficients, flat.errors
        return Wrinkles(*(each.reshape(*shape, *each.shape[1:]) for each in maps))


def between_nodes(nodes: NDArray[np.floating], position: ArrayLike, depth: ArrayLike) -> Float64Array:
    """Interpolate a map (H, W, ...) of nodes as those of `Wrinkles`, at positions and depths (P,)."""
    position, depth = (np.asarray(each, np.float64).ravel() for each in np.broadcast_arrays(position, depth))
    n_rows, n_columns = nodes.shape[:2]
    row = (position - np.floor(position)) * (n_rows - 1)
    column = np.clip(depth / DEEPEST, 0.0, 1.0) * (n_columns - 1)
    top, left = np.minimum(row.astype(int), n_rows - 2), np.minimum(column.astype(int), n_columns - 2)
    down, right = (part.reshape(-1, *[1] * (nodes.ndim - 2)) for part in (row - top, column - left))
    above = (1.0 - right) * nodes[top, left] + right * nodes[top, left + 1]
    below = (1.0 - right) * nodes[top + 1, left] + right * nodes[top + 1, left + 1]
    return np.asarray((1.0 - down) * above + down * below)


def groove_normals(position: ArrayLike, depth: ArrayLike) -> Float64Array:
    """Normals (..., 3) at positions from 0 to 1 and depths divided by the groove's width, in the wrinkles' axes."""
    slope = np.pi * np.asarray(depth) * np.sin(2.0 * np.pi * np.asarray(position, np.float64))
    return _unit(np.stack([-slope, 0.0 * slope, np.ones_like(slope)], axis=-1))


def node_normals(n_rows: int, n_columns: int) -> Float64Array:
    """Normals (H, W, 3) of the nodes of `Wrinkles`."""
    position, depth = np.linspace(0.0, 1.0, n_rows), np.linspace(0.0, DEEPEST, n_columns)
    return groove_normals(position[:, None] + 0.0 * depth, 0.0 * position[:, None] + depth)


def wrinkles(
    n: int = ORDER, side: int = SIDE, albedo: float = 0.0, n_bounces: int = 0
) -> Generator[float, None, Wrinkles]:
    """Make the map with `side` nodes in each direction, fitted by L-BFGS [Nocedal06, 7.2], with reflections of the
    groove onto itself, see `add_reflections`. Yields the share that is done."""
    n_samples = _PER_CELL * (side - 1) + 1
    node = np.linspace(0.0, side - 1.0, n_samples)
    places = np.stack(np.meshgrid(node, node, indexing="ij"), axis=2).reshape(-1, 2)
    targets = transfer(places[:, 0] / (side - 1), places[:, 1] / (side - 1) * DEEPEST, n)
    if albedo and n_bounces:
        by_depth = targets.reshape(n_samples, n_samples, -1)
        targets = add_reflections(by_depth, node / (side - 1) * DEEPEST, albedo, n_bounces).reshape(targets.shape)
    at_nodes = targets.reshape(n_samples, n_samples, -1)[::_PER_CELL, ::_PER_CELL].reshape(side * side, -1)
    yield 0.1
    axes, coefficients = _initial_lobes(at_nodes, n)
    shapes = (side, side, N_LOBES, 3), (side, side, N_LOBES, n)
    values = np.concatenate([axes.ravel(), coefficients.ravel()])
    options = {"maxiter": _STEPS, "maxcor": 20}
    for round_ in range(_ROUNDS):
        values = minimize(_error, values, (targets, places, shapes), "L-BFGS-B", jac=True, options=options).x
        yield 0.1 + 0.9 * (round_ + 1) / _ROUNDS
    axes, coefficients = _split_values(values, shapes)
    low, none = at_nodes[:, :4].reshape(side, side, 4), np.zeros((side, side))
    fitted = Wrinkles(low, _unit(axes), coefficients, none)
    position, depth = places.T / (side - 1)
    squares = ((fitted.at(position, depth * DEEPEST).harmonics() - targets) ** 2).sum(axis=1)
    about_nodes = uniform_filter(squares.reshape(n_samples, n_samples), 2 * _PER_CELL - 1, mode="nearest")
    return replace(fitted, errors=np.sqrt(np.maximum(about_nodes[::_PER_CELL, ::_PER_CELL], 0.0)))


def _error(
    values: Float64Array, targets: Float64Array, places: Float64Array, shapes: tuple
) -> tuple[float, Float64Array]:
    """The squared error of all samples and its gradient, summed by parts whose number does not depend on the cores."""
    axes, coefficients = _split_values(values, shapes)
    gradients = np.zeros((_PARTS, len(values)))

    def part(i: int) -> float:
        ends = len(targets) * i // _PARTS, len(targets) * (i + 1) // _PARTS
        return float(
            kernels.map_error(targets, places, axes, coefficients, *ends, *_split_values(gradients[i], shapes))
        )

    return sum(on_threads(part, range(_PARTS))), gradients.sum(axis=0)


def _split_values(values: Float64Array, shapes: tuple) -> tuple[Float64Array, Float64Array]:
    """Axes and coefficients, which are stored one after the other."""
    end = int(np.prod(shapes[0]))
    return values[:end].reshape(shapes[0]), values[end:].reshape(shapes[1])


def _initial_lobes(vectors: Float64Array, n: int) -> tuple[Float64Array, Float64Array]:
    """Initial axes (P, 3, 3) and coefficients (P, 3, n): one lobe along the linear band, and two on either side of it
    across the groove, at the best of some angles, the same at all points [Sloan05, 4.2]."""
    middle = _unit(vectors[:, [3, 1, 2]] * (-1.0, -1.0, 1.0))
    along = _unit(np.array([0.0, 1.0, 0.0]) - middle[:, 1:2] * middle)
    best: tuple[float, Float64Array, Float64Array] | None = None
    for spread in _SPREADS:
        outer = [np.cos(spread) * middle + side * np.sin(spread) * along for side in (-1.0, 1.0)]
        axes = np.stack([middle, *outer], axis=1)
        coefficients = _coefficients(vectors, axes, n)
        model = np.einsum("pik,pik->pk", basis(axes, n), coefficients[:, :, bands(n)])
        error = float(((vectors - model)[:, kernels.FIRST**2 :] ** 2).sum())
        if best is None or error < best[0]:
            best = error, axes, coefficients
    assert best is not None
    return best[1], best[2]


def _coefficients(vectors: Float64Array, axes: Float64Array, n: int) -> Float64Array:
    """Least-squares coefficients (P, N, n) for given axes, band by band."""
    values, found = basis(axes, n), np.zeros((*axes.shape[:2], n))
    for l in range(kernels.FIRST, n):  # noqa: E741
        band = values[:, :, l * l : (l + 1) ** 2]
        system = band @ band.transpose(0, 2, 1) + _RIDGE * np.eye(axes.shape[1])
        found[:, :, l] = np.linalg.solve(system, band @ vectors[:, l * l : (l + 1) ** 2, None])[:, :, 0]
    return found


def _unit(vectors: Float64Array) -> Float64Array:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.where(lengths > 0.0, vectors / np.where(lengths > 0.0, lengths, 1.0), (0.0, 0.0, 1.0)))


def transfer(position: ArrayLike, depth: ArrayLike, n: int = ORDER, n_rays: int = N_RAYS) -> Float64Array:
    """Vectors (P, n^2) of order n of points of a groove, with its shadows: positions (P,) from 0 to 1, depths (P,)
    divided by the groove's width."""
    position, depth = (np.asarray(each, np.float64).ravel() for each in np.broadcast_arrays(position, depth))
    normal = groove_normals(position, depth)
    tangent = normal[:, [2, 1, 0]] * (1.0, 1.0, -1.0)
    left, right = _horizons(position, depth)
    local, _ = cosine_directions(n_rays, n)
    vectors = np.empty((len(position), n * n))

    def part(start: int, stop: int) -> None:
        for p in range(start, stop):
            axes = np.stack([tangent[p], [0.0, 1.0, 0.0], normal[p]])
            directions = local @ axes
            rise, across = directions[:, 2], directions[:, 0]
            free = rise > np.where(across > 0.0, right[p] * across, -left[p] * across)
            vectors[p] = free @ basis(directions, n) / n_rays

    on_threads(part, *even_parts(len(position)))
    return vectors


def add_reflections(vectors: Float64Array, depths: Float64Array, albedo: float, n_bounces: int) -> Float64Array:
    """Add to vectors (X, D, n^2), at X even positions from 0 to 1 and depths (D,), what the groove, of this albedo,
    reflects onto itself in n_bounces bounces."""
    total = vectors.copy()

    def part(j: int) -> None:
        factors, sent = form_factors(len(vectors), float(depths[j])), vectors[:, j]
        for _ in range(n_bounces):
            sent = albedo * factors @ sent
            total[:, j] += sent

    on_threads(part, range(len(depths)))
    return total


def form_factors(n_positions: int, depth: float) -> Float64Array:
    """Shares (X, X) of the light of a Lambertian surface at X even positions from 0 to 1 that go to each of them.

    What is constant along y is a problem in the plane: there a Lambertian surface sends the same to each step of the
    sine of the angle from its normal, as crossed strings show.
    """
    position = np.linspace(0.0, 1.0, n_positions)
    sine = (np.arange(_N_SLOPES) + 0.5) / _N_SLOPES * 2.0 - 1.0
    cosine = np.sqrt(1.0 - sine**2)
    away = (np.arange(_HORIZON_STEPS) + 1.0) / _HORIZON_STEPS
    factors = np.zeros((n_positions, n_positions))
    for i, x in enumerate(position):
        steep = np.pi * depth * np.sin(2.0 * np.pi * x)  # of the groove
        across, rise = cosine * -steep + sine, cosine + sine * steep
        for side in (-1.0, 1.0):
            # The first place where the groove is as high as the ray: where the highest slope so far reaches the ray's.
            there = x + side * away
            slopes = 0.5 * depth * (np.cos(2.0 * np.pi * x) - np.cos(2.0 * np.pi * there)) / away
            rays = rise[across * side > 0.0] / np.abs(across[across * side > 0.0])
            first = np.searchsorted(np.maximum.accumulate(slopes), rays)
            hits = np.mod(there[first[first < len(away)]], 1.0) * (n_positions - 1)
            left = np.minimum(hits.astype(int), n_positions - 2)
            np.add.at(factors[i], left, (left + 1.0 - hits) / _N_SLOPES)
            np.add.at(factors[i], left + 1, (hits - left) / _N_SLOPES)
    return factors


def _horizons(position: Float64Array, depth: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Steepest slopes (P,) from points of a groove to the occluders on their left and on their right: a ridge at most
    half a width away, or nothing."""
    away = (np.arange(_HORIZON_STEPS) + 1.0) / _HORIZON_STEPS
    here = -np.cos(2.0 * np.pi * position)[:, None]
    slopes = []
    for side in (-1.0, 1.0):
        there = -np.cos(2.0 * np.pi * (position[:, None] + side * away))
        slopes.append((0.5 * depth[:, None] * (there - here) / away).max(axis=1))
    return slopes[0], slopes[1]
