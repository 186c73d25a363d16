"""The part of the primary hits of one camera that the window needs: which pixel shows what."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from engine.scene.primary_hits import PrimaryHits


class Lamps(NamedTuple):
    """Emitters that are seen from their front: pixels (E,), the object in each and its share of it, times what its cone
    sends there; factor (E, 3): the mean of its texture there, which multiplies the object's emission (E, 3)."""

    pixel: NDArray[np.integer]
    object: NDArray[np.integer]
    share: NDArray[np.floating]
    factor: NDArray[np.floating]
    emission: NDArray[np.floating]

    @property
    def seen(self) -> NDArray[np.floating]:
        """The radiance (E, 3) that each adds to its pixel."""
        return self.share[:, None] * self.factor * self.emission


def _no_floats() -> NDArray[np.float32]:
    return np.zeros(0, dtype=np.float32)


def no_lamps() -> Lamps:
    none, nothing = np.zeros(0, np.int32), np.zeros((0, 3), np.float32)
    return Lamps(none, none, _no_floats(), nothing, nothing)


@dataclass(frozen=True, eq=False)
class PictureFrame:
    """P visible points on reflecting objects, sorted by object, then row-major; row 0 is the picture's top.

    pixel (P,) row-major index, that of a pixel's centre first if there are several at an edge; share (P,) of its pixel
    that a point represents; object_ranges (O,2) first and one past the last of each object's points; object_image (H,W)
    at pixels' centres, −1 is background; open_image (H,W) the share of each pixel that shows it; emission_image (H,W,3)
    linear radiance of emitters seen directly, by their shares, see `lamps`; ray_directions (H,W,3) unit, world; theta_o
    (P,) between shading normal and wo, radians, coat_theta_o the same in the coat's frame; distance (P,) along the ray,
    metres; front (P,) whether the winding faces the camera; normal and tangent (P,3) of the shading frame. share,
    open_image and lamps may be omitted if no pixel has several points, coat_theta_o if both frames are the same.
    """

    pixel: NDArray[np.integer]
    object_ranges: NDArray[np.integer]
    object_image: NDArray[np.integer]
    emission_image: NDArray[np.floating]
    ray_directions: NDArray[np.floating]
    theta_o: NDArray[np.floating]
    distance: NDArray[np.floating] = field(default_factory=_no_floats)
    front: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    normal: NDArray[np.floating] = field(default_factory=_no_floats)
    tangent: NDArray[np.floating] = field(default_factory=_no_floats)
    share: NDArray[np.floating] = field(default_factory=_no_floats)
    open_image: NDArray[np.floating] = field(default_factory=_no_floats)
    lamps: Lamps = field(default_factory=no_lamps)
    coat_theta_o: NDArray[np.floating] = field(default_factory=_no_floats)

    def __post_init__(self) -> None:
        if not self.coat_theta_o.size:
            object.__setattr__(self, "coat_theta_o", self.theta_o)
        if not self.share.size:
            object.__setattr__(self, "share", np.ones(len(self.pixel), np.float32))
        if not self.open_image.size:
            object.__setattr__(self, "open_image", (self.object_image < 0).astype(np.float32))
        if not self.lamps.pixel.size:
            object.__setattr__(self, "lamps", _whole_lamps(self.object_image, self.emission_image))

    @property
    def width(self) -> int:
        return self.object_image.shape[1]

    @property
    def height(self) -> int:
        return self.object_image.shape[0]

    @property
    def n_points(self) -> int:
        return len(self.pixel)

    @property
    def n_objects(self) -> int:
        return len(self.object_ranges)

    def places(self, i_object: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Rows (p,), which do not decrease, and columns (p,) of an object's points."""
        start, stop = self.object_ranges[i_object]
        row, column = np.divmod(self.pixel[start:stop].astype(np.int32), np.int32(self.width))
        return row, column

    def object_box(self, i_object: int) -> tuple[int, int, int, int]:
        """(x, y, width, height) around an object's pixels; all 0 if it has none."""
        y, x = self.places(i_object)
        if not y.size:
            return 0, 0, 0, 0
        left, top = int(x.min()), int(y.min())
        return left, top, int(x.max()) - left + 1, int(y.max()) - top + 1

    def object_at(self, column: int, row: int) -> int:
        """Index of the object at a pixel; −1 for none, also outside of the picture."""
        inside = 0 <= column < self.width and 0 <= row < self.height
        return int(self.object_image[row, column]) if inside else -1

    def objects_in(self, left: float, top: float, right: float, bottom: float) -> NDArray[np.integer]:
        """Indices of the objects that pixels show which a rectangle meets, also in a part of them alone."""
        x = slice(max(math.floor(left), 0), max(math.floor(right) + 1, 0))
        y = slice(max(math.floor(top), 0), max(math.floor(bottom) + 1, 0))
        found = np.unique(self.object_image[y, x])
        row, column = np.divmod(self.lamps.pixel, self.width)
        lit = (row >= y.start) & (row < y.stop) & (column >= x.start) & (column < x.stop)
        return np.union1d(found[found >= 0], self.lamps.object[lit])

    def sample_at(self, column: int, row: int) -> int | None:
        """Index of the point at a pixel's centre; None for emitters and the background."""
        index, pixel = self.object_at(column, row), row * self.width + column
        if index < 0:
            return None
        start, stop = self.object_ranges[index]
        place = int(start) + int(np.searchsorted(self.pixel[start:stop], pixel))
        return place if place < stop and self.pixel[place] == pixel else None


def _whole_lamps(object_image: NDArray[np.integer], emission_image: NDArray[np.floating]) -> Lamps:
    """The emitters of pixels that show one object each."""
    lit = np.flatnonzero(emission_image.any(axis=2))
    one = np.ones((len(lit), 3), np.float32)
    return Lamps(lit, object_image.ravel()[lit], one[:, 0], one, emission_image.reshape(-1, 3)[lit])


def picture_frame(hits: PrimaryHits, camera: NDArray[np.floating]) -> PictureFrame:
    """The window's part of primary hits of a camera at this position (3,)."""
    theta_o, of_coats = hits.view_angles(np.arange(len(hits.pixel))).astype(np.float32)
    return PictureFrame(
        pixel=hits.pixel,
        object_ranges=hits.object_ranges,
        object_image=hits.object_image,
        emission_image=hits.emission_image,
        ray_directions=hits.ray_directions,
        theta_o=theta_o,
        distance=np.einsum("pc,pc->p", camera - hits.position, hits.wo).astype(np.float32),
        front=hits.front,
        normal=hits.normal.astype(np.float16),
        tangent=hits.tangent.astype(np.float16),
        share=hits.share,
        open_image=hits.open_image,
        lamps=hits.lamps,
        coat_theta_o=theta_o if hits.coat_normal is None else of_coats,
    )
