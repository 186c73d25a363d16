"""What the window knows of one camera's view: which pixel sees what, as the worker's primary hits say it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from engine.scene.hits import PrimaryHits


def _no_integers() -> NDArray[np.int32]:
    return np.zeros(0, dtype=np.int32)


def _no_floats() -> NDArray[np.float32]:
    return np.zeros(0, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class PictureFrame:
    """P pixels that see a reflecting object, sorted by object and then row-major; row 0 is the picture's top.

    pixel (P,) row-major index; object_ranges (O,2) first and one past the last of each object's pixels; object_image
    (H,W), −1 is background; emission_image (H,W,3) linear radiance of emitters seen directly; ray_directions (H,W,3)
    unit, world; theta_o (P,) between shading normal and eye, radians; distance (P,) along the ray, metres; front (P,)
    whether the winding faces the eye; normal and tangent (P,3) of the shading frame; edge_* (E,) silhouette pixels, the
    pixel on the other side, its share of the area.
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
    edge_pixels: NDArray[np.integer] = field(default_factory=_no_integers)
    edge_neighbours: NDArray[np.integer] = field(default_factory=_no_integers)
    edge_weights: NDArray[np.floating] = field(default_factory=_no_floats)

    @property
    def width(self) -> int:
        return self.object_image.shape[1]

    @property
    def height(self) -> int:
        return self.object_image.shape[0]

    @property
    def n_pixels(self) -> int:
        return len(self.pixel)

    @property
    def n_objects(self) -> int:
        return len(self.object_ranges)

    def object_box(self, i_object: int) -> tuple[int, int, int, int]:
        """(x, y, width, height) around an object's pixels; all 0 when it has none."""
        start, stop = self.object_ranges[i_object]
        if start == stop:
            return 0, 0, 0, 0
        y, x = np.divmod(self.pixel[start:stop], self.width)
        left, top = int(x.min()), int(y.min())
        return left, top, int(x.max()) - left + 1, int(y.max()) - top + 1

    def object_at(self, column: int, row: int) -> int:
        """The number of what a pixel sees; −1 for nothing, also where there is no such pixel."""
        inside = 0 <= column < self.width and 0 <= row < self.height
        return int(self.object_image[row, column]) if inside else -1

    def sample_at(self, column: int, row: int) -> int | None:
        """The number of a pixel among the P; None for emitters and the background."""
        index, pixel = self.object_at(column, row), row * self.width + column
        if index < 0:
            return None
        start, stop = self.object_ranges[index]
        place = int(start) + int(np.searchsorted(self.pixel[start:stop], pixel))
        return place if place < stop and self.pixel[place] == pixel else None


def picture_frame(hits: PrimaryHits, eye: NDArray[np.floating]) -> PictureFrame:
    """What the window needs of primary hits from an eye (3,)."""
    cos_o = np.clip(np.einsum("pc,pc->p", hits.normal, hits.wo), 0.0, 1.0)
    return PictureFrame(
        pixel=hits.pixel,
        object_ranges=hits.object_ranges,
        object_image=hits.object_image,
        emission_image=hits.emission_image,
        ray_directions=hits.ray_directions,
        theta_o=np.arccos(cos_o).astype(np.float32),
        distance=np.einsum("pc,pc->p", eye - hits.position, hits.wo).astype(np.float32),
        front=hits.front,
        normal=hits.normal.astype(np.float16),
        tangent=hits.tangent.astype(np.float16),
        edge_pixels=hits.edge_pixels,
        edge_neighbours=hits.edge_neighbours,
        edge_weights=hits.edge_weights,
    )
