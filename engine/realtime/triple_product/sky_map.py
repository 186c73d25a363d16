"""The distant light in the form in which Orbit looks it up: radiance by direction, averaged over a disc the size of a
triangle.

Every shading point has its own frame, so its triangles do not coincide with those of the environment. Tables of light
for some frames with interpolation between them [Ma06, 3.2] gave an error of 6 % on a teapot under a sunny sky, with as
many frames as in the paper, because each frame shows its own sun. A look-up for each triangle costs about as much as
reading such tables, and a rotating sky only rotates the look-ups. Averages over discs would spread the sun over several
triangles, so the brightest directions, the peaks, are split from the map as directional lights.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from engine.light.environment import LUMINANCE, Environment, triangle_integrals, upsample_interpolated
from engine.realtime.triple_product._incident_kernels import N_QUERIED
from engine.sphere.geodesic import geodesic, triangle_solid_angles

MAP_SIDE = 256
_COARSE = 8  # texels of the map along a side that one texel of the coarse map covers
MAX_PEAKS = 96
_PARTS = 16  # parts of the texels that are averaged one by one
_FINE = 6  # level of the triangles that are averaged
# A triangle is a peak if its power is this many times the mean.
_SUN = 4.0
# Directions in each of the peaks that are tested with rays.
N_PLACES = 16
_CUTS = 4  # times that a peak is split in four to find them

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SkyMap:
    """map (256, 256, 4) and coarse_map (32, 32, 4) float32: radiance by octahedral direction, without the peaks (the
    fourth channel is unused), to be rotated by `turn` radians counter-clockwise about +Y as seen from above.

    peak_direction (M, 3) and peak_power (M, 3) float32: the brightest triangles, rotated already; power is radiance
    times solid angle. sun_places (min(M, 8), 16, 3): directions in the brightest peaks, each for an equal share of the
    power, neighbours in order.
    """

    map: Float32Array
    coarse_map: Float32Array
    turn: float
    peak_direction: Float32Array
    peak_power: Float32Array
    sun_places: Float32Array


def make_sky(environment: Environment | None, rotation: float, scale: float = 1.0) -> SkyMap:
    """Make the sky of an environment rotated by `rotation` degrees, times scale; black without an environment."""
    averaged, coarse, directions, power, places = _map_and_peaks(environment)
    turn = math.radians(rotation % 360.0)
    if scale != 1.0:
        averaged, coarse, power = averaged * np.float32(scale), coarse * np.float32(scale), power * np.float32(scale)
    return SkyMap(averaged, coarse, turn, _turned(directions, turn), power, _turned(places, turn))


def _turned(directions: Float32Array, turn: float) -> Float32Array:
    """Rotate directions (..., 3) counter-clockwise about +Y as seen from above."""
    x, y, z = np.moveaxis(directions, -1, 0)
    turned = np.stack([math.cos(turn) * x + math.sin(turn) * z, y, math.cos(turn) * z - math.sin(turn) * x], axis=-1)
    return turned.astype(np.float32)


@lru_cache(maxsize=2)
def _map_and_peaks(
    environment: Environment | None,
) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array, Float32Array]:
    """Make map and coarse map, and the directions, powers and places of the peaks, of an environment that is not
    rotated."""
    fine = geodesic(_FINE)
    powers = np.zeros((fine.n_triangles, 3))
    if environment is not None:
        environment = upsample_interpolated(environment)
        powers = triangle_integrals(environment, 0.0, _FINE)
    peaks = _find_peaks(powers)
    rest = powers.copy()
    rest.reshape(-1, 4, 3)[peaks] = 0.0
    averaged = np.zeros((MAP_SIDE, MAP_SIDE, 4), np.float32)
    averaged[..., :3] = np.concatenate([_averaging_matrix(part) @ rest for part in range(_PARTS)]).reshape(
        MAP_SIDE, MAP_SIDE, 3
    )
    coarse = averaged.reshape(MAP_SIDE // _COARSE, _COARSE, MAP_SIDE // _COARSE, _COARSE, 4).mean(axis=(1, 3))
    of_peak = powers.reshape(-1, 4, 3)[peaks]
    directions = np.einsum("sk,ski->si", of_peak @ LUMINANCE, fine.centres.reshape(-1, 4, 3)[peaks])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    power, places = of_peak.sum(axis=1).astype(np.float32), np.zeros((0, N_PLACES, 3), np.float32)
    if environment is not None:
        places = _places(environment, peaks[:N_QUERIED])
    return averaged, np.ascontiguousarray(coarse), directions.astype(np.float32), power, places


def _find_peaks(powers: NDArray[np.float64]) -> NDArray[np.intp]:
    """Choose the triangles one level coarser that are far brighter than the mean, at most MAX_PEAKS, brightest
    first."""
    luminance = powers.reshape(-1, 4, 3).sum(axis=1) @ LUMINANCE
    candidates = np.argsort(-luminance, kind="stable")[:MAX_PEAKS]
    return np.asarray(candidates[luminance[candidates] > _SUN * luminance.mean()])


def _places(environment: Environment, peaks: NDArray[np.intp]) -> Float32Array:
    """Choose directions (K, 16, 3) in peaks (K,), which are triangles one level coarser than the finest, each for an
    equal share of the power. The peak is split into parts in a fixed order; a direction is the part at which the
    cumulative power reaches the middle of each sixteenth."""
    sphere = geodesic(_FINE - 1)
    parts = sphere.vertices[sphere.triangles[peaks]].astype(np.float64)
    for _ in range(_CUTS):
        a, b, c = np.moveaxis(parts, 1, 0)
        ab, bc, ca = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (a + b, b + c, c + a))
        parts = np.stack([a, ab, ca, ab, b, bc, ab, bc, ca, ca, bc, c], axis=1).reshape(-1, 3, 3)
    middles = parts.sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    power = environment.evaluate(middles, 0.0) @ LUMINANCE * triangle_solid_angles(parts)
    upto = np.maximum(power, 1e-30).reshape(len(peaks), 4**_CUTS).cumsum(axis=1)
    wanted = (np.arange(N_PLACES) + 0.5) / N_PLACES
    found = np.empty((len(peaks), N_PLACES, 3), np.float32)
    for own, each, total in zip(found, middles.reshape(len(peaks), 4**_CUTS, 3), upto, strict=True):
        own[:] = each[np.searchsorted(total, wanted * total[-1])]
    return found


def preparing_sky(environment: Environment | None) -> Generator[None, None, None]:
    """Compute and cache what `make_sky` of an environment needs, in steps, because the first call takes over a
    second."""
    yield
    for part in range(_PARTS):
        _averaging_matrix(part)
        yield
    _map_and_peaks(environment)


@lru_cache(maxsize=_PARTS)
def _averaging_matrix(part: int) -> sparse.csr_matrix:
    """(texels / _PARTS, triangles) for one part of the texels: a matrix from power of the fine triangles to mean
    radiance around each texel. The kernel falls to 0 at twice the radius of a disc the size of a triangle. This width
    is needed: a small light must reach about one triangle's centre, wherever it lies between centres."""
    fine = geodesic(_FINE)
    radius = 2.0 * np.sqrt(4.0 / (20 * 4**4))
    texels = np.array_split(texel_directions(MAP_SIDE), _PARTS)[part]
    near = cKDTree(texels).sparse_distance_matrix(cKDTree(fine.centres), radius, output_type="ndarray")
    rows, columns, distances = near["i"], near["j"], near["v"]
    weights = (1.0 - (distances / radius) ** 2) ** 2
    total = np.bincount(rows, fine.solid_angles[columns] * weights, len(texels))
    return sparse.csr_matrix((weights / total[rows], (rows, columns)), shape=(len(texels), fine.n_triangles))


def texel_directions(side: int) -> NDArray[np.float64]:
    """Unit directions (side², 3) of an octahedral map's texels: |x| + |y| + |z| = 1 unfolded to a square, +Y at its
    centre."""
    v, u = np.divmod(np.arange(side * side), side)
    x, z = (u + 0.5) / side * 2.0 - 1.0, (v + 0.5) / side * 2.0 - 1.0
    y = 1.0 - np.abs(x) - np.abs(z)
    fold = np.maximum(-y, 0.0)
    x, z = x - np.copysign(fold, x), z - np.copysign(fold, z)
    directions = np.stack([x, y, z], axis=1)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
