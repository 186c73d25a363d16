"""The curves of a layer from its pixels: one is found where it made them, both make a picture that neither could."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine.curve.bands import band_nodes
from engine.inverse.curve_fit import SCALE, radiance_weights
from engine.inverse.layer_fit import HeldPixels, LayerPixels, fit_layers
from tests.engine.precompute.direct.test_bandstore import store_of

N_A, N_B, N = 16, 8, 400


def curves(n_b=N_B, fall=4.0):
    a = np.exp(-fall * band_nodes(N_A))[:, None] * (3.0, 2.0, 1.0)
    return {"a": a, "b": (0.4 + band_nodes(n_b))[:, None] * np.ones(3)} if n_b > 1 else {"a": a}


def pixels(seed=0, n=N, n_b=N_B):
    """Each pixel sees both curves about one place: positive bands, dense in A and B."""
    rng = np.random.default_rng(seed)
    a, b = band_nodes(N_A), band_nodes(n_b)
    seen_a = np.exp(-(((a - rng.uniform(0, 1.5, (n, 1))) / 0.1) ** 2))
    seen_b = np.exp(-(((b - rng.uniform(0, 1.5, (n, 1))) / 0.4) ** 2)) if n_b > 1 else np.ones((n, 1))
    dense = (seen_a[:, :, None] * seen_b[:, None, :])[..., None] * rng.uniform(0.5, 1.5, (n, 1, 1, 3))
    return LayerPixels(store_of(dense, chunk=64), rng.uniform(0.5, 2.0, (n, 3)), curves(n_b))


def radiance(some, both):
    a, *b = both.values()
    return some.store.radiance(a, b[0] if b else np.ones((1, 3))) * some.view


def test_rows_sum_to_the_picture():
    some, both = pixels(), curves()
    for name in ("a", "b"):
        assert np.einsum("jnc,jc->nc", some.rows(name, {}), both[name]) == pytest.approx(radiance(some, both), rel=1e-3)


def test_indirect_rows_are_added():
    some = pixels()
    more = replace(some, indirect={"a": np.ones((N_A, N, 3), np.float32)})
    assert more.rows("a", {}) == pytest.approx(some.rows("a", {}) + 1.0)
    assert (more.rows("b", {}) == some.rows("b", {})).all()


@pytest.mark.parametrize("n_b", [1, N_B])
def test_one_curve_is_found(n_b):
    some, before = pixels(n_b=n_b), curves(n_b)
    wanted = {**before, "a": curves(fall=2.5)["a"]}
    target = radiance(some, wanted)
    missing = target - radiance(some, before)
    found = fit_layers([some], ["a"], missing, radiance_weights(target), smoothness=1e-8)
    after = {**before, "a": before["a"] + found.fits["a"].change}
    assert after["a"] == pytest.approx(wanted["a"], rel=0.02)
    assert found.left == pytest.approx(target - radiance(some, after), abs=2e-3 * target.max())


def test_both_curves_make_what_neither_could():
    some, before = pixels(), curves()
    wanted = {"a": curves(fall=2.5)["a"], "b": before["b"][::-1].copy()}
    target = radiance(some, wanted)
    missing, weights = target - radiance(some, before), radiance_weights(target)

    def left(*names):
        return np.sqrt(np.mean(weights * fit_layers([some], names, missing, weights, smoothness=1e-8).left ** 2))

    assert left("a", "b") < 0.1 * min(left("a"), left("b"))


def test_layers_that_share_a_curve_are_seen_together():
    # A layer and its Fresnel term: each pixel shows the sum, which one layer alone would need twice the change for.
    some, other, before = pixels(), pixels(seed=5), curves()
    wanted = {**before, "a": curves(fall=2.5)["a"]}
    target = radiance(some, wanted) + radiance(other, wanted)
    missing = target - radiance(some, before) - radiance(other, before)
    found = fit_layers([some, other], ["a"], missing, radiance_weights(target), smoothness=1e-8)
    assert before["a"] + found.fits["a"].change == pytest.approx(wanted["a"], rel=0.02)


def test_the_scale_of_a_layer_is_found_alone_and_beside_a_curve():
    some, before = pixels(), curves()
    factors = np.array([2.0, 0.5, 1.0])
    target = radiance(some, before) * factors
    found = fit_layers([some], [SCALE], target - radiance(some, before), radiance_weights(target))
    assert 1.0 + found.fits[SCALE].change[0] == pytest.approx(factors, rel=1e-4)
    other = replace(pixels(seed=5), is_scaled=False)
    alone = fit_layers([some, other], [SCALE], target - radiance(some, before), radiance_weights(target))
    assert alone.fits[SCALE].change == pytest.approx(found.fits[SCALE].change, rel=1e-4)
    wanted = {**before, "a": curves(fall=2.5)["a"]}
    target = radiance(some, wanted) * factors
    both = fit_layers([some], ["a", SCALE], target - radiance(some, before), radiance_weights(target), smoothness=1e-8)
    after = (before["a"] + both.fits["a"].change) * (1.0 + both.fits[SCALE].change)
    assert after == pytest.approx(wanted["a"] * factors, rel=0.03)


def test_held_pixels_keep_their_radiance_when_both_curves_change():
    some, others, before = pixels(n=20), pixels(seed=1), curves()
    seen, of_held = radiance(some, before), radiance_weights(radiance(others, before))
    held = HeldPixels([others], of_held)

    def changed(holding):
        found = fit_layers([some], ["a", "b"], seen, radiance_weights(seen), held, holding=holding)
        after = {name: before[name] + fit.change for name, fit in found.fits.items()}
        return np.mean(of_held * (radiance(others, after) - radiance(others, before)) ** 2)

    assert changed(10.0) < 0.3 * changed(1e-6)


def test_some_points_of_a_store_are_those_points():
    some, (a, b) = pixels(), curves().values()
    chosen = np.unique(np.random.default_rng(3).integers(0, N, 50))
    assert (some.store.take(chosen).radiance(a, b) == some.store.radiance(a, b)[chosen]).all()
    assert some.store.take(chosen[:0]).radiance(a, b).shape == (0, 3)
