"""The data of moving pictures, part by part, as arrays in the layout of GPU buffers.

Shape, appearance, cover and sky stay the same while pose and camera move; then only places and axes are sent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.texture.gpu_export import ExportedMaps, Words

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class ShapePart:
    """corners (3 T, 4) of triangles: place, the point on the side that the winding faces and on the other, -1 for none,
    object; owners (S,): the object of each point; lobes (S, 4 + N (3 + n)): low, then each lobe's axis and bands.
    number: differs for different arrays."""

    number: int
    corners: Int32Array
    owners: Int32Array
    lobes: Float32Array
    n_lobes: int
    order: int


@dataclass(frozen=True)
class ExportedDetail:
    """A `LobeMap` in the shared array of lobes: its first entry, rows and columns, and number of lobes of each
    entry."""

    first: int
    shape: tuple[int, int]
    n_lobes: int
    repeats: tuple[float, float]
    is_smooth: bool


@dataclass(frozen=True)
class ExportedTerm:
    """A term that pixels add to an object: diffuse light, of its points or of detail, times reflectance (3,) and
    maps."""

    i_object: int
    reflectance: tuple[float, float, float]
    maps: ExportedMaps | None
    detail: ExportedDetail | None


@dataclass(frozen=True, eq=False)
class CoverPart:
    """Detail and images on objects, by texture coordinates. corners (3 T, 12) of their triangles, object by object:
    place, the point on the front and on the back, -1 for none, axes among those of the pose, texture coordinates, and
    position and face normal at rest (bits); ranges: first and last, excluded, of an object's triangles; lobes: of all
    `ExportedDetail`; images and strokes: see `engine.texture.gpu_export`."""

    number: int
    corners: Int32Array
    ranges: dict[int, tuple[int, int]]
    lobes: Float32Array
    images: Words
    strokes: Words
    n_strokes: int


@dataclass(frozen=True, eq=False)
class AppearancePart:
    """harmonics (n^2, 3) and table (rows, columns, n, 3) of the light, see `BandLight`; objects (M, 8): albedo, first
    glossy layer, emission, number of glossy layers; gloss (G, A, 3 n + 1): for each glossy layer and polar angles of wo
    up to `steepest`, its bands and its lean, see `LowGloss`; cosine (n,): the bands of a white Lambertian surface;
    even: see `engine.realtime.zonal_harmonics.shading.even_light`; casts (M, C), spread (n,), least: see
    `engine.realtime.zonal_harmonics.shading`; turn, scale: of the sky, see `Backdrop`; terms: refer to the cover that
    is exported with it or was before."""

    number: int
    harmonics: Float32Array
    table: Float32Array
    objects: Float32Array
    gloss: Float32Array
    steepest: float
    cosine: Float32Array
    even: float
    casts: Float32Array
    spread: Float32Array
    least: float
    turn: float
    scale: float
    terms: tuple[ExportedTerm, ...] = ()


@dataclass(frozen=True, eq=False)
class SkyPart:
    """radiance (h, w, 3) of the background, see `Backdrop`: the largest part, independent of rotation."""

    number: int
    radiance: Float32Array


@dataclass(frozen=True, eq=False)
class PosedPart:
    """places (V, 12) of everything that is drawn: of points the rows of their axes, then the position; of emitters'
    corners the position alone. axes (A, 9) of details: along u, along v, outwards. blockers (K, 14): clusters that
    shade other objects, see `engine.realtime.zonal_harmonics.shading`. camera_position (3,): in the same coordinates.
    """

    places: Float32Array
    axes: Float32Array
    blockers: Float32Array
    camera_position: tuple[float, float, float]


Numbers = tuple[int, int, int, int]  # of shape, appearance, cover and sky; 0 for none
NO_PARTS: Numbers = (0, 0, 0, 0)


@dataclass(frozen=True, eq=False)
class PictureExport:
    """Everything that a picture needs: the pose, and the other parts by their numbers; those that are None are known
    already."""

    posed: PosedPart
    numbers: Numbers
    shape: ShapePart | None
    appearance: AppearancePart | None
    cover: CoverPart | None
    sky: SkyPart | None

    def is_missing_parts(self, known: Numbers) -> bool:
        """Whether drawing requires parts that are neither included nor among these numbers."""
        parts = zip((self.shape, self.appearance, self.cover, self.sky), self.numbers, known, strict=True)
        return any(part is None and number != here for part, number, here in parts)
