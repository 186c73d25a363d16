"""Stores the band transport of one layer compactly: rows of U_jk as shared-exponent colours.

For P points, J bands of factor A and K bands of factor B (K = 1 for a layer with one curve):

- `scale` (P,) float32: the largest entry of the point. All others are stored relative to it, so that bright and dark
  points, sunlit and in shadow, have the same precision whatever the light's unit.
- `first`, `count` (P, J) uint8: the range of k that a row holds. A light spans few bands, so a row is one short run.
- `start` (P,) int64: where the point's run begins in `values`. `values` (N,) uint32: nine bits per channel and a shared
  five-bit exponent (error ≤ 2⁻⁹ of the entry's largest channel, random in sign).

Compared on a 512×512 teapot on a tray: float32 matrices need 12 bytes an entry and every entry, half floats with a
16-bit column index 8 bytes an entry; this needs 4 and two bytes a row. Entries are never negative (nor are light,
visibility and BRDF), which is why they are stored as bands and transformed to wavelets on export.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from engine.core.stored_arrays import ArrayInPieces, ArrayReader, Arrays, UnsoundArrays
from engine.core.threads import on_threads
from engine.precompute.direct import _band_kernels as kernels
from engine.precompute.direct import _plane_kernels as plane_kernels


@dataclass(frozen=True)
class BandTile:
    """Encoded transport of consecutive points, see the module's docstring. `begin` is the first point's index."""

    begin: int
    scale: np.ndarray
    first: np.ndarray
    count: np.ndarray
    start: np.ndarray
    values: np.ndarray

    @property
    def n_bytes(self) -> int:
        return sum(a.nbytes for a in (self.scale, self.first, self.count, self.start, self.values))

    @property
    def packed(self) -> plane_kernels.PackedTile:
        return plane_kernels.PackedTile(self.scale, self.first, self.count, self.start, self.values)

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "scale": self.scale,
            "first": self.first,
            "count": self.count,
            "start": self.start,
            "values": self.values,
        }


@dataclass(frozen=True, eq=False)
class Planes:
    """Transport along one curve: numbers (J, P, 3); the largest |number| (J,) and the sums of squares (J, 3) of each
    plane before rounding; and the picture, radiance (P, 3)."""

    numbers: np.ndarray
    radiance: np.ndarray
    maxima: np.ndarray
    squares: np.ndarray


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

    def fill(
        self, factor: int, coefficients: tuple[np.ndarray, np.ndarray], inverse: np.ndarray,
        dtype: type[np.floating], wavelet: bool = True,
    ) -> Planes:  # fmt: skip
        """Transport of one factor with the other curve fixed, T = c_Bᵀ U or U c_A [BenArtzi07, eq. 4.16], with what
        else one pass can compute. coefficients: those of both factors, (J, 3) and (K, 3).

        factor: 0 for the planes of A, 1 for those of B. `numbers` are ordered coefficient first: Daubechies-4 wavelets
        if `wavelet`, else bands. inverse (J or K,): the factor that each plane is multiplied by; dtype: float16 or
        float32. Raises ValueError for coefficients of other shapes.
        """
        found, expected = [c.shape for c in coefficients], [(n, 3) for n in self.bands]
        if found != expected:
            raise ValueError(f"coefficients have shapes {found}, expected {expected}")
        n_kept = self.bands[factor]
        numbers = np.empty((n_kept, self.n_points, 3), dtype)
        words = numbers.reshape(n_kept, 3 * self.n_points).view(np.uint16 if dtype is np.float16 else np.float32)
        radiance = np.empty((self.n_points, 3), np.float32)
        maxima = np.zeros((len(self.tiles), n_kept), np.float32)
        squares = np.zeros((len(self.tiles), n_kept, 3))
        dormant = np.ascontiguousarray(coefficients[1 - factor].T, np.float32)
        curve = np.tile(np.asarray(coefficients[factor], np.float64), (1, plane_kernels.BLOCK))
        scaling = inverse.astype(np.float32)

        def fill_tile(tile: BandTile, largest: np.ndarray, summed: np.ndarray) -> None:
            plane_kernels.contract_tile(
                tile.packed, tile.begin, self.bands[1], factor == 0, wavelet, dormant, curve, scaling, words,
                radiance.reshape(-1), largest, summed,
            )  # fmt: skip

        on_threads(fill_tile, self.tiles, maxima, squares)
        return Planes(numbers, radiance, maxima.max(axis=0, initial=0.0).astype(np.float64), squares.sum(axis=0))

    def thin(self, n_points: int) -> "BandStore":
        """About `n_points` of the points, evenly spaced, or all where there are fewer; for statistics of the store.

        They are packed anew, in a tile for each of two threads: reading three points from each of 300 tiles in place
        took as long as a fifth of the whole store.
        """
        step = self.n_points // n_points
        if step < 2:
            return self
        parts: dict[str, list[np.ndarray]] = {"scale": [], "first": [], "count": [], "values": []}
        lengths = []
        for tile in self.tiles:
            chosen = slice(-tile.begin % step, None, step)
            count = tile.count[chosen]
            n_values = count.sum(axis=1, dtype=np.int64) if self.bands[1] > 1 else np.full(len(count), self.bands[0])
            runs = zip(tile.start[chosen].tolist(), n_values.tolist(), strict=True)
            parts["scale"].append(tile.scale[chosen])
            parts["first"].append(tile.first[chosen])
            parts["count"].append(count)
            parts["values"].extend(tile.values[start : start + n] for start, n in runs)
            lengths.append(n_values)
        arrays = {name: np.concatenate(found) for name, found in parts.items()}
        ends = np.cumsum(np.concatenate(lengths))
        arrays["start"] = np.concatenate([[0], ends[:-1]])
        return store_from_arrays(self.bands, arrays, -(-len(ends) // 2))

    def radiance(self, coefficients_a: np.ndarray, coefficients_b: np.ndarray) -> np.ndarray:
        """The layer's picture Σ_jk c_j c_k U_jk, (P, 3) float32 [BenArtzi07, eq. 4.13]."""
        out = np.empty((self.n_points, 3), np.float32)
        c_a, c_b = np.ascontiguousarray(coefficients_a, np.float32), np.ascontiguousarray(coefficients_b, np.float32)
        on_threads(
            lambda tile: kernels.radiance_tile(
                tile.scale, tile.first, tile.count, tile.start, tile.values, *self.bands, c_a, c_b, out, tile.begin,
                kernels.UNITS,
            ),
            self.tiles,
        )  # fmt: skip
        return out


def arrays_in_pieces(
    bands: tuple[int, int], n_points: int, n_values: Sequence[int], part: Callable[[int], Arrays]
) -> dict[str, ArrayInPieces]:
    """A whole layer as five arrays, for a file that `arrays_of_file` reads; they are written piece by piece and never
    whole in memory.

    part: the arrays of a tile by its number, `BandTile.arrays`; n_values: the number of values of each tile.
    """
    offsets = np.cumsum([0, *n_values])

    def pieces(name: str) -> Iterator[np.ndarray]:
        for i in range(len(n_values)):
            array = np.asarray(part(i)[name])
            yield array + offsets[i] if name == "start" else array

    n_runs = bands[0] if bands[1] > 1 else 0
    shapes = {
        "scale": (np.float32, (n_points,)),
        "first": (np.uint8, (n_points, n_runs)),
        "count": (np.uint8, (n_points, n_runs)),
        "start": (np.int64, (n_points,)),
        "values": (np.uint32, (int(offsets[-1]),)),
    }
    return {
        name: ArrayInPieces(np.dtype(dtype), shape, partial(pieces, name)) for name, (dtype, shape) in shapes.items()
    }


def arrays_of_file(bands: tuple[int, int], n_points: int, arrays: Arrays) -> dict[str, np.ndarray]:
    """Copies of the five arrays of P points, of a store or a tile, from a file.

    Raises UnsoundArrays where a row would read beyond the values.
    """
    reader = ArrayReader(arrays, P=n_points, J=bands[0] if bands[1] > 1 else 0)
    scale, values = reader.take("scale", np.float32, "P"), reader.take("values", np.uint32, "N")
    first, count = (reader.take(name, np.uint8, "P", "J") for name in ("first", "count"))
    n_values = count.sum(axis=1, dtype=np.int64) if bands[1] > 1 else np.full(n_points, bands[0])
    start = reader.take("start", np.int64, "P", below=len(values) + 1)
    all_there = n_values.sum() == len(values) and (start + n_values <= len(values)).all()
    if not all_there or (first.astype(np.int16) + count > bands[1]).any():
        raise UnsoundArrays("rows are not what the values are of")
    return {"scale": scale, "first": first, "count": count, "start": start, "values": values}


def store_from_arrays(bands: tuple[int, int], arrays: Mapping[str, np.ndarray], chunk: int = 2048) -> BandStore:
    """The store that `arrays_in_pieces` wrote; tiles of `chunk` points share its values."""
    scale, first, count, start, values = (arrays[name] for name in ("scale", "first", "count", "start", "values"))
    tiles = [
        BandTile(i, scale[i : i + chunk], first[i : i + chunk], count[i : i + chunk], start[i : i + chunk], values)
        for i in range(0, len(scale), chunk)
    ]
    return BandStore(bands, tuple(tiles))


def join_tiles(bands: tuple[int, int], tiles: Iterable[BandTile]) -> BandStore:
    return BandStore(bands, tuple(sorted(tiles, key=lambda tile: tile.begin)))
