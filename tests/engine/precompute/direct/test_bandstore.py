"""The packed transport of a layer: what a number keeps, and both ways of contracting against the dense matrix."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.core.stored_arrays import UnsoundArrays
from engine.curve import wavelet
from engine.precompute.direct import _band_kernels as kernels
from engine.precompute.direct._band_kernels import PackedTile
from engine.precompute.direct.bandstore import (
    BandStore,
    BandTile,
    arrays_in_pieces,
    arrays_of_file,
    join_tiles,
    picture_of_file,
    store_from_arrays,
)
from tests.engine.forging import forged_numbers, forged_shapes
from tests.engine.precompute.direct.by_hand import contract
from tests.naive.transport import decode

TRIM = np.float32(1e-3)


def encode_tile(dense: np.ndarray, begin: int = 0, trim: np.float32 = TRIM) -> BandTile:
    """A tile that holds dense bands (p, J, K, 3)."""
    n_points, n_a, n_b, _ = dense.shape
    runs = (n_points, n_a if n_b > 1 else 0)
    encoded = PackedTile(
        np.empty(n_points, np.float32),
        np.zeros(runs, np.uint8),
        np.zeros(runs, np.uint8),
        np.empty(n_points, np.int64),
        np.empty(dense.size // 3, np.uint32),
    )
    cells, maxima, written = np.empty((n_a, n_b), np.float32), np.empty(n_a, np.float32), 0
    for i in range(n_points):
        encoded.start[i] = written
        written = kernels.encode_bands(np.array(dense[i], np.float32), trim, cells, maxima, encoded, i, written)
    return BandTile(begin, *encoded[:-1], encoded.values[:written].copy())


def sparse_bands(n_points: int, n_a: int, n_b: int, seed: int = 0) -> np.ndarray:
    """Bands as transport has them: runs of a few entries, some rows empty, magnitudes over eight decades."""
    random = np.random.default_rng(seed)
    values = 10.0 ** random.uniform(-4, 4, (n_points, n_a, n_b, 3))
    middle = random.integers(0, n_b, (n_points, n_a, 1))
    near = np.abs(np.arange(n_b) - middle) <= 2
    near &= random.random((n_points, n_a, 1)) < 0.8
    return values * near[..., None]


def store_of(dense: np.ndarray, chunk: int = 3) -> BandStore:
    tiles = [encode_tile(dense[i : i + chunk], i) for i in range(0, len(dense), chunk)]
    return join_tiles(dense.shape[1:3], reversed(tiles))


def whole(store: BandStore) -> dict[str, np.ndarray]:
    """Its five arrays as a file would have them."""
    parts, n_values = [tile.arrays() for tile in store.tiles], [len(tile.values) for tile in store.tiles]
    arrays = arrays_in_pieces(store.bands, store.n_points, n_values, parts.__getitem__)
    found = {name: np.concatenate(list(array.pieces())) for name, array in arrays.items()}
    for name, array in arrays.items():
        assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
    return found


def dense_of(store: BandStore) -> np.ndarray:
    return np.concatenate([decode(tile, store.bands) for tile in store.tiles])


@settings(deadline=None, max_examples=300, derandomize=True)
@given(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3), st.integers(-28, 0))
def test_a_colour_keeps_nine_bits(colour, power) -> None:
    scaled = np.array(colour, np.float32) * np.float32(2.0**power)
    word = int(kernels.encode(*scaled))
    unit = float(kernels.UNITS[word >> 27])
    decoded = np.array([(word >> shift) & 511 for shift in (0, 9, 18)]) * unit
    # Half a step of a mantissa between 256 and 511 is 2⁻⁹ of the largest channel; below 2⁻³⁰ there is a floor of 2⁻⁴⁰.
    assert np.abs(decoded - scaled).max() <= max(2.0**-9 * float(scaled.max()), 2.0**-39)


def test_a_colours_error_has_no_drift() -> None:
    # Rounded to the nearest: over many colours the mean error is far below that of one, 2⁻⁹.
    largest = np.random.default_rng(1).uniform(0.25, 1.0, 20000).astype(np.float32)
    words = np.array([kernels.encode(v, v, v) for v in largest], np.uint32)
    decoded = (words & 511) * kernels.UNITS[words >> 27].astype(float)
    assert abs(decoded.sum() / largest.sum(dtype=float) - 1) < 2e-5


def test_the_mantissa_carries_into_the_exponent() -> None:
    # 1 − 2⁻²⁴ rounds up to 512 of 512 steps: stored as 256 with the next exponent, and never as 0.
    word = int(kernels.encode(np.float32(1 - 2**-24), np.float32(0), np.float32(0)))
    assert (word & 511) * float(kernels.UNITS[word >> 27]) == 1.0


@pytest.mark.parametrize("bands", [(1, 1), (2, 1), (16, 1), (8, 4), (16, 128)])
def test_points_come_back(bands) -> None:
    dense = sparse_bands(7, *bands)
    found = dense_of(store_of(dense))
    # What is trimmed from the ends of a row moves inwards, so rows keep their sums, but for 2⁻⁹ of each entry's largest
    # channel; and what is far below the point's largest entry is below the last exponent.
    floor = dense.max(axis=(1, 2, 3))[:, None, None]
    allowed = 2**-8.99 * dense.max(axis=3).sum(axis=2)[..., None] + 1e-9 * floor
    assert (np.abs(found.sum(axis=2) - dense.sum(axis=2)) <= allowed).all()
    assert np.abs(found - dense).max() <= 2.5e-3 * dense.max()


def test_rows_are_trimmed_to_what_counts() -> None:
    row = np.array([1e-6, 1e-5, 1.0, 0.5, 0.0, 1e-7])
    dense = np.tile(row[None, None, :, None], (1, 1, 1, 3))
    tile = encode_tile(dense)
    assert (tile.first[0, 0], tile.count[0, 0], len(tile.values)) == (2, 2, 2)


@pytest.mark.parametrize("bands", [(1, 1), (16, 1), (8, 4), (4, 64)])
def test_contraction_both_ways_equals_the_dense_one(bands) -> None:
    store = store_of(sparse_bands(10, *bands, seed=2))
    dense = dense_of(store)
    random = np.random.default_rng(3)
    c_a, c_b = random.random((bands[0], 3)), random.random((bands[1], 3))
    for factor, expected in (
        (0, np.einsum("pjkc,kc->jpc", dense, c_b)),
        (1, np.einsum("pjkc,jc->kpc", dense, c_a)),
    ):
        found = contract(store, factor, (c_b, c_a)[factor], wavelet=False)
        np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-7 * expected.max())
    pictures = [
        store.radiance(c_a, c_b),
        np.einsum("jpc,jc->pc", contract(store, 0, c_b, wavelet=False), c_a),
        np.einsum("kpc,kc->pc", contract(store, 1, c_a, wavelet=False), c_b),
    ]
    expected = np.einsum("pjkc,jc,kc->pc", dense, c_a, c_b)
    for picture in pictures:
        np.testing.assert_allclose(picture, expected, rtol=2e-6)


@pytest.mark.parametrize("n_bands", [1, 2, 4, 8, 128, 512])
def test_wavelets_in_the_kernel_are_those_of_the_curves(n_bands) -> None:
    store = store_of(sparse_bands(4, n_bands, 1, seed=5))
    ones = np.ones((1, 3))
    bands = contract(store, 0, ones, wavelet=False).astype(float)
    found = contract(store, 0, ones, wavelet=True)
    np.testing.assert_allclose(found, wavelet.forward(bands), atol=2e-6 * bands.max())
    # Orthonormal: the dot product with a curve is the same number in both.
    curve = np.random.default_rng(1).random((n_bands, 3))
    np.testing.assert_allclose(
        np.einsum("jpc,jc->pc", found, wavelet.forward(curve)), np.einsum("jpc,jc->pc", bands, curve), rtol=1e-4
    )


@pytest.mark.parametrize("bands", [(16, 1), (8, 4)])
def test_a_store_survives_its_file(bands) -> None:
    store = store_of(sparse_bands(11, *bands, seed=7))
    again = store_from_arrays(bands, whole(store), chunk=4)
    assert again.n_points == 11 and len(again.tiles) == 3
    c_a, c_b = np.random.default_rng(2).random((bands[0], 3)), np.random.default_rng(4).random((bands[1], 3))
    np.testing.assert_array_equal(again.radiance(c_a, c_b), store.radiance(c_a, c_b))
    np.testing.assert_array_equal(contract(again, 1, c_a, wavelet=False), contract(store, 1, c_a, wavelet=False))
    # Tiles that share their values are counted once.
    assert again.n_bytes == store.n_bytes


def test_points_in_the_dark_are_zero() -> None:
    dense = sparse_bands(3, 8, 4)
    dense[1] = 0.0
    store = store_of(dense)
    picture = store.radiance(np.ones((8, 3)), np.ones((4, 3)))
    assert not picture[1].any() and picture[0].all()


def test_coefficients_of_another_length_are_refused() -> None:
    store = store_of(sparse_bands(2, 8, 4))
    with pytest.raises(ValueError, match=r"\(8, 3\)\], expected \[\(8, 3\), \(4, 3\)\]"):
        contract(store, 0, np.ones((8, 3)), wavelet=False)


@pytest.mark.parametrize("bands", [(16, 1), (8, 4)])
@pytest.mark.parametrize("chunk", [4, 100])
def test_a_thinned_store_holds_every_so_manieth_point_whole(bands, chunk) -> None:
    dense = sparse_bands(23, *bands, seed=9)
    store = store_from_arrays(bands, whole(store_of(dense)), chunk)
    thinned = store.thin(7)  # every third
    np.testing.assert_array_equal(dense_of(thinned), dense_of(store)[::3])
    assert len(thinned.tiles) == 2
    assert thinned.n_bytes < store.n_bytes / 2
    assert store.thin(12) is store


def test_the_empty_ends_of_a_row_are_passed_by_and_faint_ones_move_inwards() -> None:
    row = np.array([0.0, 1e-6, 0.0, 1.0, 0.0, 0.5, 0.0, 1e-7, 0.0])
    tile = encode_tile(np.tile(row[None, None, :, None], (1, 1, 1, 3)))
    assert (tile.first[0, 0], tile.count[0, 0], len(tile.values)) == (3, 3, 3)


@pytest.mark.parametrize("bands", [(8, 4), (8, 1)])
def test_arrays_that_are_not_a_store_are_refused(bands) -> None:
    arrays = whole(store_of(sparse_bands(11, *bands, seed=7)))
    for name, array in arrays_of_file(bands, 11, arrays).items():
        np.testing.assert_array_equal(array, arrays[name])
    numbers = {name: array for name, array in arrays.items() if name != "values"}  # any word is a colour
    forgeries = [*forged_shapes(arrays), *((what, arrays | forged) for what, forged in forged_numbers(numbers))]
    assert len(forgeries) > 30
    for what, forged in forgeries:
        with pytest.raises(UnsoundArrays):
            arrays_of_file(bands, 11, forged)
            pytest.fail(what)
    for other, n_points in (((4, bands[1]), 11), (bands, 10), (bands, 12), ((bands[0], 2), 11)):
        with pytest.raises(UnsoundArrays):
            arrays_of_file(other, n_points, arrays)


def test_arrays_that_are_not_a_picture_are_refused() -> None:
    arrays = {"picture": np.ones((5, 3), np.float32)}
    np.testing.assert_array_equal(picture_of_file(5, arrays), arrays["picture"])
    for _, forged in (*forged_shapes(arrays), *forged_numbers(arrays)):
        with pytest.raises(UnsoundArrays):
            picture_of_file(5, forged)
