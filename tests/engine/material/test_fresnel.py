"""Fresnel terms: known reflectances, the limits of the index, and bounds for any index."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.material.fresnel import conductor_fresnel, schlick_fresnel

COSINES = np.cos(np.linspace(0.0, math.pi / 2, 201))


def fresnel(cosine, eta, k=0.0):
    return conductor_fresnel(np.asarray(cosine, dtype=float), np.asarray(eta, dtype=float), np.asarray(k, dtype=float))


@pytest.mark.parametrize(("eta", "k"), [(1.5, 0.0), (1e3, 0.0), (0.2004, 3.9129), (1.1022, 2.1421), (1 / 1.5, 0.0)])
def test_head_on(eta, k):
    # ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2)
    assert fresnel(1.0, eta, k) == pytest.approx(((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2), rel=1e-12)


@pytest.mark.parametrize("eta", [1.5, 1.0001, 1e3])
def test_dielectric_against_snell(eta):
    # Snell's law and the two textbook amplitudes.
    refracted = np.sqrt(1.0 - (1.0 - COSINES**2) / eta**2)
    s = (COSINES - eta * refracted) / (COSINES + eta * refracted)
    p = (eta * COSINES - refracted) / (eta * COSINES + refracted)
    assert fresnel(COSINES, eta) == pytest.approx(0.5 * (s**2 + p**2), rel=1e-9, abs=1e-13)


def test_conductor_against_complex_amplitudes():
    # The same with a complex index.
    index = 0.924 + 2.4528j
    inside = np.sqrt(index**2 - (1.0 - COSINES**2))
    s = np.abs((COSINES - inside) / (COSINES + inside)) ** 2
    p = np.abs((index**2 * COSINES - inside) / (index**2 * COSINES + inside)) ** 2
    assert fresnel(COSINES, 0.924, 2.4528) == pytest.approx(0.5 * (s + p), rel=1e-12)


def test_brewster():
    # At tan(theta) = eta only the s part is left: half of ((eta^2 - 1) / (eta^2 + 1))^2.
    eta = 1.5
    assert fresnel(math.cos(math.atan(eta)), eta) == pytest.approx(0.5 * ((eta**2 - 1) / (eta**2 + 1)) ** 2, rel=1e-12)


def test_no_interface_reflects_nothing():
    # Index 1: 0 for every cosine, the limit at cosine 0 included.
    assert (fresnel(np.append(COSINES, 0.0), 1.0) == 0.0).all()
    # Index 1.0001: still nothing to see up to 80 degrees.
    assert (fresnel(COSINES[:178], 1.0001) < 1e-5).all()


def test_total_reflection():
    # Into the thinner medium beyond arcsin(1/1.5) everything comes back.
    beyond = np.sqrt(1.0 - np.linspace(1 / 1.5 + 1e-9, 1.0, 50) ** 2)
    assert fresnel(beyond, 1 / 1.5) == pytest.approx(np.ones(50), abs=1e-12)


def test_grazing_reflects_all():
    # Cosine exactly 0 gives 1 for every interface that is one.
    assert fresnel(np.zeros(3), [1.5, 0.2, 1e3], [0.0, 3.9, 0.0]) == pytest.approx(np.ones(3))


def test_channels_broadcast():
    assert conductor_fresnel(COSINES[:, None], np.array([0.2, 0.9, 1.1]), np.array([3.9, 2.4, 2.1])).shape == (201, 3)


def test_schlick():
    # Its ends are the facing reflectance and 1; with 1 it is 1 throughout.
    assert schlick_fresnel(np.array([1.0, 0.0, 0.5]), 0.04) == pytest.approx([0.04, 1.0, 0.04 + 0.96 / 32])
    assert (schlick_fresnel(COSINES, 1.0) == 1.0).all()


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    cosine=st.floats(0.0, 1.0),
    eta=st.floats(1e-3, 1e3) | st.sampled_from([1.0, 1.0 + 1e-15]),
    k=st.floats(0.0, 1e3) | st.sampled_from([0.0, 1e-12]),
)
def test_always_a_share(cosine, eta, k):
    assert 0.0 <= fresnel(cosine, eta, k) <= 1.0 + 1e-12
