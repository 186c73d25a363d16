"""Layers that are brought near to another BRDF: to themselves, to what their curves can become, and to other models."""

from __future__ import annotations

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.curve.operators import Operator
from engine.inverse.brdf_fit import LayerSamples, match_layer, sample_directions
from engine.inverse.curve_fit import SCALE
from engine.material import MODELS
from engine.material.layer import evaluate_by_curves, evaluate_layer, make_layer


def reflectance(layer):
    return lambda wi, wo: evaluate_layer(layer, wi, wo)


def layer_of(model, **parameters):
    return make_layer(MODELS[model], parameters)


def matched(*arguments):
    return run_to_end(match_layer(*arguments))


METAL = layer_of("rough_conductor", alpha=0.3)


@pytest.mark.parametrize("model", ["rough_conductor", "blinn_phong", "phong", "ward", "ashikhmin_shirley", "lambert"])
def test_rows_are_those_of_the_brdf(model):
    layer = layer_of(model)
    wi, wo, _ = (each[::7] for each in sample_directions())
    curves = {factor.name: layer.coefficients(factor.name, 256) for factor in layer.model.factors}
    samples, truth = LayerSamples(layer, wi, wo, curves), layer.scale() * evaluate_by_curves(layer, wi, wo)
    for name in curves:
        value = np.einsum("jnc,jc->nc", samples.rows(name, {}), curves[name])
        assert np.linalg.norm(value - truth) < 0.02 * np.linalg.norm(truth)
    twice = {SCALE: np.full((1, 3), 2.0)}
    one, *_ = curves
    assert samples.rows(SCALE, twice) == pytest.approx(samples.rows(SCALE, {}))  # for a scale of 1
    assert samples.rows(one, twice) == pytest.approx(2.0 * samples.rows(one, {}))


def test_a_layer_matches_itself_without_an_operator_of_any_size():
    found = matched(reflectance(METAL), METAL, ["theta_h"])
    assert found.before == 0.0 and found.error < 0.02
    wi, wo, _ = sample_directions()
    before, after = (evaluate_layer(each, wi, wo) for each in (METAL, found.layer))
    assert np.linalg.norm(after - before) < 0.03 * np.linalg.norm(before)


def test_an_edited_curve_is_found():
    edited = METAL.with_operators("theta_h", [Operator("amplify", "y", 0.2, 0.4, 0.7, 1.0, magnitude=5.0)])
    found = matched(reflectance(edited), METAL, ["theta_h"])
    assert found.error < 0.03 < 0.3 < found.before
    curve, truth = (each.coefficients("theta_h", 64) for each in (found.layer, edited))
    assert np.linalg.norm(curve - truth) < 0.03 * np.linalg.norm(truth)
    assert len(found.layer.operators("theta_h")) == 1


def test_another_model_is_approached_and_its_roughness_searched_for():
    # Beckmann's facets by GGX's quotient: the curve gives the distribution, the search Smith's term.
    target = reflectance(layer_of("rough_conductor", alpha=0.35, distribution="beckmann"))
    start = layer_of("rough_conductor", alpha=0.1, distribution="ggx")
    curve = matched(target, start, ["theta_h"])
    both = matched(target, start, ["theta_h"], ["alpha"])
    assert both.error <= curve.error < 0.5 * curve.before
    assert both.error < 0.05 and 0.12 < both.layer.values["alpha"] < 0.6


def test_a_colour_comes_with_the_curve():
    found = run_to_end(
        match_layer(reflectance(layer_of("lambert", albedo=[0.6, 0.3, 0.1])), layer_of("lambert"), ["theta_i"])
    )
    assert found.error < 0.01
    wi, wo, _ = sample_directions()
    value = evaluate_layer(found.layer, wi, wo) / wi[:, 2:3]
    assert value.mean(axis=0) * np.pi == pytest.approx([0.6, 0.3, 0.1], rel=0.02)


def test_what_no_curve_can_do_is_said_by_the_error():
    # A diffuse model has no highlight: nothing of it comes near to polished metal.
    found = run_to_end(
        match_layer(reflectance(layer_of("rough_conductor", alpha=0.05)), layer_of("lambert"), ["theta_i"])
    )
    assert found.error > 0.3


def test_a_black_target_gives_a_black_layer():
    found = matched(lambda wi, wo: np.zeros((len(wi), 3)), METAL, ["theta_h"])
    wi, wo, _ = sample_directions()
    before, after = (evaluate_layer(each, wi, wo) for each in (METAL, found.layer))
    assert np.isfinite(found.error) and np.linalg.norm(after) < 1e-2 * np.linalg.norm(before)


def test_one_curve_for_two_angles_is_refused():
    with pytest.raises(InsituError, match="one curve for two angles"):
        matched(reflectance(METAL), layer_of("homomorphic"), ["theta_h"])


def test_one_huge_value_is_met_where_it_is_and_elsewhere_stays_finite():
    truth = reflectance(METAL)

    def target(wi, wo):
        value = truth(wi, wo)
        value[len(value) // 2] = 1e200
        return value

    found = matched(target, METAL, ["theta_h"])
    wi, wo, _ = sample_directions()
    assert np.isfinite(found.error) and np.isfinite(evaluate_layer(found.layer, wi, wo)).all()


def test_what_is_not_a_number_is_refused():
    with pytest.raises(InsituError, match="not finite"):
        matched(lambda wi, wo: np.full((len(wi), 3), np.nan), METAL, ["theta_h"])


def test_a_model_is_matched_with_itself_at_another_parameter():
    target = reflectance(layer_of("rough_conductor", alpha=0.35))
    found = matched(target, METAL, ["theta_h"], ["alpha"])
    assert found.error < 0.02 and found.layer.values["alpha"] == pytest.approx(0.35, rel=0.2)


def test_the_share_that_is_done_rises_to_the_end():
    shares = list(match_layer(reflectance(METAL), METAL, ["theta_h"], ["alpha"]))
    assert shares == sorted(shares) and shares[0] == 0.0 and 0.9 < shares[-1] < 1.0
