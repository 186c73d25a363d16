"""The data of moving pictures, part by part, as arrays in the layout of GPU buffers.

The parts hold the points' light and the terms that `view_radiance.view_radiance` sums for a moving picture; none
depends on the camera. Rows consist of 32-bit words, so that floats, integers and pairs of bfloat16 lie side by side.
`gpu_export` makes the parts; this module imports no slow libraries, so that the window's process can use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.texture.gpu_export import ExportedMaps, Words

Float32Array = NDArray[np.float32]
Range = tuple[int, int]

# Words of a row of `LightPart.rows` before the coefficients: their number, two moments, and the peaks.
N_HEAD = 168


@dataclass(frozen=True, eq=False)
class MeshPart:
    """points (S, 12): position, row of glossy points in `LightPart.rows` (bits of an int, −1 for none), normal, 0,
    tangent, 0; corners (3 T, 16) of the triangles between points, sorted by object: position, face normal, texture
    coordinates, the point on the side that the winding faces and on the other (bits, −1 for none), and the axes along
    which bumps offset the normal, see `BumpNormals.offset_axes`; triangle_ranges, point_ranges: first and last
    (excluded) of each object's, with several runs of points; origin (3,): the world position of the coordinates'
    origin; centre and radius of a bounding sphere; n_rows: glossy points, and n_coefficients of each."""

    points: Words
    corners: Words
    triangle_ranges: tuple[Range, ...]
    point_ranges: tuple[tuple[Range, ...], ...]
    origin: tuple[float, float, float]
    centre: tuple[float, float, float]
    radius: float
    n_rows: int
    n_coefficients: int


@dataclass(frozen=True, eq=False)
class LightPart:
    """Light of the points in which (N,): irradiance (N, 4); rows (K, 168 + 2 n) of the glossy ones at place (K,): the
    number of coefficients, Σ power × x (3) and Σ power × z (3), the peaks' triangles (40), −1 for none, their power (40
    × 3), 0, and the coefficients, two words each: number, red, green and blue, 16 bits each, the lower half first."""

    which: NDArray[np.int32]
    irradiance: Float32Array
    place: NDArray[np.int32]
    rows: Words


@dataclass(frozen=True, eq=False)
class BouncedPart:
    """indirect (S, 4): indirect irradiance of all points."""

    indirect: Float32Array


@dataclass(frozen=True, eq=False)
class SkyPart:
    """The background: image (H, W, 3), None if unchanged, times scale, rotated by turn radians."""

    image: Float32Array | None
    turn: float
    scale: float


@dataclass(frozen=True, eq=False)
class TablePart:
    """Slices of a term's layers, see `_slice_kernels.Tables`: coefficients and values (E, 2), each entry red, green and
    blue, 16 bits each, the lower half first."""

    coefficients: Words
    values: Words
    images: NDArray[np.int32]
    places: NDArray[np.int32]
    n_polar: int
    n_columns: int
    steepest: float


@dataclass(frozen=True)
class ExportedBumps:
    """Bumps of an object: offset of its slopes among the images, their repeats, and the factor of the slopes."""

    slopes: int
    repeats: tuple[float, float]
    scale: float
    is_normal_map: bool


@dataclass(frozen=True)
class ExportedTerm:
    """One term of the sum: the factors of irradiance and of indirect irradiance (3,); the serial of its tables, 0 for
    none; the bumps that perturb its irradiance."""

    i_object: int
    reflectance: tuple[float, float, float]
    albedo: tuple[float, float, float]
    tables: int
    maps: ExportedMaps | None
    bumps: ExportedBumps | None


@dataclass(frozen=True, eq=False)
class TermsPart:
    """What is drawn at the points: terms; the new tables by serial (others are known already); images and strokes
    (words), None if unchanged; emission (M, 3)."""

    terms: tuple[ExportedTerm, ...]
    tables: Mapping[int, TablePart]
    images: Words | None
    strokes: Words
    emission: Float32Array


Part = MeshPart | LightPart | BouncedPart | SkyPart | TermsPart
