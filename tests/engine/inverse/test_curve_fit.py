"""The change of a curve that pixels ask for: against the answer that made them, and scipy's dense solver as slow
twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from engine.curve.bands import band_nodes
from engine.inverse.curve_fit import (
    HOLDING,
    SMOOTHNESS,
    curve_size,
    fit_change,
    normal_equations,
    radiance_weights,
    roughness_matrix,
)

N_BANDS = 16


def lobe_rows(n, seed=0, width=0.05):
    """Rows (J, n, 3) of pixels that each see the curve about one angle."""
    rng = np.random.default_rng(seed)
    nodes, at = band_nodes(N_BANDS), rng.uniform(0.0, 1.5, n)
    seen = np.exp(-(((nodes[:, None] - at) / width) ** 2))
    return seen[:, :, None] * rng.uniform(0.5, 1.5, (1, n, 3))


def falling_curve(steepness=6.0, height=8.0):
    return np.repeat(height * np.exp(-steepness * band_nodes(N_BANDS))[:, None], 3, axis=1) * (1.0, 0.8, 0.5)


def equations_of(rows, missing, seen):
    return normal_equations(rows, missing, radiance_weights(seen))


def test_the_curve_that_made_the_pixels_is_found():
    rows, before, after = lobe_rows(400), falling_curve(), falling_curve(4.0, 5.0)
    missing = np.einsum("jnc,jc->nc", rows, after - before)
    fit = fit_change(equations_of(rows, missing, np.einsum("jnc,jc->nc", rows, after)), before, smoothness=1e-9)
    assert before + fit.change == pytest.approx(after, rel=1e-3)


def test_it_is_the_minimum_that_a_dense_solver_finds():
    # Pixels want more than nothing taken away: the bound holds at many bands.
    rows, curve = lobe_rows(60, seed=1), falling_curve()
    rng = np.random.default_rng(2)
    missing, weights = rng.normal(0.0, 3.0, (60, 3)), rng.uniform(0.5, 2.0, (60, 3))
    held_rows = lobe_rows(30, seed=3)
    held = normal_equations(held_rows, np.zeros((30, 3)), np.ones(30))
    fit = fit_change(normal_equations(rows, missing, weights), curve, held)
    size = curve_size(curve)
    for c in range(3):
        a = np.concatenate([
            np.sqrt(weights[:, c])[:, None] * rows[:, :, c].T,
            np.sqrt(HOLDING * 60 / 30) * held_rows[:, :, c].T,
        ]) * size[:, c]  # fmt: skip
        stiff = np.sqrt(SMOOTHNESS * np.mean(np.sum(a * a, axis=0)))
        rough = np.linalg.cholesky(roughness_matrix([N_BANDS])).T
        b = np.concatenate([np.sqrt(weights[:, c]) * missing[:, c], np.zeros(30 + N_BANDS)])
        twin = lsq_linear(np.concatenate([a, stiff * rough]), b, (-curve[:, c] / size[:, c], np.inf), tol=1e-14)
        assert fit.change[:, c] / size[:, c] == pytest.approx(twin.x, abs=1e-5 * max(np.abs(twin.x).max(), 1.0))
    assert (curve + fit.change >= -1e-12 * size).all() and (curve + fit.change < 1e-9).any()


def test_bands_that_no_pixel_sees_stay():
    rows, curve = lobe_rows(200), falling_curve()
    low = band_nodes(N_BANDS) < 0.5
    rows[~low] = 0.0
    missing = 0.5 * np.einsum("jnc,jc->nc", rows, curve)
    fit = fit_change(equations_of(rows, missing, missing), curve)
    assert fit.change[low][:-1] == pytest.approx(0.5 * curve[low][:-1], rel=0.05)
    assert (np.abs(fit.change[-3:]) < 0.1 * curve[-3:]).all()
    # And the fit says so: what is not seen is as uncertain as the curve is large.
    assert (fit.deviation[-3:] > 0.5 * curve_size(curve)[-3:]).all()
    assert (fit.deviation[low][:-1] < 0.1 * curve[low][:-1]).all()


def test_held_pixels_hold():
    rows, curve, everywhere = lobe_rows(20), falling_curve(), lobe_rows(500, seed=5)
    missing = np.einsum("jnc,jc->nc", rows, curve)
    held = equations_of(everywhere, np.zeros((500, 3)), np.einsum("jnc,jc->nc", everywhere, curve))
    free, holding = (fit_change(equations_of(rows, missing, missing), curve, held, holding=h) for h in (0.0, 10.0))
    of_others = [np.abs(np.einsum("jnc,jc->nc", everywhere, fit.change)).sum() for fit in (free, holding)]
    assert of_others[1] < 0.5 * of_others[0]


def test_pixels_may_come_in_parts():
    rows, missing, weights = lobe_rows(9000), np.ones((9000, 3)), np.ones(9000)
    whole = normal_equations(rows, missing, weights)
    parts = normal_equations(rows[:, :777], missing[:777], weights[:777]) + normal_equations(
        rows[:, 777:], missing[777:], weights[777:]
    )
    assert parts.gram == pytest.approx(whole.gram) and parts.moments == pytest.approx(whole.moments)


def test_channels_do_not_mix():
    rows, curve = lobe_rows(100), falling_curve()
    missing = np.zeros((100, 3))
    missing[:, 1] = rows[:, :, 1].sum(axis=0)
    fit = fit_change(equations_of(rows, missing, np.ones((100, 3))), curve)
    assert not fit.change[:, (0, 2)].any() and fit.change[:, 1].any()


def test_a_change_in_grey_keeps_the_hues_of_a_curve():
    rows, curve = lobe_rows(200), falling_curve()
    missing = np.einsum("jnc,jc->nc", rows, curve) * (0.5, 0.4, 0.3)
    fit = fit_change(equations_of(rows, missing, missing), curve, in_grey=True)
    after = curve + fit.change
    assert after / after[:, :1] == pytest.approx(curve / curve[:, :1])
    middle = slice(0, 10)
    assert (after / curve)[middle].mean() == pytest.approx(1.4, abs=0.06)
    # A channel that is missing in some bands, or in all, does not keep the others from falling.
    for some in (slice(None), slice(3, 6)):
        without = curve.copy()
        without[some, 2] = 0.0
        seen = np.einsum("jnc,jc->nc", rows, without)
        halved = fit_change(equations_of(rows, -0.5 * seen, seen), without, in_grey=True)
        assert (without + halved.change)[middle] == pytest.approx(0.5 * without[middle], rel=0.15, abs=1e-4)
    dark = fit_change(equations_of(rows, -10.0 * missing, missing), curve, in_grey=True)
    assert (curve + dark.change >= -1e-9).all()


@settings(deadline=None, max_examples=60)
@given(
    unit=st.sampled_from([1e-30, 1e-12, 1.0, 1e12, 1e30]), height=st.sampled_from([0.0, 1e-9, 1.0, 1e9]),
    n=st.integers(0, 5), wanted=st.sampled_from([-1.0, 0.0, 1.0, 1e6, np.inf, np.nan]), dark=st.booleans(),
)  # fmt: skip
def test_extremes_are_finite_and_not_negative(unit, height, n, wanted, dark):
    curve = falling_curve(height=height)
    rows = lobe_rows(n) * (0.0 if dark else unit)
    fit = fit_change(equations_of(rows, np.full((n, 3), wanted * unit), np.full((n, 3), unit)), curve)
    assert np.isfinite(fit.change).all() and np.isfinite(fit.deviation).all()
    assert (curve + fit.change >= -1e-9 * curve_size(curve)).all()
    if dark or not n:
        assert not fit.change.any()


def test_the_unit_of_light_does_not_matter():
    rows, curve = lobe_rows(50), falling_curve()
    missing = np.einsum("jnc,jc->nc", rows, 0.3 * curve)
    fits = [fit_change(equations_of(rows * u, missing * u, missing * u), curve).change for u in (1.0, 1e-20, 1e20)]
    assert fits[1] == pytest.approx(fits[0], rel=1e-6) and fits[2] == pytest.approx(fits[0], rel=1e-6)


def test_no_pixels_are_no_equations():
    assert not fit_change(normal_equations(lobe_rows(0), np.zeros((0, 3)), np.ones(0)), falling_curve()).change.any()


@pytest.mark.parametrize("noise", [0.1, 1.0, 3.0])
def test_what_no_pixel_sees_is_as_uncertain_as_the_curve_is_large(noise):
    """However precise pixels are: bands of the second half have no light."""
    rows = lobe_rows(200, seed=5)
    rows[N_BANDS // 2 :] = 0.0
    curve = np.linspace(2.0, 1.0, N_BANDS)[:, None] * np.array([1.0, 0.5, 2.0])
    weights = radiance_weights(np.einsum("jnc,jc->nc", rows, curve))
    fit = fit_change(normal_equations(rows, np.zeros((200, 3)), weights), curve, prior=1.0, noise=noise)
    relative = fit.deviation / curve
    assert relative[-3:] == pytest.approx(1.0, abs=0.35) and relative.max() <= 1.0
    assert relative[: N_BANDS // 2 - 2].max() < 0.25 * max(noise, 0.3)
