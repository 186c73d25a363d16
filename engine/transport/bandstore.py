"""Band transport of one layer, kept small: rows of U_jk as shared-exponent colours.

For P points, J bands of factor A and K bands of factor B (K = 1 when the layer has one curve):

- `scale` (P,) float32: the largest entry of the point; all others are stored relative to it, so that bright and dark
  points, suns and shadows, keep the same precision whatever the light's unit.
- `first`, `count` (P, J) uint8: which k a row holds. A light spans few bands, so a row is one short run.
- `start` (P,) int64: where the point's run begins in `values`; `values` (N,) uint32, nine bits a channel and a shared
  five-bit exponent (error ≤ 2⁻⁹ of the entry's largest channel, random in sign).

Compared on a 512×512 teapot on a tray: float32 matrices need 12 bytes an entry and every entry, half floats with a
16-bit column index 8 bytes an entry; this needs 4 and two bytes a row. Entries are never negative (light, visibility
and BRDF are not), which is why they are kept as bands and transformed to wavelets on the way out.
"""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from engine.transport import _band_kernels as kernels


@dataclass(frozen=True)
class BandTile:
    """Encoded transport of consecutive points; the fields are described above. `begin` is the first point's index."""

    begin: int
    scale: np.ndarray
    first: np.ndarray
    count: np.ndarray
    start: np.ndarray
    values: np.ndarray

    @property
    def n_bytes(self) -> int:
        return sum(a.nbytes for a in (self.scale, self.first, self.count, self.start, self.values))

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "scale": self.scale,
            "first": self.first,
            "count": self.count,
            "start": self.start,
            "values": self.values,
        }


@dataclass(frozen=True)
class BandStore:
    """All tiles of one layer, in order: P points, bands (J, K)."""

    bands: tuple[int, int]
    tiles: tuple[BandTile, ...]

    @property
    def n_points(self) -> int:
        return sum(len(tile.scale) for tile in self.tiles)

    @property
    def n_bytes(self) -> int:
        values = {id(tile.values): tile.values.nbytes for tile in self.tiles}
        return sum(values.values()) + sum(tile.n_bytes - tile.values.nbytes for tile in self.tiles)

    def contract(self, factor: int, dormant: np.ndarray, wavelet: bool) -> np.ndarray:
        """Transport of one factor with the other at rest: T = c_Bᵀ U or U c_A [BenArtzi07, eq. 4.16].

        factor 0 keeps A (dormant is c_B, (K, 3)), 1 keeps B (dormant is c_A, (J, 3)).
        Returns (J or K, P, 3) float32, coefficients first: Daubechies-4 when `wavelet`, else bands.
        """
        n_kept = self.bands[factor]
        out = np.empty((n_kept, self.n_points, 3), np.float32)
        expected = (self.bands[1 - factor], 3)
        if dormant.shape != expected:
            raise ValueError(f"dormant coefficients have shape {dormant.shape}, expected {expected}")
        coefficients = np.ascontiguousarray(dormant, np.float32)
        self._each_tile(
            lambda tile: kernels.contract_tile(
                tile.scale, tile.first, tile.count, tile.start, tile.values, *self.bands, coefficients,
                factor == 0, wavelet, out, tile.begin, kernels.UNITS,
            )
        )  # fmt: skip
        return out

    def radiance(self, coefficients_a: np.ndarray, coefficients_b: np.ndarray) -> np.ndarray:
        """The layer's picture Σ_jk c_j c_k U_jk, (P, 3) float32."""
        out = np.empty((self.n_points, 3), np.float32)
        c_a, c_b = np.ascontiguousarray(coefficients_a, np.float32), np.ascontiguousarray(coefficients_b, np.float32)
        self._each_tile(
            lambda tile: kernels.radiance_tile(
                tile.scale, tile.first, tile.count, tile.start, tile.values, *self.bands, c_a, c_b, out, tile.begin,
                kernels.UNITS,
            )
        )  # fmt: skip
        return out

    def _each_tile(self, work: Callable[[BandTile], None]) -> None:
        with ThreadPoolExecutor(2) as pool:
            for _ in pool.map(work, self.tiles):
                pass

    def arrays(self) -> dict[str, np.ndarray]:
        """The whole store as five arrays, for a file; `store_from_arrays` reads it back."""
        offsets = np.cumsum([0] + [len(tile.values) for tile in self.tiles])
        joined = {
            name: np.concatenate([tile.arrays()[name] for tile in self.tiles]) for name in ("scale", "first", "count")
        }
        starts = [tile.start + offset for tile, offset in zip(self.tiles, offsets, strict=False)]
        return joined | {
            "start": np.concatenate(starts),
            "values": np.concatenate([tile.values for tile in self.tiles]),
        }


def store_from_arrays(bands: tuple[int, int], arrays: Mapping[str, np.ndarray], chunk: int = 2048) -> BandStore:
    """The store that `BandStore.arrays` wrote; tiles of `chunk` points share its values."""
    scale, start, values = (np.array(arrays[name]) for name in ("scale", "start", "values"))
    runs = (len(scale), bands[0] if bands[1] > 1 else 0)
    first, count = (np.array(arrays[name]).reshape(runs) for name in ("first", "count"))
    tiles = [
        BandTile(i, scale[i : i + chunk], first[i : i + chunk], count[i : i + chunk], start[i : i + chunk], values)
        for i in range(0, len(scale), chunk)
    ]
    return BandStore(bands, tuple(tiles))


def join_tiles(bands: tuple[int, int], tiles: Iterable[BandTile]) -> BandStore:
    return BandStore(bands, tuple(sorted(tiles, key=lambda tile: tile.begin)))
