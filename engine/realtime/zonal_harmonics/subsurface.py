"""Subsurface scattering by the dipole of [Jensen01], over points of a mesh.

A point emits what enters at all others, weighted by the distance through the medium, so thin parts are translucent.
This is linear in the light: a point's transfer is a sum of other points' transfer, and zonal lobes are fitted to it as
to any other. Light enters and leaves diffusely: Fresnel's law is ignored except for internal reflection. The dipole
assumes a flat, half-infinite medium; it is too dark around sharp edges and too bright in thin sheets.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.generators import map_steps
from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _subsurface_kernels as kernels
from engine.realtime.zonal_harmonics.transfer import N_RAYS, TransferPoints, rotate_transfer, simulate
from engine.scene.raycaster import RayCaster

Float64Array = NDArray[np.float64]

LEFT_OUT = 1e-3  # of the reflectance, beyond the reach
_TABLE = 4096
_BLOCK = 1024


@dataclass(frozen=True)
class Medium:
    """A scattering medium: reduced scattering and absorption, per metre, and index of refraction.

    Raises ValueError unless they are finite, scattering is above 0, absorption at least 0, and the index at least 1.
    """

    scattering: float
    absorption: float
    ior: float = 1.3

    def __post_init__(self) -> None:
        if not (0.0 < self.scattering <= 1e9 and 0.0 <= self.absorption <= 1e9 and 1.0 <= self.ior <= 3.0):
            found = f"scattering {self.scattering:g}, absorption {self.absorption:g}, index {self.ior:g}"
            raise ValueError(f"{found}, expected above 0, at least 0 (both to 1e9), and 1 to 3")

    @property
    def albedo(self) -> float:
        """Reduced albedo of a single scattering."""
        return self.scattering / (self.scattering + self.absorption)

    @property
    def depths(self) -> tuple[float, float]:
        """Depth of the real source below the surface and height of the virtual one above it, metres [Jensen01, 2.3]."""
        inside = -1.440 / self.ior**2 + 0.710 / self.ior + 0.668 + 0.0636 * self.ior
        real = 1.0 / (self.scattering + self.absorption)
        return real, real * (1.0 + 4.0 / 3.0 * (1.0 + inside) / (1.0 - inside))

    @property
    def decay(self) -> float:
        """Effective transport coefficient, per metre."""
        return math.sqrt(3.0 * self.absorption * (self.scattering + self.absorption))

    def reflectance(self, distance: ArrayLike) -> Float64Array:
        """R_d, radiant exitance by power, per square metre [Jensen01, eq. 4]."""
        radius = np.asarray(distance, np.float64)
        total = np.zeros(radius.shape)
        for depth in self.depths:
            away = np.hypot(radius, depth)
            total += depth * (1.0 + self.decay * away) * np.exp(-self.decay * away) / away**3
        return np.asarray(self.albedo / (4.0 * np.pi) * total)

    def integral_beyond(self, distance: ArrayLike) -> Float64Array:
        """Integral of the reflectance over the plane beyond a distance; at 0 the whole diffuse reflectance."""
        radius = np.asarray(distance, np.float64)
        total = np.zeros(radius.shape)
        for depth in self.depths:
            away = np.hypot(radius, depth)
            total += depth * np.exp(-self.decay * away) / away
        return np.asarray(self.albedo / 2.0 * total)

    @property
    def reach(self) -> float:
        """Distance in metres beyond which less than `LEFT_OUT` of the reflectance lies."""
        low, high = 0.0, self.depths[1]
        while self.integral_beyond(high) > LEFT_OUT * self.integral_beyond(0.0):
            low, high = high, 2.0 * high
        for _ in range(40):
            middle = (low + high) / 2.0
            low, high = (
                (middle, high) if self.integral_beyond(middle) > LEFT_OUT * self.integral_beyond(0.0) else (low, middle)
            )
        return high


@dataclass(frozen=True, eq=False)
class Sources:
    """Where light enters: places (S, 3), areas (S,), and numbers (S,), the index of the entering vector; copies may
    share one."""

    places: Float64Array
    areas: Float64Array
    numbers: NDArray[np.int32]


def subsurface(
    entering: ArrayLike, points: ArrayLike, sources: Sources, medium: Medium
) -> Generator[float, None, Float64Array]:
    """Vectors that leave at points (P, 3), given vectors (Q, n^2) that enter, both in the same axes. Yields the share
    that is done."""
    entering, points = np.ascontiguousarray(entering, np.float64), np.ascontiguousarray(points, np.float64)
    places, areas = (np.ascontiguousarray(each, np.float64) for each in (sources.places, sources.areas))
    numbers = np.ascontiguousarray(sources.numbers, np.int32)
    reach = medium.reach
    table = medium.reflectance(np.linspace(0.0, reach, _TABLE))
    own = np.subtract(
        medium.integral_beyond(0.0), medium.integral_beyond(np.sqrt(areas / np.pi))
    )  # over a disc with the place's area
    leaving = np.empty((len(points), entering.shape[1]))
    for first in range(0, len(points), _BLOCK):
        count = min(_BLOCK, len(points) - first)

        def part(start: int, stop: int, first: int = first) -> None:
            kernels.gather_range(
                entering, places, areas, numbers, points, own, table, reach, first + start, first + stop, leaving
            )

        on_threads(part, *even_parts(count))
        yield (first + count) / len(points)
    return leaving


def simulate_subsurface(
    mesh: TransferPoints, caster: RayCaster, triangles: NDArray[np.int32], n: int, medium: Medium, n_rays: int = N_RAYS
) -> Generator[float, None, Float64Array]:
    """Vectors (P, n^2) of the points of a mesh, with its own shadows, in their own axes; triangles (T, 3): indices of
    these points. Yields the share that is done."""
    entering = yield from map_steps(simulate(mesh, caster, n, n_rays=n_rays), lambda share: 0.6 * share)
    places = mesh.points.position.astype(np.float64)
    sources = Sources(places, vertex_areas(places, triangles), np.arange(len(places), dtype=np.int32))
    in_world = rotate_transfer(entering, mesh.frames.transpose(0, 2, 1))
    leaving = yield from map_steps(subsurface(in_world, places, sources, medium), lambda share: 0.6 + 0.4 * share)
    return rotate_transfer(leaving, mesh.frames)


def vertex_areas(places: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Area of the surface around each vertex (V,): a third of its triangles'."""
    a, b, c = (places[triangles[:, k]] for k in range(3))
    thirds = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    return np.asarray(np.bincount(triangles.ravel(), np.repeat(thirds, 3), len(places)), np.float64)
