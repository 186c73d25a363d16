"""Peaks: the brightest directions of an environment, such as a sun, and what a scene reflects of them as they turn.

A sun's shadows have edges finer than the triangles of the rows' basis (`relight`). An environment is therefore the sum
of its peaks and the rest, which is relit by rows. Peaks are a few hundred directions. At each rotation their shadows
are traced, coarse to fine as all visibility, and each point reflects those that it sees by its layer's quotient and
curves.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.light.environment import LUMINANCE, Environment, texel_solid_angles
from engine.light.suns import sun_lights
from engine.light.triangle_lights import cut_lights, turned
from engine.material.layer import frame_of
from engine.precompute.direct import _relight_kernels as kernels
from engine.precompute.direct._projection_kernels import ViewedPoints
from engine.precompute.direct.lighting import nearest_neighbours
from engine.precompute.direct.pipeline import Placement
from engine.precompute.direct.relight import TILE
from engine.scene.primary_hits import PrimaryHits
from engine.visibility.coherent_grid import coherent_visibility
from engine.visibility.point_visibility import Targets, Visibility, empty_visibility, evaluate_rows

# Texels so many times as bright as the mean of all directions are a peak: 8 of the built-in sky, with half its light.
BRIGHTNESS = 100.0
# Peaks with less than this share of an environment's power are left to the rows.
LEAST_SHARE = 0.02
# How finely they are cut. In *room*, 96 x 72, lights of level 7, 8 and 9 (82, 172 and 418) leave 7.6, 3.7 and 2.4 %
# of direct light wrong; at 450 x 450 they take 0.4, 0.7 and 1.4 s of processor time.
N_LIGHTS, LEVEL = 140, 8
# Every point traces one of so many lights, whatever its neighbours see.
SENTINELS = 8

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Peaks:
    """M directional lights of an environment that is not rotated: unit directions (M, 3) towards them, and power
    (M, 3), the integral of L dω."""

    directions: Float32Array
    power: Float32Array


@lru_cache(maxsize=4)
def split_peaks(environment: Environment) -> tuple[Peaks, Environment]:
    """The peaks of an environment, and the environment without them. Suns that were added to a map are peaks."""
    if environment.base is not None:  # as long as the map stays, only the suns are new
        peaks, rest = split_peaks(environment.base)
        found = [(peaks.directions, peaks.power), *map(sun_lights, environment.suns)]
        return Peaks(*(np.concatenate(part) for part in zip(*found, strict=True))), rest
    radiance = environment.radiance
    luminance = radiance @ LUMINANCE
    power = luminance * texel_solid_angles(*luminance.shape)[:, None]
    is_peak = luminance > BRIGHTNESS * power.sum() / (4.0 * math.pi)
    if float(power[is_peak].sum()) <= LEAST_SHARE * float(power.sum()):
        none = np.zeros((0, 3), np.float32)
        return Peaks(none, none), environment
    alone, rest = (
        Environment(np.where(part[..., None], radiance, np.float32(0.0)), environment.source, environment.notes)
        for part in (is_peak, ~is_peak)
    )
    lights = cut_lights(alone, N_LIGHTS, peak_level=LEVEL)
    lit = lights.power.any(axis=1)
    return Peaks(lights.centre[lit], lights.power[lit]), rest


@dataclass(frozen=True, eq=False)
class PeakLight:
    """Peaks at one rotation: directions (M, 3), power (M, 3), and which of them each point of the picture sees;
    stride: of the lattice of points that they were traced from."""

    directions: Float32Array
    power: Float32Array
    visibility: Visibility
    stride: int = 1

    def reflected(self, hits: PrimaryHits, reflection: kernels.Reflection, points: NDArray[np.integer]) -> Float32Array:
        """What a layer of this reflection sends to the camera from these points, (p, 3), without f_q and f_o."""
        rows, out = np.ascontiguousarray(points, np.int32), np.empty((len(points), 3), np.float32)
        hits = hits.in_frame(frame_of(reflection.q))
        surface = ViewedPoints(hits.position, hits.tangent, hits.normal, hits.wo)
        lights = kernels.DirectedLights(np.ascontiguousarray(self.directions.T), self.power)
        bits = self.visibility.bits
        on_threads(
            lambda i: kernels.reflect_lights(rows[i : i + TILE], surface, bits, lights, reflection, out[i : i + TILE]),
            range(0, len(rows), TILE),
        )
        return out


def trace_peaks(
    placement: Placement, peaks: Peaks, rotation: float, scale: float = 1.0, stride: int = 1
) -> Generator[float, None, PeakLight]:
    """The peaks of an environment that is rotated by `rotation` degrees and scaled by `scale`, with their shadows,
    which are traced at every `stride`-th pixel; others have those of the nearest. Yields the fraction done."""
    directions = turned(peaks.directions, rotation)
    targets = Targets(
        directions, np.zeros_like(directions), nearest_neighbours(directions), sentinel_step=SENTINELS,
        weak_step=SENTINELS, weakest_step=SENTINELS, rotating=True,
    )  # fmt: skip
    visibility = empty_visibility(placement.hits, targets)
    yield from coherent_visibility(placement.hits, placement.caster, visibility, stride)
    evaluate_rows(placement.hits, placement.caster, visibility, placement.rows(stride))
    if stride > 1:
        visibility.bits[:] = visibility.bits[placement.nearest_rows(stride)]
    return PeakLight(directions, (np.float64(scale) * peaks.power).astype(np.float32), visibility, stride)
