"""What the window knows of one camera's view: which pixel sees what, as the worker's primary hits say it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError


def _no_integers() -> NDArray[np.int32]:
    return np.zeros(0, dtype=np.int32)


def _no_floats() -> NDArray[np.float32]:
    return np.zeros(0, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class PictureFrame:
    """P pixels that see a reflecting object, sorted by object and then row-major; row 0 is the picture's top.

    pixel (P,) row-major index; object_ranges (O,2) first and one past the last of each object's pixels; object_image
    (H,W), −1 is background; theta_o (P,) radians; emission_image (H,W,3) linear radiance of emitters seen directly;
    ray_directions (H,W,3) unit, world; edge_* (E,) silhouette pixels, the pixel on the other side, its share of the
    area.
    """

    width: int
    height: int
    pixel: NDArray[np.integer]
    object_ranges: NDArray[np.integer]
    object_image: NDArray[np.integer]
    theta_o: NDArray[np.floating]
    emission_image: NDArray[np.floating]
    ray_directions: NDArray[np.floating]
    edge_pixels: NDArray[np.integer] = field(default_factory=_no_integers)
    edge_neighbours: NDArray[np.integer] = field(default_factory=_no_integers)
    edge_weights: NDArray[np.floating] = field(default_factory=_no_floats)

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

    def validate(self) -> None:
        """Raises GraphicsError naming the array that does not fit."""
        image, n_image = (self.height, self.width), self.width * self.height
        shapes = {
            "object_ranges": (self.object_ranges.shape, (self.n_objects, 2)),
            "object_image": (self.object_image.shape, image),
            "theta_o": (self.theta_o.shape, (self.n_pixels,)),
            "emission_image": (self.emission_image.shape, (*image, 3)),
            "ray_directions": (self.ray_directions.shape, (*image, 3)),
            "edge_neighbours": (self.edge_neighbours.shape, self.edge_pixels.shape),
            "edge_weights": (self.edge_weights.shape, self.edge_pixels.shape),
        }
        for name, (found, expected) in shapes.items():
            if found != expected:
                raise GraphicsError(f"{name} of shape {found}, expected {expected}")
        for name in ("pixel", "edge_pixels", "edge_neighbours"):
            _refuse_outside(name, getattr(self, name), n_image)
        _refuse_outside("object_ranges", self.object_ranges, self.n_pixels + 1)


def _refuse_outside(name: str, indices: NDArray[np.integer], end: int) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= end):
        raise GraphicsError(f"{name} holds {indices.min()} to {indices.max()}, expected 0 to {end - 1}")
