"""Relights a picture by another distant light, with fixed materials and camera: rows over a lighting basis.

    B(r) = B(r₀) + K (l(r) − l(r₀)) + S(r) − S(r₀)

l holds the spherical Haar coefficients of the environment's power over the 5,120 triangles of the visibility sphere,
rotated by r. K holds the reflection of each point, including shadows. S is the light of the environment's peaks, which
are finer than the triangles and no part of l (`peaks`). r₀ is the rotation for which the exact picture was computed
[BenArtzi07, eq. 7.4]. What does not change with rotation, emitters among it, therefore stays exact, and a rotation
begins without a jump.

Every point has its own row. Terms of K are dropped by their effect on the picture: |K_xk| times the RMS of l_k over a
full rotation of the environment. Most terms of a row therefore lie where the light is. docs/relighting.md compares this
with the alternatives that were measured.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from engine.core.clamping import BRIGHTEST
from engine.core.threads import map_ahead, n_threads, on_threads, pool
from engine.curve.operators import HALF_PI
from engine.light.environment import Environment
from engine.light.triangle_lights import quick_integrals
from engine.material.layer import Layer
from engine.precompute.direct import _relight_kernels as kernels
from engine.precompute.direct._angle_kernels import slope
from engine.precompute.direct._projection_kernels import ViewedPoints
from engine.precompute.direct.pipeline import LightLink, SkyState
from engine.scene.primary_hits import PrimaryHits
from engine.sphere.geodesic import geodesic
from engine.sphere.haar import forward, levels_of_coefficients
from engine.visibility.point_visibility import VISIBILITY_LEVEL, Visibility

TILE = 512
N_TURNS = 16
MEAN_TERMS = 96
# Of all rows of a picture.
MOST_ROW_BYTES = 256e6
CURVE_STEPS = 2048
SKY_HEIGHT = 128
PART_LEVELS = 1
TRIANGLE_RADIUS = 0.07
BEND = 0.1
N_PILOTS = 512

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LightRows:
    """The rows of the P points of a layer, in tiles."""

    tiles: tuple[kernels.LightRowArrays, ...]

    @property
    def n_points(self) -> int:
        return sum(len(tile.scale) for tile in self.tiles)

    @property
    def n_terms(self) -> int:
        return sum(len(tile.number) for tile in self.tiles)

    @property
    def n_bytes(self) -> int:
        return sum(array.nbytes for tile in self.tiles for array in tile)

    def lit(self, light: Float32Array) -> Float32Array:
        """The layer's radiance (P, 3), without f_q and f_o, under a light with coefficients (T, 3)."""
        out = np.zeros((self.n_points, 3), np.float32)
        ends = np.cumsum([len(tile.scale) for tile in self.tiles]).tolist()
        on_threads(
            lambda tile, end: kernels.light_rows(tile, light, out[end - len(tile.scale) : end]), self.tiles, ends
        )
        return out


def light_coefficients(environment: Environment, rotation: float, scale: float = 1.0) -> Float32Array:
    """l (T, 3): coefficients of the environment, rotated by `rotation` degrees and scaled by `scale`, in the basis of
    the rows.

    Each is the wavelet coefficient of the triangles' power times the wavelet's measure, so that the product with a row
    is a plain sum.
    """
    power = quick_integrals(environment, rotation, VISIBILITY_LEVEL, SKY_HEIGHT)
    return np.ascontiguousarray(forward(scale * power) * _measures()[:, None], np.float32)


def sky_likeness(one: SkyState, two: SkyState) -> Float32Array:
    """The factor (3,) by which `two` is to be multiplied to be nearest to `one`, in the sense of least squares over
    directions: 1 for equal skies, 0 where no bright direction is common."""
    if is_same_sky(one, two):
        return np.ones(3, np.float32)
    if one.environment is None or two.environment is None:
        return np.zeros(3, np.float32)
    first, second = (
        sky.scale * quick_integrals(sky.environment, sky.rotation, VISIBILITY_LEVEL, SKY_HEIGHT)
        for sky in (one, two)
        if sky.environment is not None
    )
    # In units of the brightest, whose squares are finite.
    most = max(float(second.max()), 1e-300)
    products = np.sum(first / most * (second / most), axis=0), np.sum((second / most) ** 2, axis=0)
    likeness = np.divide(*products, out=np.zeros(3), where=products[1] > 0.0)
    return np.minimum(likeness, BRIGHTEST).astype(np.float32)


def is_same_sky(one: SkyState, two: SkyState) -> bool:
    """Whether both are the same environment with the same rotation and scale, and reach the same objects."""
    same = one.environment is two.environment and (one.rotation, one.scale) == (two.rotation, two.scale)
    return same and len(one.links) == len(two.links) and all(map(_is_same_link, one.links, two.links))


def _is_same_link(one: LightLink, two: LightLink) -> bool:
    return (one.objects, one.dark) == (two.objects, two.dark) and is_same_sky(one.sky, two.sky)


def turning_effects(environment: Environment, scale: float = 1.0) -> Generator[None, None, Float32Array]:
    """RMS of l_k over a full rotation and the colour channels, (T,): the effect of a row coefficient of 1."""
    squares = np.zeros(geodesic(VISIBILITY_LEVEL).n_triangles)
    for turn in range(N_TURNS):
        squares += np.mean(light_coefficients(environment, 360.0 * turn / N_TURNS, scale) ** 2, axis=1, dtype=float)
        yield
    return np.sqrt(squares / N_TURNS).astype(np.float32)


@dataclass(frozen=True, eq=False)
class RowMaker:
    """Computes the rows of all layers. least: the effect below which a term is dropped, before f_q."""

    hits: PrimaryHits
    sphere: Visibility
    effects: Float32Array
    least: float = 0.0

    def rows(self, layer: Layer, points: NDArray[np.integer]) -> Iterator[kernels.LightRowArrays]:
        """Rows of a layer at the given points, all of them visible to the camera, one tile at a time."""
        reflection, parts = layer_reflection(layer), _parts()
        least = np.float32(self.least / max(float(layer.scale().max()), 1e-6))
        hits = self.hits.in_frame(layer.frame)
        surface = ViewedPoints(hits.position, hits.tangent, hits.normal, hits.wo)

        def make(tile: NDArray[np.int32]) -> kernels.LightRowArrays:
            n_most, channels = len(tile) * len(self.effects), reflection.curve_a.shape[1]
            start, scale = np.empty(len(tile) + 1, np.int64), np.empty(len(tile), np.float32)
            number, value = np.empty(n_most, np.uint16), np.empty((n_most, channels), np.int16)
            room = kernels.LightRowArrays(start, scale, number, value)
            n = kernels.fill_rows(tile, surface, self.sphere.bits, parts, reflection, self.effects, least, room)
            return kernels.LightRowArrays(start, scale, number[:n].copy(), value[:n].copy())

        rows = np.ascontiguousarray(points, np.int32)
        tiles = [rows[i : i + TILE] for i in range(0, len(rows), TILE)]
        with pool() as threads:
            yield from map_ahead(threads, make, tiles, 2 * n_threads())

    def rows_within(self, layers: Iterable[tuple[Layer, NDArray[np.integer]]], most_bytes: float) -> RowMaker:
        """A RowMaker that drops so many terms that the rows of these layers at these points have at most about 96 terms
        on average and take at most `most_bytes` bytes. Estimated from a few hundred of the points."""
        layers = list(layers)
        n_points = sum(len(points) for _, points in layers)
        every = max(1, n_points // N_PILOTS)
        effects, n_bytes, n_pilots = [], [], 0
        # Effect and size in bytes of every term of the pilot points.
        for layer, points in layers:
            chosen = points[every // 2 :: every]
            for tile in self.rows(layer, chosen):
                sizes = np.abs(tile.value).max(axis=1) * np.repeat(tile.scale, np.diff(tile.start))
                effects.append(sizes * self.effects[tile.number] * max(float(layer.scale().max()), 1e-6))
                n_bytes.append(np.full(len(tile.number), 2 + 2 * tile.value.shape[1]))
            n_pilots += len(chosen)
        if not sum(map(len, effects)):
            return self
        effect, cost = np.concatenate(effects), np.concatenate(n_bytes)
        # Keep the largest effects that fit both limits.
        order = np.argsort(-effect, kind="stable")
        room = most_bytes * n_pilots / n_points
        n_kept = min(int(np.searchsorted(np.cumsum(cost[order]), room)), MEAN_TERMS * n_pilots, len(order) - 1)
        return replace(self, least=float(effect[order[n_kept]]))


def joined_rows(tiles: Iterable[kernels.LightRowArrays]) -> LightRows:
    return LightRows(tuple(tiles))


@lru_cache(maxsize=1)
def _measures() -> NDArray[np.float64]:
    """4^(L − level) of each wavelet: with it a sum of products of coefficients equals the sum of products of the
    triangles' values."""
    return np.asarray(4.0 ** (VISIBILITY_LEVEL - levels_of_coefficients(VISIBILITY_LEVEL)))


@lru_cache(maxsize=1)
def _parts() -> kernels.TriangleParts:
    """The triangles of the sphere, and their children on the next level."""
    sphere, fine = geodesic(VISIBILITY_LEVEL), geodesic(VISIBILITY_LEVEL + PART_LEVELS)
    n = sphere.n_triangles
    shares = np.concatenate([np.ones(n), fine.solid_angles / np.repeat(sphere.solid_angles, 4**PART_LEVELS)])
    centres = np.concatenate([sphere.centres, fine.centres]).T
    owner = np.concatenate([np.arange(n), np.repeat(np.arange(n), 4**PART_LEVELS)])
    return kernels.TriangleParts(
        np.ascontiguousarray(centres, np.float32), shares.astype(np.float32), owner.astype(np.int32)
    )


def _bends(curve: Float32Array, kind: int) -> NDArray[np.bool_]:
    """Marks the angles at which a curve (S + 1, C) varies within a triangle by more than a tenth of its maximum."""
    rate = slope(kind) or 1.0
    reach = math.ceil(rate * TRIANGLE_RADIUS * CURVE_STEPS / HALF_PI)
    largest = maximum_filter1d(curve, 2 * reach + 1, axis=0, mode="nearest")
    least = minimum_filter1d(curve, 2 * reach + 1, axis=0, mode="nearest")
    return np.asarray((largest - least > BEND * np.abs(curve).max(axis=0)).any(axis=1))


def layer_reflection(layer: Layer) -> kernels.Reflection:
    """A layer's reflection with its curves tabulated; one channel if all channels are equal."""
    model = layer.model
    angles = np.linspace(0.0, HALF_PI, CURVE_STEPS + 1)
    curves = [np.asarray(layer.curve(factor.name)(angles), np.float32) for factor in model.factors]
    q = np.array(model.bind_parameters(layer.quotient_parameters()))
    tints = model.colours_number(q)
    if not tints and all((curve == curve[:, :1]).all() for curve in curves):
        curves = [curve[:, :1] for curve in curves]
    kinds = [factor.gamma for factor in model.factors]
    second = curves[1] if len(curves) > 1 else np.ones((1, curves[0].shape[1]), np.float32)
    return kernels.Reflection(
        model.number, q, kinds[0], kinds[-1], tints, np.ascontiguousarray(curves[0]),
        np.ascontiguousarray(second), _bends(curves[0], kinds[0]), _bends(second, kinds[-1]),
    )  # fmt: skip
