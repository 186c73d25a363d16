"""What moving pictures are drawn of, part by part, for a graphics card that draws them: arrays as buffers have them.

The parts are the points' own functions and the terms that `view_radiance.view_radiance` sums of them for a moving
picture; the camera is in none of them. Numbers of 32 bits stand in rows of words, so that floats, whole numbers and
pairs of bfloat16 lie side by side. They are told by `gpu_export`, and kept where slow libraries are not imported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.texture.gpu_export import ExportedMaps, Words

Float32Array = NDArray[np.float32]
Range = tuple[int, int]

# Of a row of `LightPart.rows`: before the coefficients stand how many there are, two moments, and the suns.
N_HEAD = 168


@dataclass(frozen=True, eq=False)
class MeshPart:
    """points (S, 12): position, row among those with gloss (bits of an int, −1 for none), normal, 0, tangent, 0;
    corners (3 T, 16) of the triangles between them, by object: position, normal of the face, texture coordinates, the
    point on the side that the winding faces and on the other (bits, −1 for none), and what bumps lean along, see
    `BumpNormals.ways`; triangles, points: first and last of each object's, of the points in several runs; origin (3,):
    what positions are relative to; a ball around all, its centre and radius; n_rows: of those with gloss, and
    n_coefficients of each."""

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
    """What points (N,) keep by now: irradiance (N, 4); rows (K, 168 + 2 n) of those with gloss, by their place (K,):
    how many coefficients, Σ power × x (3) and Σ power × z (3), the suns' triangles (40), −1 for none, their power
    (40 × 3), 0, and the coefficients, two words each: number and red, green and blue, 16 bits each, the lower first."""

    which: NDArray[np.int32]
    irradiance: Float32Array
    place: NDArray[np.int32]
    rows: Words


@dataclass(frozen=True, eq=False)
class BouncedPart:
    """indirect (S, 4): irradiance of light that was reflected before, of all points."""

    indirect: Float32Array


@dataclass(frozen=True, eq=False)
class SkyPart:
    """What stands behind all: image (H, W, 3), None for the one before, times scale, turned by radians."""

    image: Float32Array | None
    turn: float
    scale: float


@dataclass(frozen=True, eq=False)
class TablePart:
    """Slices of the layers of a term, see `_slice_kernels.Tables`: by coefficient and by triangle, (E, 2): red, green
    and blue, 16 bits each, the lower first."""

    coefficients: Words
    values: Words
    images: NDArray[np.int32]
    places: NDArray[np.int32]
    n_polar: int
    n_columns: int
    steepest: float


@dataclass(frozen=True)
class ExportedBumps:
    """Where an object's slopes begin among the images, how often they repeat, and what they are multiplied by."""

    slopes: int
    repeats: tuple[float, float]
    scale: float
    is_normal_map: bool


@dataclass(frozen=True)
class ExportedTerm:
    """One sum: what irradiance is multiplied by (3,), and what indirect irradiance is; the serial of its tables, 0 for
    none; where an object has bumps they lean its irradiance."""

    i_object: int
    reflectance: tuple[float, float, float]
    albedo: tuple[float, float, float]
    tables: int
    maps: ExportedMaps | None
    bumps: ExportedBumps | None


@dataclass(frozen=True, eq=False)
class TermsPart:
    """What is drawn of the points: terms; tables that are new, by serial, others are known; images and strokes (words),
    None where they are as before; emission (M, 3)."""

    terms: tuple[ExportedTerm, ...]
    tables: Mapping[int, TablePart]
    images: Words | None
    strokes: Words
    emission: Float32Array


Part = MeshPart | LightPart | BouncedPart | SkyPart | TermsPart
