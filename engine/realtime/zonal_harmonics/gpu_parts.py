"""What moving pictures are drawn of by a graphics card, part by part: arrays as its buffers have them.

Shape, look, cover and sky stay as they are while a pose and a camera move; then nothing is sent but places and axes.
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
    """corners (3 T, 4) of triangles: the place of each, the point on the side that the winding faces and on the other,
    -1 for none, the object; owners (S,): the object of each point; lobes (S, 4 + N (3 + n)): low, then of each lobe its
    axis and its bands. number: another one has other arrays."""

    number: int
    corners: Int32Array
    owners: Int32Array
    lobes: Float32Array
    n_lobes: int
    order: int


@dataclass(frozen=True)
class ExportedDetail:
    """A `LobeMap` among the lobes of all: where it begins, its rows and columns, and lobes of each entry."""

    first: int
    shape: tuple[int, int]
    n_lobes: int
    repeats: tuple[float, float]
    is_smooth: bool


@dataclass(frozen=True)
class ExportedTerm:
    """What pixels add to an object: its matt light, of its points or of detail, times reflectance (3,) and maps."""

    i_object: int
    reflectance: tuple[float, float, float]
    maps: ExportedMaps | None
    detail: ExportedDetail | None


@dataclass(frozen=True, eq=False)
class CoverPart:
    """What lies on objects by texture coordinates. corners (3 T, 12) of their triangles, object by object: the place of
    each, the point on its front and on its back, -1 for none, its axes among those of the pose, texture coordinates,
    the place on the mesh at rest and the normal of the face there (bits); ranges: the first and the last, excluded, of
    an object's triangles; lobes: of all `ExportedDetail`; images and strokes: see `engine.texture.gpu_export`."""

    number: int
    corners: Int32Array
    ranges: dict[int, tuple[int, int]]
    lobes: Float32Array
    images: Words
    strokes: Words
    n_strokes: int


@dataclass(frozen=True, eq=False)
class AppearancePart:
    """harmonics (n^2, 3) and table (rows, columns, n, 3) of the light, see `BandLight`; objects (M, 8): albedo, the
    first of its layers with gloss, emission, how many they are; gloss (G, A, 3 n + 1): of each such layer, for angles
    of the eye up to `steepest`, its bands and its lean, see `LowGloss`; cosine (n,): the bands of a white matt surface;
    even: see `engine.realtime.zonal_harmonics.gloss.even_light`; casts (M, C), spread (n,), least: see
    `engine.realtime.zonal_harmonics.blockers`; turn, scale: of the sky, see `Backdrop`; terms: by the cover that is
    told with it, or was."""

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
    """radiance (h, w, 3) of what is behind it all, see `Backdrop`: the largest part, the same however it turns."""

    number: int
    radiance: Float32Array


@dataclass(frozen=True, eq=False)
class PosedPart:
    """places (V, 12) of all that is drawn: of points the rows of their axes, then where they are; of emitters' corners
    that alone. axes (A, 9) that details lie in: along u, along v, outwards. blockers (K, 14): clusters of what shades
    others, see `engine.realtime.zonal_harmonics.blockers`. eye (3,): where the camera stands among them."""

    places: Float32Array
    axes: Float32Array
    blockers: Float32Array
    camera_position: tuple[float, float, float]


Numbers = tuple[int, int, int, int]  # of shape, look, cover and sky; 0 for none
NO_PARTS: Numbers = (0, 0, 0, 0)


@dataclass(frozen=True, eq=False)
class PictureExport:
    """All that a picture is drawn of: the pose, and parts by their numbers; those that are None are known by now."""

    posed: PosedPart
    numbers: Numbers
    shape: ShapePart | None
    appearance: AppearancePart | None
    cover: CoverPart | None
    sky: SkyPart | None

    def is_missing_parts(self, known: Numbers) -> bool:
        """Whether more parts are needed to draw it than it brings, and than those of these numbers."""
        parts = zip((self.shape, self.appearance, self.cover, self.sky), self.numbers, known, strict=True)
        return any(part is None and number != here for part, number, here in parts)
