"""Layers are values: edits apply to generated curves, survive parameters, and enter band coefficients."""

import math
import pickle

import numpy as np
import pytest

from engine.curve.bands import band_weights
from engine.curve.operators import Operator
from engine.material import MODELS, ParameterError, make_layer
from engine.material.layer import evaluate_layer, evaluate_layers

GAMMA = np.linspace(0.0, math.pi / 2, 101)
LIFT = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=2.0)
SINK = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=-1e9)


@pytest.fixture
def copper():
    return make_layer(MODELS["rough_conductor"], {"alpha": 0.15}, "copper")


def test_a_layer_is_a_value(copper):
    # Equal, hashable, picklable, and unchanged by edits.
    edited = copper.with_operators("theta_h", [LIFT])
    assert copper.edits == () and edited.edits == (("theta_h", (LIFT,)),)
    assert edited == copper.with_operators("theta_h", [LIFT]) and hash(edited) == hash(
        pickle.loads(pickle.dumps(edited))
    )
    assert edited.with_operators("theta_h", []) == copper
    assert copper.replace(visible=False) != copper


def test_edits_survive_parameters(copper):
    # The operator sits on whatever alpha generates.
    for alpha in (0.1, 0.5):
        layer = copper.with_operators("theta_h", [LIFT]).with_parameter("alpha", alpha)
        difference = layer.curve("theta_h")(GAMMA) - layer.generated_curve("theta_h")(GAMMA)
        inside = (GAMMA >= 0.4) & (GAMMA <= 0.6)
        assert difference[inside] == pytest.approx(np.full((inside.sum(), 3), 2.0))


def test_order_of_edits_does_not_show(copper):
    # Two documents with the same edits are the same document, whatever was edited first.
    one = copper.with_operators("theta_h", [LIFT]).with_operators("theta_d", [SINK])
    other = copper.with_operators("theta_d", [SINK]).with_operators("theta_h", [LIFT])
    assert one == other
    assert one.operators("theta_d") == (SINK,)


def test_curves_do_not_fall_below_zero(copper):
    layer = copper.with_operators("theta_h", [SINK])
    assert (layer.curve("theta_h")(GAMMA) >= 0.0).all()
    # But what an edit took away another brings back: the clamp is on the final curve alone.
    back = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=1e9)
    restored = copper.with_operators("theta_h", [SINK, back])
    assert restored.curve("theta_h")(GAMMA) == pytest.approx(copper.curve("theta_h")(GAMMA), rel=1e-6, abs=1e-6)


def test_coefficients(copper):
    # The half angle's bands are fitted by solid angle: with b² = 1 - α², the integral of D sinθ over θ is
    # (1/2 + α² artanh(b) / 2b) / π for each channel, whatever J.
    coefficients = copper.coefficients("theta_h", 128)
    assert coefficients.shape == (128, 3)
    total = band_weights(128, by_solid_angle=True) @ coefficients
    b = math.sqrt(1.0 - 0.15**2)
    assert total == pytest.approx(np.full(3, (0.5 + 0.15**2 * math.atanh(b) / (2 * b)) / math.pi), rel=1e-6)


def test_view_curve_of_lambert():
    layer = make_layer(MODELS["lambert"], {"albedo": [0.7, 0.6, 0.5]})
    assert layer.name == "lambert"
    assert (layer.curve("theta_o")(GAMMA) == 1.0).all()
    assert layer.scale().tolist() == [0.7, 0.6, 0.5]


def test_layers_of_two_frames_reflect_about_their_own_axes():
    # The base's normal leans by 0.3 from the coat's, in the plane of x and z.
    turn = np.array([[math.cos(0.3), 0.0, math.sin(0.3)], [0.0, 1.0, 0.0], [-math.sin(0.3), 0.0, math.cos(0.3)]])
    coat = make_layer(MODELS["clearcoat"], {"alpha": 0.2}, "coat").replace(frame="coat")
    base = make_layer(MODELS["lambert"], {"albedo": [0.5] * 3}).replace(under="coat", covers=(coat,))
    angles = np.random.default_rng(1).random((2, 64, 2)) * [0.48 * math.pi, 2.0 * math.pi]
    wi, wo = (
        np.stack([np.sin(t) * np.cos(f), np.sin(t) * np.sin(f), np.cos(t)], axis=1)
        for t, f in np.moveaxis(angles, 2, 1)
    )
    coat_wi, coat_wo = wi @ turn.T, wo @ turn.T
    above = (coat_wi[:, 2] > 0.0) & (coat_wo[:, 2] > 0.0)
    theta_o, coat_theta_o = (np.arccos(np.clip(each[:, 2], 0.0, 1.0)) for each in (wo, coat_wo))
    # rho cos of a Lambertian base is 0.5 cos / pi in its own frame, times what the coat leaves at its own normal.
    expected = 0.5 / math.pi * wi[:, 2] * (1.0 - coat.coverage(coat_theta_o))
    of_coat = evaluate_layers([base, coat], wi, wo, None, (coat_wi, coat_wo)) - expected[:, None]
    alone = evaluate_layer(coat, coat_wi[above], coat_wo[above])
    assert of_coat[above] == pytest.approx(alone, rel=1e-9, abs=1e-12)
    assert abs(of_coat[~above]).max() < 1e-12 and (~above).any()
    both = np.stack([theta_o, coat_theta_o])
    assert base.view_factors(both)[:, 0] == pytest.approx(1.0 - coat.coverage(coat_theta_o))
    assert base.view_curves(theta_o)[0] == pytest.approx(np.ones((64, 3)))
    assert coat.view_factors(both) == pytest.approx(coat.view_curve(coat_theta_o))


def test_unknown_curves_and_values_are_refused(copper):
    with pytest.raises(ParameterError, match="theta_h, theta_d"):
        copper.curve("theta_r")
    with pytest.raises(ParameterError, match="theta_h, theta_d"):
        copper.with_operators("theta_o", [LIFT])
    with pytest.raises(ParameterError, match="alpha = 0.0"):
        copper.with_parameter("alpha", 0.0)
    with pytest.raises(ParameterError):
        make_layer(MODELS["lambert"], {"alpha": 0.3})


@pytest.mark.parametrize("alpha", [1e-4, 1.0])
@pytest.mark.parametrize("n_bands", [1, 8, 512])
def test_extreme_edits_stay_finite(copper, alpha, n_bands):
    # The largest step on the sharpest spike, on steps of zero width.
    stack = [Operator("amplify", "y", 0.0, 0.0, 0.3, 0.3, magnitude=1e12)] * 4
    layer = copper.with_parameter("alpha", alpha).with_operators("theta_h", stack)
    coefficients = layer.coefficients("theta_h", n_bands).astype(np.float32)
    assert np.isfinite(coefficients).all() and (coefficients >= 0.0).all()
