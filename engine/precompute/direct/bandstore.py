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

Transport along one curve is exported to the renderer as a plane of numbers for each coefficient, with the picture:

    T = c_Bᵀ U or U c_A [BenArtzi07, eq. 4.16], transformed by Daubechies-4;   numbers = T / scale

Curve switching waits for this, so contraction, transform, scaling, rounding, norms and picture take one pass over the
packed bands. Halves hold nine decades and the planes span many more, so each plane has its own scale: a power of two,
estimated from a thousand points with room for 4,000 times as much. Where the estimate fails, the pass is repeated with
the maxima of the first one. Separate passes, through single precision, took five times as long.

The transport of a fixed layer is its picture under the current curves, without bands. The bands that it is computed
with are summed tile by tile and discarded, so that it takes twelve bytes a point: fixed objects include their BRDF in
the precomputation, and "the BRDF bases need not be considered" [BenArtzi07, sect. 6.1.3]. Using only the few bands that
its curves require was rejected: bands also determine how finely a light is split, and with those alone the error of the
Cornell box was 3.9 % instead of 1.1 %.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from engine.core.stored_arrays import ArrayInPieces, ArrayReader, Arrays, UnsoundArrays
from engine.core.threads import on_threads
from engine.precompute.direct import _band_kernels as kernels
from engine.settings import Precision

SCALE_SAMPLES = 1024
# The largest number of a scaled plane: its estimated position, and its permitted range. Halves end at 65,504.
SCALE_MARGIN, LEAST_NUMBER, MOST_NUMBER = 16.0, 2.0**-4, 65504.0
BYTES_A_POINT = 12  # of a `FixedPicture`


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
    def packed(self) -> kernels.PackedTile:
        return kernels.PackedTile(self.scale, self.first, self.count, self.start, self.values)

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
        curve = np.tile(np.asarray(coefficients[factor], np.float64), (1, kernels.BLOCK))
        scaling = inverse.astype(np.float32)

        def fill_tile(tile: BandTile, largest: np.ndarray, summed: np.ndarray) -> None:
            kernels.contract_tile(
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
        return self if step < 2 else self.take(np.arange(0, self.n_points, step), n_tiles=2)

    def take(self, points: np.ndarray, n_tiles: int = 8) -> "BandStore":
        """Some of the points, by number, ascending: packed anew, in about so many tiles."""
        parts: dict[str, list[np.ndarray]] = {"scale": [], "first": [], "count": [], "values": []}
        lengths = []
        for tile in self.tiles:
            low, high = np.searchsorted(points, (tile.begin, tile.begin + len(tile.scale)))
            chosen = points[low:high] - tile.begin
            count = tile.count[chosen]
            n_values = count.sum(axis=1, dtype=np.int64) if self.bands[1] > 1 else np.full(len(count), self.bands[0])
            runs = zip(tile.start[chosen].tolist(), n_values.tolist(), strict=True)
            parts["scale"].append(tile.scale[chosen])
            parts["first"].append(tile.first[chosen])
            parts["count"].append(count)
            parts["values"].extend(tile.values[start : start + n] for start, n in runs)
            lengths.append(n_values)
        parts["values"].append(np.zeros(0, np.uint32))
        arrays = {name: np.concatenate(found) for name, found in parts.items()}
        ends = np.cumsum(np.concatenate(lengths))
        arrays["start"] = np.concatenate([[0], ends])[:-1]
        return store_from_arrays(self.bands, arrays, max(-(-len(ends) // n_tiles), 1))

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


@dataclass(frozen=True, eq=False)
class CurvePlanes:
    """numbers (J, P, 3) float16 or float32; true values are numbers · scale (J,).

    norms (J, 3): lengths of the true planes, per channel; radiance (P, 3) float32: the layer's picture.
    """

    numbers: np.ndarray
    scale: np.ndarray
    norms: np.ndarray
    radiance: np.ndarray


def curve_planes(
    store: BandStore, factor: int, coefficients: tuple[np.ndarray, np.ndarray], unit: float, precision: Precision
) -> CurvePlanes:
    """The planes of factor 0 (A) or 1 (B) of a layer with these curves, (J, 3) and (K, 3), times `unit`.

    Raises ValueError for coefficients whose shape is not the store's.
    """
    dtype = np.float16 if precision == "half" else np.float32
    guessed = store.thin(SCALE_SAMPLES).fill(factor, coefficients, np.ones(store.bands[factor]), dtype)
    scale = _power_of_two(guessed.maxima) / SCALE_MARGIN
    found = store.fill(factor, coefficients, 1.0 / scale, dtype)
    if ((found.maxima > MOST_NUMBER) | ((found.maxima < LEAST_NUMBER) & (found.maxima > 0.0))).any():
        scale *= _power_of_two(found.maxima)
        found = store.fill(factor, coefficients, 1.0 / scale, dtype)
    scale *= unit
    norms = np.sqrt(found.squares) * scale[:, None]
    return CurvePlanes(found.numbers, scale, norms, found.radiance * np.float32(unit))


def _power_of_two(largest: np.ndarray) -> np.ndarray:
    """The power of two from each number up to its double, 1 for 0; within the range of single precision."""
    _, exponents = np.frexp(np.where((largest > 0.0) & np.isfinite(largest), largest, 0.5))
    return np.exp2(np.clip(exponents, -100, 100).astype(np.float64))


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
