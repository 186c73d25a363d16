"""The data of moving pictures, part by part, as arrays in the layout of GPU buffers: Orbit's, then Deform's.

Orbit's parts hold the points' light and the terms that `engine.realtime.triple_product.view_radiance` sums for a moving
picture; none depends on the camera. Of Deform's, shape, appearance, cover and backdrop stay the same while pose and
camera move; then only places and axes are sent. Rows consist of 32-bit words, so that floats, integers and pairs of
bfloat16 lie side by side. Each method's `gpu_export` makes its parts; this module imports no slow libraries, so that
the window's process can use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.texture.gpu_export import ExportedMaps, Words

if TYPE_CHECKING:
    from engine.material.layer import Layer

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]
Range = tuple[int, int]

# Words of a row of `LightPart.rows` before the coefficients: their number, two moments, the peaks' triangles and power,
# and which peaks the point sees.
N_HEAD = 172
# Sharp gloss takes so many times the coefficients of blunt in moving pictures, and at least so many: fewer would blur
# it. On the built-in tea tray's teapot 96, 224 and 336 give an error of 17, 9.1 and 7.0 %.
_SHARP_TIMES, _N_SHARP = 3.5, 96


def n_sharp(n_moving: int) -> int:
    """The coefficients of sharp gloss in moving pictures whose points take n_moving."""
    return max(round(_SHARP_TIMES * n_moving), _N_SHARP)


def as_triple(vector: NDArray[np.floating]) -> tuple[float, float, float]:
    """A vector (3,) as three numbers, which compare by value."""
    x, y, z = map(float, vector)
    return x, y, z


@dataclass(frozen=True)
class ExportedTerm:
    """A term that pixels add to an object: the light of its points times reflectance (3,) and maps."""

    i_object: int
    reflectance: tuple[float, float, float]
    maps: ExportedMaps | None


@dataclass(frozen=True, eq=False)
class MeshPart:
    """points (S, 12): position, row of glossy points in `LightPart.rows` (bits of an int, −1 for none), normal, 0,
    tangent, 0; corners (3 T, 20) of the triangles between points, sorted by object: position, face normal, texture
    coordinates in two sets, the point on the side that the winding faces and on the other (bits, −1 for none), the axes
    along which bumps offset the normal, see `BumpNormals.offset_axes`, and the vertex colour; triangle_ranges,
    point_ranges: first and last (excluded) of each object's, with several runs of points; origin (3,): the world
    position of the coordinates' origin; centre and radius of a bounding sphere; n_rows: glossy points, and
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
    """Light of the points in which (N,): irradiance (N, 4); rows (K, 172 + 2 n) of the glossy ones at place (K,): the
    number of coefficients, Σ power × x (3) and Σ power × z (3), the peaks' triangles (40), −1 for none, their power (40
    × 3), the bits of the sky's peaks that the point sees (4), 0, and the coefficients, two words each: number, red,
    green and blue, 16 bits each, the lower half first."""

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
    """The background: image (H, W, 3), None if unchanged, times scale, rotated by turn radians; and the peaks (M, 8)
    of all distant light: direction, 0, power, 0, rotated and scaled already; first and last, excluded, of those that
    reach each object."""

    image: Float32Array | None
    turn: float
    scale: float
    peaks: Float32Array
    peak_ranges: tuple[Range, ...]


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
class OrbitTerm(ExportedTerm):
    """reflectance is the factor of irradiance, albedo (3,) that of indirect irradiance; tables: the serial of its
    slices' tables, 0 for none; the bumps that perturb its irradiance and its sharp gloss; sharp: its layers where their
    gloss is reflected pixel by pixel, none where it is interpolated between points."""

    albedo: tuple[float, float, float]
    tables: int
    bumps: ExportedBumps | None
    sharp: tuple[Layer, ...] = ()


@dataclass(frozen=True, eq=False)
class TermsPart:
    """What is drawn at the points: terms; the new tables by serial (others are known already); images and strokes
    (words), None if unchanged; emission (M, 3), its cones (M, 4), and the textures that multiply it, by object;
    opacities (M, 8), see `engine.texture.gpu_export.opacity_rows`."""

    terms: tuple[OrbitTerm, ...]
    tables: Mapping[int, TablePart]
    images: Words | None
    strokes: Words
    emission: Float32Array
    cones: Float32Array
    emission_maps: Mapping[int, ExportedMaps]
    opacities: Float32Array


OrbitPart = MeshPart | LightPart | BouncedPart | SkyPart | TermsPart


@dataclass(frozen=True, eq=False)
class ShapePart:
    """corners (3 T, 4) of triangles: place, the point on the side that the winding faces and on the other, -1 for none,
    object; owners (S, 2): the object of each point, and its number among the points of this object; lobes (S, 4 + N (3
    + n)): low, then each lobe's axis and bands; gloss_rows (R, 4 + G (3 + n)): the same of all rows of glossy layers
    that are drawn by rows, layer after layer and point after point, with G = n_row_lobes. number: differs for different
    arrays."""

    number: int
    corners: Int32Array
    owners: Int32Array
    lobes: Float32Array
    n_lobes: int
    order: int
    gloss_rows: Float32Array
    n_row_lobes: int


@dataclass(frozen=True)
class ExportedDetail:
    """A `LobeMap` in the shared array of lobes: its first entry, rows and columns, and number of lobes of each
    entry; depth_image: where it begins among all images, -1 for none."""

    first: int
    shape: tuple[int, int]
    n_lobes: int
    repeats: tuple[float, float]
    is_smooth: bool
    depth: float
    depth_image: int


@dataclass(frozen=True)
class DeformTerm(ExportedTerm):
    """The points' light is diffuse; detail: replaces it, pixel by pixel; gloss: the glossy layer among all, -1 for a
    diffuse one; emits: the term is the emission of the object's front, reflectance, and needs no light."""

    detail: ExportedDetail | None
    gloss: int = -1
    emits: bool = False


@dataclass(frozen=True, eq=False)
class CoverPart:
    """Detail and images on objects, by texture coordinates. corners (3 T, 16) of their triangles, object by object:
    place, the point on the front and on the back, -1 for none, axes among those of the pose, texture coordinates in two
    sets, position and face normal at rest (bits), and vertex colour; ranges: first and last, excluded, of an object's
    triangles; lobes: of all `ExportedDetail`; images, strokes and opacities (M, 8): see `engine.texture.gpu_export`;
    holes (3 T, 5): texture coordinates in two sets and opacity at the corners of the shape's triangles, (0, 5) where
    all objects are opaque."""

    number: int
    corners: Int32Array
    ranges: dict[int, tuple[int, int]]
    lobes: Float32Array
    images: Words
    strokes: Words
    n_strokes: int
    opacities: Float32Array
    holes: Float32Array


OBJECT_ROW = 16


@dataclass(frozen=True, eq=False)
class AppearancePart:
    """harmonics (n^2, 3) and table (rows, columns, n, 3) of the sky's light, see `BandLight`; lights (3 K + 1, n^2 +
    rows columns n, 3): both of the K objects that have other light, then of the part of these, and of the sky, that
    gloss mirrors, then of the skies of the K objects; added (S, 3): radiance of points by their neighbours, (0, 3) for
    none; objects (M, `OBJECT_ROW`): albedo, first glossy layer, emission, number of glossy layers, light (0 for the
    sky's) and the `even` of that, first layer that is drawn by rows, their number, the emission's cone; gloss (G, A, 3
    n + 1): for each glossy layer that is one lobe and polar angles of wo up to `steepest`, its bands and its lean, see
    `LowGloss`; row_layers (K, 3): of each layer that is drawn by rows, its first among the shape's rows, their number
    at each point, and where its views begin in views (V,), see `GlossBasis`; cosine (n,): the bands of a white
    Lambertian surface; even: see `engine.realtime.zonal_harmonics.shading.even_light`; casts (M, C), spread (n,),
    least: see `engine.realtime.zonal_harmonics.shading`; turn, scale: of the sky, see `Backdrop`; terms: refer to the
    cover that is exported with it or was before."""

    number: int
    harmonics: Float32Array
    table: Float32Array
    lights: Float32Array
    added: Float32Array
    objects: Float32Array
    gloss: Float32Array
    row_layers: Float32Array
    views: Float32Array
    steepest: float
    cosine: Float32Array
    casts: Float32Array
    spread: Float32Array
    least: float
    turn: float
    scale: float
    terms: tuple[DeformTerm, ...] = ()


@dataclass(frozen=True, eq=False)
class BackdropPart:
    """radiance (h, w, 3) of the background, see `Backdrop`: the largest part, independent of rotation."""

    number: int
    radiance: Float32Array


@dataclass(frozen=True, eq=False)
class PosedPart:
    """places (V, 12) of everything that is drawn: of points the rows of their axes, then the position; of emitters'
    corners the position alone. axes (A, 9) of details: along u, along v, outwards. blockers (K, 14): clusters that
    shade other objects, see `engine.realtime.zonal_harmonics.shading`. of_lamps (S, 6): the radiance of white points
    by lamps, and what gloss sends of them to the camera; (0, 6) for nothing. camera_position (3,): in the same
    coordinates."""

    places: Float32Array
    axes: Float32Array
    blockers: Float32Array
    of_lamps: Float32Array
    camera_position: tuple[float, float, float]


Numbers = tuple[int, int, int, int]  # of shape, appearance, cover and backdrop; 0 for none
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
    backdrop: BackdropPart | None

    def is_missing_parts(self, known: Numbers) -> bool:
        """Whether drawing requires parts that are neither included nor among these numbers."""
        parts = zip((self.shape, self.appearance, self.cover, self.backdrop), self.numbers, known, strict=True)
        return any(part is None and number != here for part, number, here in parts)
