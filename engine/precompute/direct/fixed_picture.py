"""The transport of a fixed layer: its picture under the current curves, without bands.

The bands that it is computed with are summed tile by tile and discarded, so that it takes twelve bytes a point: fixed
objects include their BRDF in the precomputation, and "the BRDF bases need not be considered" [BenArtzi07, sect. 6.1.3].
Using only the few bands that its curves require was rejected: bands also determine how finely a light is split, and
with those alone the error of the Cornell box was 3.9 % instead of 1.1 %.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine.core.stored_arrays import ArrayReader, Arrays
from engine.precompute.direct.bandstore import BandStore, BandTile

BYTES_A_POINT = 12


@dataclass(frozen=True, eq=False)
class FixedPicture:
    """A layer's picture Σ_jk c_j c_k U_jk, (P, 3) float32."""

    picture: np.ndarray

    @property
    def n_points(self) -> int:
        return len(self.picture)

    @property
    def n_bytes(self) -> int:
        return int(self.picture.nbytes)

    def radiance(self, *_: np.ndarray) -> np.ndarray:
        """The picture, (P, 3), with the curves that it was computed with; ignores the arguments."""
        return self.picture

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays for a file."""
        return {"picture": self.picture}


def picture_of_file(n_points: int, arrays: Arrays) -> np.ndarray:
    """The picture of P points, of a layer or a tile, from a file. Raises UnsoundArrays."""
    return ArrayReader(arrays, P=n_points).take("picture", np.float32, "P", 3)


def picture_of_tile(tile: BandTile, bands: tuple[int, int], curves: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """One tile's picture (p, 3) float32 under the layer's curves, (J, 3) and (K, 3)."""
    alone = BandTile(0, tile.scale, tile.first, tile.count, tile.start, tile.values)
    return BandStore(bands, (alone,)).radiance(*curves)


def join_pictures(parts: Mapping[int, np.ndarray]) -> FixedPicture:
    """The layer's picture from those of its tiles, by their first point."""
    return FixedPicture(np.concatenate([np.zeros((0, 3), np.float32), *(parts[begin] for begin in sorted(parts))]))
