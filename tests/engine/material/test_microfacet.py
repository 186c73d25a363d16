"""Distributions integrate to 1, masking passes the weak white furnace, powers are exact where rounding bites."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.material.microfacet import (
    beckmann,
    conductor_fresnel,
    cosine_power,
    directions,
    ggx,
    schlick_fresnel,
    smith_beckmann,
    smith_ggx,
    v_groove,
)

ALPHAS = [1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.7, 1.0]


def over_half_angles(alpha):
    """Angles (N,) graded from far below alpha to pi/2, and quadrature weights for an integral over d theta."""
    edges = np.concatenate([[0.0], np.geomspace(1e-3 * alpha, math.pi / 2, 60)])
    points, weights = np.polynomial.legendre.leggauss(24)
    width = np.diff(edges)[:, None]
    return (edges[:-1, None] + width * (0.5 + 0.5 * points)).ravel(), (0.5 * width * weights).ravel()


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("distribution", [ggx, beckmann])
def test_integrates_to_one(distribution, alpha):
    # The projected area of all microfacets is that of the surface: the integral of D cos over the hemisphere is 1.
    theta, weight = over_half_angles(alpha)
    density = distribution(np.cos(theta), np.sin(theta) ** 2, alpha)
    total = 2.0 * math.pi * (density * np.cos(theta) * np.sin(theta) * weight).sum()
    assert total == pytest.approx(1.0, abs=1e-6)


def test_ggx_peak():
    # 1 / (pi alpha^2) = 3.183e7 at alpha 1e-4.
    assert ggx(np.array([1.0]), np.array([0.0]), 1e-4)[0] == pytest.approx(1e8 / math.pi, rel=1e-12)


@pytest.mark.parametrize("alpha", [1e-4, 1e-3])
def test_ggx_in_single_precision(alpha):
    # With alpha^2 cos^2 + sin^2 nothing cancels: single precision agrees with double to 1e-5, near the peak too.
    theta = np.geomspace(1e-6, 1.0, 200)
    cosine, sin2 = np.cos(theta), np.sin(theta) ** 2
    single = ggx(cosine.astype(np.float32), sin2.astype(np.float32), alpha)
    assert single == pytest.approx(ggx(cosine, sin2, alpha), rel=1e-5)


def test_ggx_of_alpha_one_is_uniform():
    # alpha = 1: 1/pi everywhere above the horizon, 0 below.
    theta = np.linspace(0.0, 1.57, 50)
    assert ggx(np.cos(theta), np.sin(theta) ** 2, 1.0) == pytest.approx(np.full(50, 1.0 / math.pi))
    assert ggx(np.array([-0.1]), np.array([0.99]), 1.0).tolist() == [0.0]


@pytest.mark.parametrize("distribution", [ggx, beckmann])
def test_alpha_zero_counts_as_the_smallest(distribution):
    one = np.array([1.0])
    assert distribution(one, one - one, 0.0) == distribution(one, one - one, 1e-4)


def test_beckmann_ends():
    # Finite and 0 at the horizon, where tan is infinite.
    edge = np.array([0.0, 6e-17, 1e-8])
    assert beckmann(edge, 1.0 - edge**2, 0.5).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("theta_o", [0.0, 0.5, 1.2, 1.5, 1.57])
def test_weak_white_furnace(alpha, theta_o):
    # With masking of the eye alone and no Fresnel all light comes back: the integral over the half vector of
    # D(h) G1(o) max(o.h, 0) / cos_o is 1 for Smith's exact G1 [Heitz14].
    theta, weight = over_half_angles(alpha)
    cos_o, sin_o = math.cos(theta_o), math.sin(theta_o)
    a, b = cos_o * np.cos(theta), sin_o * np.sin(theta)
    # The integral of max(a + b cos(phi), 0) over phi is 2 (a p + b sin(p)), positive up to p.
    up_to = np.arccos(np.clip(-a / np.maximum(b, 1e-300), -1.0, 1.0))
    facing = 2.0 * (a * up_to + b * np.sin(up_to))
    density = ggx(np.cos(theta), np.sin(theta) ** 2, alpha)
    masking = smith_ggx(np.array([cos_o]), np.array([sin_o**2]), alpha)[0]
    assert masking / cos_o * (density * facing * np.sin(theta) * weight).sum() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("a", [0.05, 0.4, 1.0, 1.59, 1.61, 10.0])
def test_smith_beckmann_against_erf(a):
    # The exact form is 2 / (1 + erf(a) + exp(-a^2) / (a sqrt(pi))); Walter's fit is within 0.35 % of it.
    cosine = a / math.hypot(a, 1.0)  # alpha = 1: a = cos / sin
    exact = 2.0 / (1.0 + math.erf(a) + math.exp(-(a**2)) / (a * math.sqrt(math.pi)))
    fitted = smith_beckmann(np.array([cosine]), np.array([1.0 - cosine**2]), 1.0)[0]
    assert fitted == pytest.approx(exact, rel=3.5e-3)


@pytest.mark.parametrize("masking", [smith_ggx, smith_beckmann])
def test_masking_ends(masking):
    # Nothing is masked head-on; at the horizon everything is.
    assert masking(np.array([1.0, 0.0]), np.array([0.0, 1.0]), 0.3) == pytest.approx([1.0, 0.0])


def test_v_groove():
    # Head-on nothing is masked; nor is the mirrored direction, where n.h = 1 and o.h = n.o. A tilted half vector masks:
    # 2 * 0.6 * 0.2 / 0.8 = 0.3.
    values = v_groove(
        np.array([1.0, 1.0, 0.6]), np.array([1.0, 0.2, 0.2]), np.array([1.0, 0.2, 0.9]), np.array([1.0, 0.2, 0.8])
    )
    assert values == pytest.approx([1.0, 1.0, 0.3])


@pytest.mark.parametrize("exponent", [0.0, 0.3, 1.0, 1e3, 1e6])
def test_cosine_power(exponent):
    # Against logarithms in extended precision; n = 0 is 1 everywhere, the horizon included (0 ** 0 = 1).
    theta = np.concatenate([np.geomspace(1e-5, 1.0, 40), [1.3, 1.5]])
    expected = np.exp(np.longdouble(exponent) * np.log(np.cos(theta.astype(np.longdouble)))).astype(float)
    assert cosine_power(np.cos(theta), np.sin(theta) ** 2, exponent) == pytest.approx(expected, rel=1e-9, abs=1e-280)
    end = cosine_power(np.array([0.0, 6e-17]), np.array([1.0, 1.0]), exponent)
    assert end == pytest.approx([1.0, 1.0] if exponent == 0.0 else [0.0, 0.0], abs=2e-5)


def test_cosine_power_in_single_precision():
    # Exponent a million at theta = 1e-3: about exp(-n theta^2 / 2); through a rounded cosine it is 1.9 % off.
    theta = np.float32(1e-3)
    value = cosine_power(np.cos(theta), np.sin(theta) ** 2, 1e6)
    assert float(value) == pytest.approx(math.exp(1e6 * math.log(math.cos(float(theta)))), rel=1e-6)


def test_opposite_directions_have_a_half_vector():
    # wi = -wo: the normal; and no division by zero.
    wi = np.array([[1.0, 0.0, 0.0], [0.6, 0.0, 0.8]])
    found = directions(wi, -wi)
    assert found.cos_h.tolist() == [1.0, 1.0]
    assert not found.above.any()
    assert (found.cos_d > 0.0).all()


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
