"""What moving pictures are drawn of by a graphics card, part by part: arrays as its buffers have them.

Shape and look stay as they are while a pose and a camera move; of these two nothing is sent but places and axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Integers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class ShapePart:
    """corners (3 T, 4) of triangles: the place of each, the point on the side that the winding faces and on the other,
    -1 for none, the object; owners (S,): the object of each point; lobes (S, 4 + N (3 + n)): low, then of each lobe its
    axis and its bands. number: another one has other arrays."""

    number: int
    corners: Integers
    owners: Integers
    lobes: Singles
    n_lobes: int
    order: int


@dataclass(frozen=True, eq=False)
class LookPart:
    """harmonics (n^2, 3) and table (rows, columns, n, 3) of the light, see `BandLight`; objects (M, 8): albedo, the
    first of its layers with gloss, emission, how many they are; gloss (G, A, 3 n + 1): of each such layer, for angles
    of the eye up to `steepest`, its bands and its lean, see `LowGloss`; cosine (n,): the bands of a white matt surface;
    sky (h, w, 3), see `Backdrop`."""

    number: int
    harmonics: Singles
    table: Singles
    objects: Singles
    gloss: Singles
    steepest: float
    cosine: Singles
    sky: Singles
    turn: float
    scale: float


@dataclass(frozen=True, eq=False)
class PosedPart:
    """places (V, 12) of all that is drawn: of points the rows of their axes, then where they are; of emitters' corners
    that alone. eye (3,): where the camera stands among them."""

    places: Singles
    eye: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Told:
    """All that a picture is drawn of; shape and look are None where they are known to be the same."""

    posed: PosedPart
    shape: ShapePart | None
    look: LookPart | None
