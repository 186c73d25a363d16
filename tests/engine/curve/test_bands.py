"""Band values against closed forms: constants, ramps, preserved integrals, steps, and spikes narrower than a band."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.curve.bands import band_nodes, band_values, band_weights
from engine.curve.operators import Operator, TabulatedCurve, apply_operators
from engine.curve.wavelet import BandCountError
from engine.material.microfacet import cosine_power, ggx
from tests.naive import curves

HALF_PI = math.pi / 2
SIZES = [1, 2, 16, 128, 512]


def grey(function):
    return lambda gamma: np.repeat(function(gamma)[:, None], 3, axis=1)


def integral(values, by_solid_angle=False):
    return band_weights(len(values), by_solid_angle=by_solid_angle) @ values


@pytest.mark.parametrize("by_solid_angle", [False, True])
@pytest.mark.parametrize("n_bands", SIZES)
@pytest.mark.parametrize("value", [0.0, 1.0, 1e8, -3.0])
def test_constant(n_bands, value, by_solid_angle):
    # A constant is one of the curves that hats can make.
    values = band_values(grey(lambda gamma: np.full_like(gamma, value)), n_bands, by_solid_angle=by_solid_angle)
    assert values.shape == (n_bands, 3)
    assert values == pytest.approx(np.full((n_bands, 3), value), rel=1e-11, abs=0.0)


@pytest.mark.parametrize("by_solid_angle", [False, True])
@pytest.mark.parametrize("n_bands", [2, 16, 128])
def test_a_piecewise_linear_curve_is_kept_as_it_is(n_bands, by_solid_angle):
    # Linear between the nodes, constant beyond them: the fit is the curve.
    expected = np.random.default_rng(n_bands).random((n_bands, 3))
    nodes = band_nodes(n_bands)
    curve = TabulatedCurve((0.0, *nodes, HALF_PI), tuple(map(tuple, expected[[0, *range(n_bands), -1]])))
    values = band_values(apply_operators([curve], grey(np.ones_like)), n_bands, by_solid_angle=by_solid_angle)
    assert values == pytest.approx(expected, rel=0, abs=1e-8)


@pytest.mark.parametrize("n_bands", SIZES)
def test_the_weights_are_the_integrals_of_the_hats(n_bands):
    # Inner hats have the area h, the two at the ends h + h/8 - that of half a band before or after, h/2, of half a
    # triangle, h/2: the same. By solid angle all of them make ∫ sin = 1.
    assert band_weights(n_bands) == pytest.approx(np.full(n_bands, HALF_PI / n_bands), rel=1e-12)
    assert band_weights(n_bands, by_solid_angle=True).sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("n_bands", SIZES)
def test_cosine(n_bands):
    # The integral of cos is 1; hats of width h leave a curve by about h²/12 of its second derivative, but for the last
    # few, which make up for the flat end where cos falls fastest.
    values = band_values(grey(np.cos), n_bands)[:, 0]
    h = HALF_PI / n_bands
    assert band_weights(n_bands) @ values == pytest.approx(1.0, rel=1e-9)
    if n_bands >= 16:
        assert values[8:-8] == pytest.approx(np.cos(band_nodes(n_bands))[8:-8], rel=0, abs=0.1 * h * h)


@pytest.mark.parametrize("by_solid_angle", [False, True])
@pytest.mark.parametrize("alpha", [1e-4, 1e-3, 0.02, 0.3, 1.0])
@pytest.mark.parametrize("n_bands", SIZES)
def test_a_lobe_keeps_its_energy(n_bands, alpha, by_solid_angle):
    # D = a² / (π (a² cos² + sin²)²) with a = alpha: by t = tan its integral is (1 + a²) / 4a, and that of D sin, with
    # b² = 1 - a², (1/2 + a² artanh(b) / 2b) / π. However narrow the lobe, it reflects what it should.
    lobe = grey(lambda gamma: ggx(np.cos(gamma), np.sin(gamma) ** 2, alpha))
    values = band_values(lobe, n_bands, by_solid_angle=by_solid_angle)
    b = math.sqrt(1.0 - alpha**2)
    towards = alpha**2 * math.atanh(b) / (2 * b) if b > 0.0 else 0.5
    expected = (0.5 + towards) / math.pi if by_solid_angle else (1.0 + alpha**2) / (4.0 * alpha)
    assert integral(values, by_solid_angle) == pytest.approx(np.full(3, expected), rel=2e-3)
    assert values.min() >= 0.0


@pytest.mark.parametrize("exponent", [0.5, 1e3, 1e6])
def test_cosine_power(exponent):
    # The integral of cos^n over [0, pi/2] is sqrt(pi) Gamma((n+1)/2) / (2 Gamma(n/2 + 1)).
    total = 0.5 * math.sqrt(math.pi) * math.exp(math.lgamma((exponent + 1) / 2) - math.lgamma(exponent / 2 + 1))
    values = band_values(grey(lambda gamma: cosine_power(np.cos(gamma), np.sin(gamma) ** 2, exponent)), 128)
    assert integral(values) == pytest.approx(np.full(3, total), rel=2e-3)


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
    # It keeps its area and its range, and is the curve itself but for the six bands beside the step.
    step = Step(0.7123, 1e8, announced)
    values = band_values(step, n_bands)
    assert integral(values) == pytest.approx(np.full(3, (HALF_PI - 0.7123) * 1e8), rel=3e-3)
    assert values.min() >= 0.0 and values.max() <= 1e8
    away = np.abs(band_nodes(n_bands) - step.at) > 6 * HALF_PI / n_bands
    assert values[away] == pytest.approx(step(band_nodes(n_bands))[away], rel=0, abs=2e5)


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-6])
def test_plateau_between_steps(width):
    # A plateau with zero-width falloffs contributes its area, however narrow: width times height.
    operator = Operator("translate", "y", 0.9, 0.9, 0.9 + width, 0.9 + width, magnitude=7.0)
    curve = apply_operators([operator], grey(np.zeros_like))
    assert integral(band_values(curve, 128)) == pytest.approx(np.full(3, 7.0 * width), rel=2e-3)


def test_table():
    # A narrow tent of height 5 in a table has the area of a triangle.
    table = TabulatedCurve((0.0, 1.0, 1.0005, 1.001, HALF_PI), tuple((v, v, v) for v in (0.0, 0.0, 5.0, 0.0, 0.0)))
    curve = apply_operators([table], grey(np.ones_like))
    assert integral(band_values(curve, 16)) == pytest.approx(np.full(3, 0.0025), rel=2e-3)


@pytest.mark.parametrize("by_solid_angle", [False, True])
@pytest.mark.parametrize("n_bands", [32, 64])
def test_operators_against_least_squares(n_bands, by_solid_angle):
    # The twin fits the hats to 400 midpoints a band and knows no bounds, which a smooth curve hardly meets.
    stack = [
        Operator("amplify", "y", 0.1, 0.3, 0.5, 0.8, magnitude=3.0, baseline=0.2, channels=(True, False, True)),
        Operator("translate", "x", 0.2, 0.5, 0.6, 1.1, magnitude=0.1, channels=(False, True, True)),
        Operator("amplify", "x", 0.0, 0.0, 1.0, 1.4, magnitude=1.2),
    ]
    curve = apply_operators(stack, grey(lambda gamma: 0.3 + np.cos(gamma) ** 10))
    expected = curves.band_values(curve, n_bands, by_solid_angle=by_solid_angle)
    assert expected.min() > 0.0
    assert band_values(curve, n_bands, by_solid_angle=by_solid_angle) == pytest.approx(expected, rel=0.015)


def test_nothing_pops_while_a_step_moves():
    # From one node to the next in 400 moves no value changes by more than a few percent of the step at once; the most
    # where the step leaves a hat, whose value then is that of the plateau.
    moves = np.linspace(0.5, 0.5 + HALF_PI / 32, 401)
    values = np.array([band_values(Step(at, 1.0, True), 32, by_solid_angle=True)[:, 0] for at in moves])
    assert np.abs(np.diff(values, axis=0)).max() < 0.08


@settings(deadline=None, max_examples=60, derandomize=True)
@given(
    n_bands=st.sampled_from([1, 2, 4, 16, 64]),
    begin=st.floats(0.0, 1.5),
    width=st.floats(0.0, 1.5),
    height=st.floats(0.0, 1e6),
    by_solid_angle=st.booleans(),
)
def test_a_plateau_keeps_its_range_and_its_energy(n_bands, begin, width, height, by_solid_angle):
    operator = Operator("translate", "y", begin, begin, begin + width, begin + width, magnitude=height)
    curve = apply_operators([operator], grey(np.zeros_like))
    values = band_values(curve, n_bands, by_solid_angle=by_solid_angle)
    end = min(begin + width, HALF_PI)
    area = math.cos(begin) - math.cos(end) if by_solid_angle else end - begin
    assert values.min() >= 0.0 and values.max() <= height
    assert integral(values, by_solid_angle) == pytest.approx(np.full(3, height * area), rel=3e-3, abs=1e-9 * height)


def test_other_counts_are_refused():
    with pytest.raises(BandCountError, match="number of bands = 12"):
        band_values(grey(np.cos), 12)


@pytest.mark.parametrize("by_solid_angle", [False, True])
def test_values_below_the_normal_range_beside_others_stay_numbers(by_solid_angle: bool) -> None:
    generator = np.random.default_rng(7)
    for n_bands in (1, 2, 16, 64, 128):
        for _ in range(12):
            steps = np.sort(generator.uniform(0.0, HALF_PI, 4))
            heights = 10.0 ** generator.choice([-323, -320, -310, -300, -150, 0, 3], (5, 3))
            values = band_values(partial(stairs, steps, heights), n_bands, by_solid_angle=by_solid_angle)
            assert np.isfinite(values).all() and values.max() <= heights.max() and values.min() >= 0.0


def stairs(steps: np.ndarray, heights: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    return heights[np.searchsorted(steps, gamma)]
