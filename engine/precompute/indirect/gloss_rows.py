"""Rows of the sky's light that glossy surfaces reflect on to gather points: what they mirror of a sky that turns.

The light of the sky that reaches a gather point by one or two glossy surfaces is linear in the sky, as direct light is
(`engine.precompute.direct.relight`), and so has rows over the same wavelets. They are summed over the stored rays, of
which each glossy vertex sees the sky in a few directions of its lobe. Choosing lights anew at these vertices for each
angle was rejected: it is as far off, and took 2 s of processor time an angle where rows take a hundredth.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import clamp_radiance
from engine.core.threads import map_ahead, n_threads, pool
from engine.light.environment import Environment
from engine.precompute.direct._relight_kernels import LightRowArrays
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.direct.relight import MEAN_TERMS, LightRows, joined_rows, light_coefficients, turning_effects
from engine.precompute.indirect import _gloss_row_kernels as kernels
from engine.precompute.indirect.emission import raster_of_triangles
from engine.precompute.indirect.gather import object_of_rows
from engine.precompute.indirect.indirect_layers import IndirectLayer, LayerCurves
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.reflection import HemisphereSamples, mean_rows
from engine.precompute.indirect.second_bounce import SecondBounceLight
from engine.precompute.indirect.smoothing import Smoothing
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic
from engine.visibility.point_visibility import VISIBILITY_LEVEL

# Directions of each glossy vertex.
N_DIRECTIONS = 8
# Sample sets of a tile.
TILE = 32

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class GlossRows:
    """The rows of each layer at its p gather points, with the filter that removes noise from their light."""

    layers: tuple[tuple[LightRows, Smoothing | None], ...]

    @property
    def n_bytes(self) -> int:
        return sum(rows.n_bytes for rows, _ in self.layers)

    def lit(self, sky: SkyState) -> list[Float32Array]:
        """Radiance (p, 3) of each layer towards the camera, without f_q and f_o."""
        light = light_coefficients(sky.environment, sky.rotation, sky.scale) if sky.environment is not None else None
        found = []
        for rows, smoothing in self.layers:
            radiance = np.zeros((rows.n_points, 3), np.float32) if light is None else rows.lit(light)
            if smoothing is not None:
                radiance = mean_rows(radiance, smoothing)
            # A sum of wavelets of which some were dropped may be negative in the dark.
            found.append(clamp_radiance(np.maximum(radiance, np.float32(0.0))))
        return found


def gloss_rows(
    found: IndirectLight, layers: Sequence[IndirectLayer], environment: Environment, scale: float
) -> Generator[None, None, GlossRows]:
    """The rows of these layers, with terms chosen for an environment that turns. A generator of steps."""
    effects = yield from turning_effects(environment, scale)
    light, points = found.outgoing_radiance(layers).glossy, found.points
    assert light is not None
    tiles: list[list[LightRowArrays]] = [[] for _ in layers]
    smoothing: dict[int, Smoothing | None] = {}
    objects = object_of_rows(points.hits, points.samples.points)
    for i_object in sorted({each.i_object for each in layers}):
        own = [i for i, each in enumerate(layers) if each.i_object == i_object]
        first, last = np.searchsorted(objects, (i_object, i_object + 1)).tolist()
        smoothing[i_object] = None if points.smoothing is None else points.smoothing.part(first, last)
        samples, curves = points.hemisphere_samples(i_object), [layers[i].curves for i in own]

        def make(begin_and_end: tuple[int, int], samples: HemisphereSamples = samples,
                 curves: list[LayerCurves] = curves) -> list[LightRowArrays]:  # fmt: skip
            return _tile(samples, *begin_and_end, curves, light, found.cache.caster, effects)

        with pool() as threads:
            for tile in map_ahead(threads, make, _tiles(samples.stored_paths(light).samples.nth), 2 * n_threads()):
                for i, rows in zip(own, tile, strict=True):
                    tiles[i].append(rows)
                yield
    return GlossRows(
        tuple((joined_rows(mine), smoothing[each.i_object]) for mine, each in zip(tiles, layers, strict=True))
    )


def _tiles(nth: NDArray[np.uint8]) -> list[tuple[int, int]]:
    """Ranges of about 32 sample sets, with all of those of their points; nth (q,): the number of each at its point."""
    firsts = np.flatnonzero(nth == 0)
    chosen = np.unique(firsts[np.searchsorted(firsts, np.arange(0, len(nth), TILE), "right") - 1])
    return list(pairwise([*chosen.tolist(), len(nth)]))


def _tile(
    samples: HemisphereSamples, begin: int, end: int, layers: Sequence[LayerCurves], light: SecondBounceLight,
    caster: RayCaster, effects: Float32Array,
) -> list[LightRowArrays]:  # fmt: skip
    """The rows of each layer at the points with sample sets [begin, end)."""
    paths = samples.stored_paths(light)
    start = paths.records.start
    shape = 2 * int(start[end] - start[begin]), N_DIRECTIONS
    factors, directions, origins = np.empty((3, *shape, 3), np.float32)
    triangles, offset = np.empty(shape, np.int32), np.float32(caster.offset)
    kernels.sample_lobes(
        paths, begin, end, offset, raster_of_triangles(VISIBILITY_LEVEL), factors, directions, origins, triangles
    )
    seen = np.flatnonzero(triangles >= 0)
    blocked = caster.occluded(origins.reshape(-1, 3)[seen], directions.reshape(-1, 3)[seen])
    triangles.ravel()[seen[blocked]] = -1
    n_points, found = int(np.count_nonzero(paths.samples.nth[begin:end] == 0)), []
    for layer in layers:
        coefficients = np.empty((n_points, len(effects), 3), np.float32)
        optics, tint = layer.optics(folded=True), layer.tint.astype(np.float32)
        weights = samples.weights_of(optics).part(begin, end)
        kernels.gloss_coefficients(
            paths.samples, paths.records, begin, end, optics, weights, triangles, factors, _per_power(), tint,
            coefficients,
        )  # fmt: skip
        found.append(_chosen_terms(coefficients, effects))
    return found


def _chosen_terms(coefficients: Float32Array, effects: Float32Array) -> LightRowArrays:
    """The terms of the largest effect of coefficients (p, T, 3): 96 a row on average."""
    effect = np.abs(coefficients).max(axis=2) * effects
    n_kept = min(MEAN_TERMS * len(coefficients), effect.size - 1)
    least = np.float32(np.partition(effect.ravel(), -n_kept - 1)[-n_kept - 1])
    n = int(np.count_nonzero(effect > least))
    rows = LightRowArrays(
        np.empty(len(coefficients) + 1, np.int64), np.empty(len(coefficients), np.float32), np.empty(n, np.uint16),
        np.empty((n, 3), np.int16),
    )  # fmt: skip
    kernels.append_rows(coefficients, effects, least, rows)
    return rows


@lru_cache(maxsize=1)
def _per_power() -> Float32Array:
    """Radiance of each triangle of the sky with a power of 1."""
    return (1.0 / geodesic(VISIBILITY_LEVEL).solid_angles).astype(np.float32)
