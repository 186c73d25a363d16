"""Band means against closed forms: constants, ramps, powers, steps, and spikes far narrower than a band."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from engine.curve.bands import band_means
from engine.curve.operators import Operator, Tabulated, apply_operators
from engine.curve.wavelet import BandCountError
from engine.material.microfacet import cosine_power, ggx
from tests.naive import curves

HALF_PI = math.pi / 2
SIZES = [1, 2, 16, 128, 512]


def grey(function):
    return lambda gamma: np.repeat(function(gamma)[:, None], 3, axis=1)


def means_of(antiderivative, n_bands):
    edges = np.linspace(0.0, HALF_PI, n_bands + 1)
    return np.diff(antiderivative(edges)) * n_bands / HALF_PI


@pytest.mark.parametrize("n_bands", SIZES)
@pytest.mark.parametrize("value", [0.0, 1.0, 1e8, -3.0])
def test_constant(n_bands, value):
    # The mean of a constant is the constant.
    means = band_means(grey(lambda gamma: np.full_like(gamma, value)), n_bands)
    assert means.shape == (n_bands, 3)
    assert means == pytest.approx(np.full((n_bands, 3), value), rel=1e-13, abs=0.0)


@pytest.mark.parametrize("n_bands", SIZES)
def test_cosine(n_bands):
    # The integral of cos is sin.
    means = band_means(grey(np.cos), n_bands)
    assert means[:, 0] == pytest.approx(means_of(np.sin, n_bands), rel=1e-9)


@pytest.mark.parametrize("alpha", [1e-4, 1e-3, 0.02, 0.3, 1.0])
@pytest.mark.parametrize("n_bands", SIZES)
def test_spike(n_bands, alpha):
    # D = a^2 / (pi (a^2 cos^2 + sin^2)^2) with a = alpha; by t = tan its integral is that of
    # a^2 (1 + t^2) / (pi (a^2 + t^2)^2) dt, that is (arctan(t/a) (1 + a^2)/a + t (1 - a^2)/(a^2 + t^2)) / (2 pi).
    def antiderivative(gamma):
        t = np.tan(np.minimum(gamma, HALF_PI - 1e-15))
        first = np.arctan(t / alpha) * (1.0 + alpha**2) / alpha
        return (first + t * (1.0 - alpha**2) / (alpha**2 + t**2)) / (2.0 * math.pi)

    means = band_means(grey(lambda gamma: ggx(np.cos(gamma), np.sin(gamma) ** 2, alpha)), n_bands)[:, 0]
    expected = means_of(antiderivative, n_bands)
    assert means.sum() == pytest.approx((1.0 + alpha**2) / (4.0 * alpha) * n_bands / HALF_PI, rel=1e-6)
    assert means == pytest.approx(expected, rel=1e-5, abs=1e-9 * expected.max())


@pytest.mark.parametrize("exponent", [0.5, 1e3, 1e6])
def test_cosine_power(exponent):
    # The integral of cos^n over [0, pi/2] is sqrt(pi) Gamma((n+1)/2) / (2 Gamma(n/2 + 1)).
    total = 0.5 * math.sqrt(math.pi) * math.exp(math.lgamma((exponent + 1) / 2) - math.lgamma(exponent / 2 + 1))
    means = band_means(grey(lambda gamma: cosine_power(np.cos(gamma), np.sin(gamma) ** 2, exponent)), 128)[:, 0]
    assert means.sum() * HALF_PI / 128 == pytest.approx(total, rel=1e-6)


@dataclass(frozen=True)
class Step:
    """`height` to the right of `at`; says where it jumps only when `announced`."""

    at: float
    height: float
    announced: bool

    def __call__(self, gamma):
        return np.repeat(np.where(gamma >= self.at, self.height, 0.0)[:, None], 3, axis=1)

    @property
    def features(self):
        return (self.at,) if self.announced else ()


@pytest.mark.parametrize("announced", [True, False])
@pytest.mark.parametrize("n_bands", SIZES)
def test_step_of_1e8(n_bands, announced):
    # A band's mean is the height times the share of the band to the right of the step.
    step = Step(0.7123, 1e8, announced)
    edges = np.linspace(0.0, HALF_PI, n_bands + 1)
    share = np.clip((edges[1:] - step.at) * n_bands / HALF_PI, 0.0, 1.0)
    assert band_means(step, n_bands)[:, 1] == pytest.approx(share * 1e8, rel=1e-12, abs=1e-4 if announced else 2e3)


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-6])
def test_plateau_between_steps(width):
    # A plateau with zero-width falloffs contributes its area, however narrow: width times height.
    operator = Operator("translate", "y", 0.9, 0.9, 0.9 + width, 0.9 + width, magnitude=7.0)
    curve = apply_operators([operator], grey(np.zeros_like))
    assert band_means(curve, 128).sum(axis=0) * HALF_PI / 128 == pytest.approx(np.full(3, 7.0 * width), rel=1e-9)


def test_table():
    # A narrow tent of height 5 in a table has the area of a triangle.
    table = Tabulated((0.0, 1.0, 1.0005, 1.001, HALF_PI), tuple((v, v, v) for v in (0.0, 0.0, 5.0, 0.0, 0.0)))
    curve = apply_operators([table], grey(np.ones_like))
    assert band_means(curve, 16).sum(axis=0) * HALF_PI / 16 == pytest.approx(np.full(3, 0.0025), rel=1e-9)


def test_operators_against_midpoints():
    # The twin sums 20,000 midpoints a band; channels differ.
    stack = [
        Operator("amplify", "y", 0.1, 0.3, 0.5, 0.8, magnitude=3.0, baseline=0.2, channels=(True, False, True)),
        Operator("translate", "x", 0.2, 0.5, 0.6, 1.1, magnitude=0.1, channels=(False, True, True)),
        Operator("amplify", "x", 0.0, 0.0, 1.0, 1.4, magnitude=1.2),
    ]
    curve = apply_operators(stack, grey(lambda gamma: np.cos(gamma) ** 40))
    assert band_means(curve, 16) == pytest.approx(curves.band_means(curve, 16), rel=1e-6, abs=1e-8)


def test_other_counts_are_refused():
    with pytest.raises(BandCountError, match="number of bands = 12"):
        band_means(grey(np.cos), 12)


@pytest.mark.parametrize("alpha", [1e-4, 1e-2, 0.3])
@pytest.mark.parametrize("n_bands", [1, 8, 128, 512])
def test_solid_angle_keeps_the_energy_of_a_lobe(n_bands, alpha):
    # Σ_j c_j (cos γ_j - cos γ_j+1) is the integral of D sinγ: with b² = 1 - α² it is (1/2 + α² artanh(b) / 2b) / π.
    def lobe(gamma):
        return np.repeat(ggx(np.cos(gamma), np.sin(gamma) ** 2, alpha)[:, None], 3, axis=1)

    means = band_means(lobe, n_bands, by_solid_angle=True)
    edges = np.linspace(0.0, math.pi / 2, n_bands + 1)
    b = math.sqrt(1.0 - alpha**2)
    expected = (0.5 + alpha**2 * math.atanh(b) / (2 * b)) / math.pi
    assert (means * -np.diff(np.cos(edges))[:, None]).sum(axis=0) == pytest.approx(np.full(3, expected), rel=1e-5)


def test_solid_angle_leaves_a_constant_alone():
    means = band_means(lambda gamma: np.full((len(gamma), 3), 2.5), 64, by_solid_angle=True)
    assert means == pytest.approx(np.full((64, 3), 2.5), rel=1e-12)
