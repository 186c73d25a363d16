"""Planes as the renderer takes them: halves rounded as IEEE 754 has it, scales that fit, norms and the picture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.precompute.direct import _band_kernels as kernels
from engine.precompute.direct.bandstore import LEAST_NUMBER, MOST_NUMBER, SCALE_SAMPLES, BandStore, curve_planes
from tests.engine.precompute.direct.by_hand import contract
from tests.engine.precompute.direct.test_bandstore import dense_of, sparse_bands, store_of


def halves(numbers: np.ndarray) -> np.ndarray:
    """The kernel's halves of float32 numbers (N,), as bits."""
    found = np.empty(len(numbers), np.uint16)
    kernels._write(numbers, np.float32(1.0), found)
    return found


def numpys_halves(numbers: np.ndarray) -> np.ndarray:
    with np.errstate(all="ignore"):
        return numbers.astype(np.float16).view(np.uint16)


def test_halves_are_those_of_numpy() -> None:
    # Every 1,021st of all bit patterns: both signs, all exponents, 4 million mantissas.
    numbers = np.arange(0, 2**32, 1021, dtype=np.uint64).astype(np.uint32).view(np.float32)
    found, expected, no_number = halves(numbers), numpys_halves(numbers), np.isnan(numbers)
    np.testing.assert_array_equal(found[~no_number], expected[~no_number])
    assert (found[no_number] & 0x7FFF > 0x7C00).all()


def test_halves_between_and_beside_every_half_are_those_of_numpy() -> None:
    # All finite halves, the ties between neighbours (to even), and the floats next to those on both sides.
    every = np.arange(0x7C00, dtype=np.uint16).view(np.float16).astype(np.float32)
    ties = (every[:-1] + every[1:]) / np.float32(2)
    around = [every, ties, np.nextafter(ties, np.float32(0)), np.nextafter(ties, np.float32(np.inf))]
    numbers = np.concatenate([*around, *(-a for a in around)])
    np.testing.assert_array_equal(halves(numbers), numpys_halves(numbers))


@pytest.mark.parametrize(
    ("number", "bits"),
    [
        (0.0, 0x0000),
        (-0.0, 0x8000),
        (65504.0, 0x7BFF),  # the largest
        (65519.996, 0x7BFF),
        (65520.0, 0x7C00),  # half a step above it: infinite
        (np.inf, 0x7C00),
        (-np.inf, 0xFC00),
        (2.0**-14, 0x0400),  # the least normal one
        (2.0**-24, 0x0001),  # the least
        (2.0**-25, 0x0000),  # a tie with 0
        (1.0001 * 2.0**-25, 0x0001),
        (1e-45, 0x0000),
    ],
)
def test_halves_at_the_ends_of_their_range(number: float, bits: int) -> None:
    assert halves(np.array([number], np.float32))[0] == bits


def curves(store: BandStore, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.random((store.bands[0], 3)), random.random((store.bands[1], 3))


@pytest.mark.parametrize("precision", ["half", "float"])
@pytest.mark.parametrize(("bands", "factor"), [((16, 1), 0), ((8, 1), 1), ((8, 4), 0), ((4, 64), 1), ((1, 1), 0)])
def test_planes_are_the_contraction(bands, factor, precision) -> None:
    # 37 points in tiles of 3: blocks of 16 that end early.
    store = store_of(sparse_bands(37, *bands, seed=2))
    found = curve_planes(store, factor, curves(store), 3.0, precision)
    expected = 3.0 * contract(store, factor, curves(store)[1 - factor], wavelet=True).astype(float)
    true = found.numbers * found.scale[:, None, None]
    assert found.numbers.dtype == (np.float16 if precision == "half" else np.float32)
    largest = np.abs(expected).max(axis=(1, 2), keepdims=True)
    # Halves have eleven bits down to 2^-14, and the largest number of a plane lies above 2^-4.
    allowed = (2.0**-11 * np.abs(expected) + 2.0**-21 * largest) if precision == "half" else 2.0**-23 * largest
    assert (np.abs(true - expected) <= allowed).all()
    np.testing.assert_allclose(found.norms, np.sqrt(np.einsum("jpc,jpc->jc", expected, expected)), rtol=1e-5)
    np.testing.assert_allclose(found.radiance, 3.0 * store.radiance(*curves(store)), rtol=2e-6)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(st.integers(-20, 12), st.integers(-20, 12), st.booleans())
def test_a_guess_that_fails_is_mended(others: int, peak: int, is_seen: bool) -> None:
    """A point unlike all others, whether or not the guess has seen it: halves stay finite, and none is lost."""
    dense = np.full((2 * SCALE_SAMPLES, 2, 1, 3), 10.0**others)
    place = 0 if is_seen else 1  # the guess looks at every second point
    dense[place] = 10.0**peak
    store = store_of(dense, chunk=4096)
    found = curve_planes(store, 0, (np.ones((2, 3)), np.ones((1, 3))), 1.0, "half")
    largest = np.abs(found.numbers.astype(float)).max(axis=(1, 2))
    assert largest[0] <= MOST_NUMBER and largest[0] >= LEAST_NUMBER
    # Bands that are equal: the first coefficient is their sum over the root of 2.
    expected = np.sqrt(2) * dense_of(store)[place, 0, 0]
    allowed = 2.0**-19 * max(float(expected.max()), np.sqrt(2) * 10.0**others)
    np.testing.assert_allclose(found.numbers[0, place] * found.scale[0], expected, rtol=2e-3, atol=allowed)


def test_a_plane_that_the_guess_finds_black_is_not_lost() -> None:
    dense = np.zeros((2 * SCALE_SAMPLES, 2, 1, 3))
    dense[1, 0] = 1e-9
    found = curve_planes(store_of(dense, chunk=4096), 0, (np.ones((2, 3)), np.ones((1, 3))), 1.0, "half")
    true = found.numbers[:, 1] * found.scale[:, None]
    np.testing.assert_allclose(true, np.full((2, 3), np.sqrt(0.5) * 1e-9), rtol=4e-3)


def test_black_planes_are_black() -> None:
    store = store_of(np.zeros((5, 4, 2, 3)))
    found = curve_planes(store, 0, curves(store), 1.0, "half")
    assert not found.numbers.any() and not found.norms.any() and not found.radiance.any()
    assert np.isfinite(found.scale).all() and (found.scale > 0).all()


def test_a_layer_without_points_has_empty_planes() -> None:
    found = curve_planes(BandStore((8, 1), ()), 0, (np.ones((8, 3)), np.ones((1, 3))), 1.0, "half")
    assert found.numbers.shape == (8, 0, 3) and found.radiance.shape == (0, 3) and not found.norms.any()
