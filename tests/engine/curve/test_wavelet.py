"""Daubechies-4 over bands is orthonormal at every size, with the properties that follow."""

import math
import pickle

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.curve.wavelet import HIGH_PASS, LOW_PASS, BandCountError, forward, inverse, transform_matrix
from tests.naive.curves import daubechies4

SIZES = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512]


def test_filters():
    # Sum sqrt(2) and norm 1, the table of [BenArtzi07, 4.2.5], and two vanishing moments: constants and ramps give 0.
    assert sum(LOW_PASS) == pytest.approx(math.sqrt(2.0), abs=1e-15)
    assert np.linalg.norm(LOW_PASS) == pytest.approx(1.0, abs=1e-15)
    assert LOW_PASS == pytest.approx((0.4829629131445341, 0.8365163037378077, 0.2241438680420134, -0.1294095225512603))
    assert np.dot(HIGH_PASS, [1, 1, 1, 1]) == pytest.approx(0.0, abs=1e-15)
    assert np.dot(HIGH_PASS, [0, 1, 2, 3]) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("n_bands", SIZES)
def test_orthonormal_in_both_precisions(n_bands):
    matrix = transform_matrix(n_bands)
    assert np.abs(matrix @ matrix.T - np.eye(n_bands)).max() < 3e-15
    single = matrix.astype(np.float32)
    assert np.abs(single @ single.T - np.eye(n_bands)).max() < 4e-7


def test_smallest_sizes():
    # One band is itself; two bands with the filter wrapped around are Haar.
    root = math.sqrt(0.5)
    assert transform_matrix(1).tolist() == [[1.0]]
    assert np.abs(transform_matrix(2)) == pytest.approx(np.full((2, 2), root))
    assert forward(np.array([3.0, 3.0])) == pytest.approx([3.0 / root, 0.0], abs=1e-15)


@pytest.mark.parametrize("n_bands", SIZES)
def test_matrix_is_the_pyramid(n_bands):
    bands = np.random.default_rng(n_bands).normal(size=n_bands)
    assert forward(bands) == pytest.approx(daubechies4(bands), abs=1e-13)


@pytest.mark.parametrize("n_bands", SIZES)
def test_round_trip_and_dot_product(n_bands):
    rng = np.random.default_rng(3)
    curve, transport = rng.normal(size=(n_bands, 3)), rng.normal(size=(7, n_bands))
    assert np.abs(inverse(forward(curve)) - curve).max() < 1e-12
    assert np.abs(forward(transport, axis=-1) @ forward(curve) - transport @ curve).max() < 1e-12


def test_single_precision_stays_single():
    rows = np.random.default_rng(4).normal(size=(5, 64)).astype(np.float32)
    assert forward(rows, axis=-1).dtype == np.float32
    assert inverse(forward(rows, axis=-1), axis=-1) == pytest.approx(rows, abs=2e-6)


def test_dropping_coefficients_costs_their_energy():
    # Parseval: the squared error of keeping the largest K is the squares of those dropped, so it never rises with K.
    curve = np.exp(-(np.linspace(0.0, 4.0, 128) ** 2))
    coefficients = forward(curve)
    order = np.argsort(-np.abs(coefficients))
    errors = []
    for kept in range(129):
        partial = np.zeros(128)
        partial[order[:kept]] = coefficients[order[:kept]]
        errors.append(((inverse(partial) - curve) ** 2).sum())
        assert errors[-1] == pytest.approx((coefficients[order[kept:]] ** 2).sum(), abs=1e-12)
    assert (np.diff(errors) <= 1e-15).all()
    assert errors[0] == pytest.approx((curve**2).sum())


def test_a_ramp_needs_few_coefficients():
    # Two vanishing moments: away from the wrap every detail of a ramp is 0. Each of 6 levels wraps in at most 2 places.
    coefficients = forward(np.linspace(0.0, 1.0, 64))
    assert (np.abs(coefficients) > 1e-12).sum() <= 1 + 2 * 6


@pytest.mark.parametrize("n_bands", [0, -1, -8, 3, 6, 100, 513, 2.0, True, "8", None])
def test_other_counts_are_named(n_bands):
    with pytest.raises(BandCountError, match=f"number of bands = {n_bands!r}, expected a power of two") as caught:
        transform_matrix(n_bands)
    assert isinstance(caught.value, InsituError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_empty_curve_is_refused():
    with pytest.raises(BandCountError):
        forward(np.zeros((0, 3)))


def test_the_shared_matrix_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        transform_matrix(8)[0, 0] = 2.0
