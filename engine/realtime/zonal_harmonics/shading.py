"""Radiance of points whose transfer is zonal lobes, in the axes of a deformed mesh [Sloan05, 5].

The light is tabulated once for all points, band by band over the directions of lobe axes; each lobe then costs one
look-up. The lobes rotate, not the light, so the table serves every point of every pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _shading_kernels as kernels
from engine.realtime.zonal_harmonics.zonal import Zonal
from engine.sphere.harmonics import basis, order_of

Float32Array = NDArray[np.float32]

ROWS, COLUMNS = 32, 64


@dataclass(frozen=True, eq=False)
class BandLight:
    """Distant light: its harmonics (n^2, 3), and table (rows, columns, n, 3) with each band along each direction, by
    latitude from +z and longitude from -x [Sloan05, eq. 24]."""

    harmonics: Float32Array
    table: Float32Array


def band_light(light: ArrayLike) -> BandLight:
    """Tabulate light (n^2, 3), see `engine.sphere.harmonics.project`."""
    harmonics = np.asarray(light, np.float64)
    n = order_of(harmonics.T)
    products = _basis_of_table(n)[:, :, None] * harmonics
    table = np.add.reduceat(products, np.arange(n) ** 2, axis=1).reshape(ROWS, COLUMNS, n, 3)
    return BandLight(harmonics.astype(np.float32), table.astype(np.float32))


@dataclass(frozen=True, eq=False)
class Lobes:
    """Zonal lobes in single precision for shading: see `Zonal`."""

    low: Float32Array
    axes: Float32Array
    coefficients: Float32Array


def lobes(zonal: Zonal) -> Lobes:
    return Lobes(*(np.ascontiguousarray(each, np.float32) for each in (zonal.low, zonal.axes, zonal.coefficients)))


def shade(lobes: Lobes, frames: ArrayLike, light: BandLight) -> Float32Array:
    """Radiance (P, 3) of white points whose current axes are the rows of frames (P, 3, 3)."""
    frames = np.ascontiguousarray(frames, np.float32)
    radiance = np.empty((len(frames), 3), np.float32)
    on_threads(
        lambda start, stop: kernels.shade_range(
            lobes.low, lobes.axes, lobes.coefficients, frames, light.harmonics, light.table, start, stop, radiance
        ),
        *even_parts(len(frames)),
    )
    return radiance


@cache
def _basis_of_table(n: int) -> NDArray[np.float64]:
    """The harmonics (rows * columns, n^2) at the table's directions."""
    polar = (np.arange(ROWS) + 0.5)[:, None] * (np.pi / ROWS)
    azimuth = (np.arange(COLUMNS) + 0.5) * (2.0 * np.pi / COLUMNS) - np.pi
    sine = np.sin(polar)
    directions = np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar))
    return basis(np.stack(directions, axis=-1).reshape(-1, 3), n)
