"""Compiled angles and quotients: equal to the plain formulas, eq. 3.1 holds, and all results are finite."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from engine import material
from engine.material import MODELS, kinds, make_layer, ward
from engine.material._kernels import gamma, quotient_cosine
from tests.naive import angles

ANGLES = {"i": 0, "r": 1, "h": 2, "d": 3, "alpha": 4, "beta": 5, "ratio": 6, "o": 7, "u": 8, "v": 9, "phi": 10,
          "width": 11}  # fmt: skip
LAYERS = [
    *((name, {}) for name in MODELS),
    *((model.name, {p.name: end}) for model in MODELS.values() for p in model.parameters
      if p.kind not in ("choice", "file") for end in (p.minimum, p.maximum) if "scale" not in p.drives or p.drives[1:]),
    ("lambert", {"albedo": [0.7, 0.3, 0.1]}),
    ("phong", {}),
    ("phong", {"exponent": 0}),
    ("phong", {"exponent": 1e6}),
    ("blinn_phong", {"reflectance": 0.04}),
    ("blinn_phong", {"exponent": 0}),
    ("blinn_phong", {"exponent": 1e6}),
    ("cook_torrance", {}),
    ("cook_torrance", {"sigma": 1e-4}),
    ("rough_conductor", {}),
    ("rough_conductor", {"distribution": "beckmann"}),
    ("rough_conductor", {"alpha": 1e-4}),
    ("rough_conductor", {"alpha": 1.0, "eta": 1.0, "k": 0.0}),
    ("ashikhmin_shirley", {}),
    ("ashikhmin_shirley", {"n_u": 1e4, "n_v": 1, "reflectance": 0.04}),
    ("ashikhmin_shirley_ratio", {}),
    ("ashikhmin_shirley_ratio", {"n_u": 1e3, "ratio": 1e3}),
    ("ashikhmin_shirley_ratio", {"n_u": 1e3, "ratio": 1e-3}),
    ("ashikhmin_shirley_ratio", {"n_u": 7.0, "ratio": 0.3}),
    ("ashikhmin_shirley_width", {"n_u": 300.0, "ratio": 0.05}),
    ("ashikhmin_shirley_width", {"n_u": 3.0, "ratio": 40.0}),
    ("ward_anisotropic", {"alpha_u": 1e-4, "alpha_v": 1e-4}),
    ("schlick", {"roughness": 1e-8, "isotropy": 0.01}),
]  # fmt: skip


@njit
def all_gammas(kind, q, wi, wo):
    found = np.empty(wi.shape[0])
    for n in range(wi.shape[0]):
        found[n] = gamma(kind, q, wi[n, 0], wi[n, 1], wi[n, 2], wo[n, 0], wo[n, 1], wo[n, 2])
    return found


@njit
def all_quotients(kind, q, wi, wo):
    found = np.empty(wi.shape[0])
    for n in range(wi.shape[0]):
        found[n] = quotient_cosine(kind, q, wi[n, 0], wi[n, 1], wi[n, 2], wo[n, 0], wo[n, 1], wo[n, 2])
    return found


def hemisphere(count, seed, near=None, spread=1.0):
    """Unit directions above the horizon, uniform or gathered around `near`."""
    v = np.random.default_rng(seed).normal(size=(count, 3))
    v = v if near is None else near + spread * v
    v[:, 2] = np.abs(v[:, 2])
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def pairs(width=None):
    """wi, wo (N, 3): independent, or wi within about `width` of the mirrored wo."""
    wo = hemisphere(4000, seed=1)
    wi = hemisphere(4000, seed=2) if width is None else hemisphere(4000, 3, near=wo * [-1, -1, 1], spread=width)
    return wi, wo


def product_of_factors(layer, wi, wo):
    """scale * quotient * f_o * f_A * f_B [BenArtzi07, eq. 3.1], with compiled angles and quotient."""
    model, q = layer.model, layer.quotient_parameters()
    product = layer.scale() * (all_quotients(model.number, q, wi, wo) / wi[:, 2])[:, None]
    for factor in model.factors + ((model.view_factor,) if model.view_factor else ()):
        found = all_gammas(factor.gamma, q, wi, wo)
        inside = found <= math.pi / 2
        product = product * layer.generated_curve(factor.name)(np.minimum(found, math.pi / 2)) * inside[:, None]
    return product


@pytest.mark.parametrize("name", ANGLES)
@pytest.mark.parametrize("width", [None, 0.3, 1e-3])
def test_angles_against_arccos(name, width):
    # Within 1e-7: half of that is the twin's, whose arccos loses half of the digits near 0.
    wi, wo = pairs(width)
    q = np.array([0.5, 30.0, 0, 0, 0, 0, 0, 0])
    expected = angles.angle(ANGLES[name], 30.0, wi, wo)
    np.testing.assert_allclose(all_gammas(ANGLES[name], q, wi, wo), expected, rtol=0.0, atol=1e-7)


def test_small_half_angles_keep_their_digits():
    # wi and wo 10 micro-radians either side of the normal plus a tilt: theta_h is the tilt, to 1e-9 of itself.
    tilt = np.geomspace(1e-8, 1e-2, 50)
    wi = np.stack([np.sin(tilt + 1e-5), 0 * tilt, np.cos(tilt + 1e-5)], axis=1)
    wo = np.stack([np.sin(tilt - 1e-5), 0 * tilt, np.cos(tilt - 1e-5)], axis=1)
    assert all_gammas(kinds.THETA_H, np.zeros(8), wi, wo) == pytest.approx(tilt, rel=1e-7)
    assert all_gammas(kinds.THETA_D, np.zeros(8), wi, wo) == pytest.approx(np.full(50, 1e-5), rel=1e-7)


def test_angles_below_the_horizon_go_on():
    # A light's corner may lie below: theta_i there is more than pi/2, where curves have no bands.
    wi, wo = np.array([[0.8, 0.0, -0.6]]), np.array([[0.0, 0.0, 1.0]])
    assert all_gammas(kinds.THETA_I, np.zeros(8), wi, wo)[0] == pytest.approx(math.acos(-0.6), abs=1e-9)
    assert all_gammas(kinds.THETA_R, np.zeros(8), wi, wo)[0] == pytest.approx(math.acos(-0.6), abs=1e-9)


@pytest.mark.parametrize("width", [None, 0.3, 1e-2, 1e-4])
@pytest.mark.parametrize(("name", "parameters"), LAYERS)
def test_factors_times_quotient_is_the_formula(name, parameters, width):
    # Equation 3.1 against the model's formula as the papers print it.
    layer, (wi, wo) = make_layer(MODELS[name], parameters), pairs(width)
    expected = layer.model.brdf(layer.values, wi, wo)
    found = product_of_factors(layer, wi, wo)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * expected.max() + 1e-300)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("width", [None, 0.3])
def test_two_terms_are_a_coloured_fresnel_factor(name, width):
    # Equation 3.12, of any model: rho (R + (1 - R)(1 - cos theta_d)^5), and each term by curves and quotient as well.
    fresnel, (wi, wo) = np.array([0.9, 0.5, 0.04]), pairs(width)
    plain = make_layer(MODELS[name])
    terms = [plain.with_fresnel(fresnel), plain.with_fresnel(fresnel).replace(rises=True)]
    cos_d = 0.5 * np.linalg.norm(wi + wo, axis=1)[:, None]
    expected = plain.brdf(wi, wo) * (fresnel + (1.0 - fresnel) * (1.0 - cos_d) ** 5)
    np.testing.assert_allclose(sum(term.brdf(wi, wo) for term in terms), expected, rtol=1e-12, atol=1e-300)
    for term in terms:
        direct = term.brdf(wi, wo)
        np.testing.assert_allclose(product_of_factors(term, wi, wo), direct, rtol=1e-6, atol=1e-9 * direct.max())


def test_a_file_is_all_that_a_model_takes(tmp_path, monkeypatch):
    # A copy of Ward's model under another name, in a folder that the package is told of: found, compiled, and right.
    source = Path(ward.__file__).read_text(encoding="utf-8")
    (tmp_path / "velour.py").write_text(source.replace('name = "ward"', 'name = "velour"'), encoding="utf-8")
    monkeypatch.setattr(material, "__path__", [*material.__path__, str(tmp_path)])
    try:
        found = {model.name: model for model in material._models()}
    finally:
        sys.modules.pop("engine.material.velour", None)
    assert found.keys() == {*MODELS, "velour"}
    layer, (wi, wo) = make_layer(found["velour"]), pairs()
    assert layer.model.number not in {model.number for model in MODELS.values()}
    expected = layer.model.brdf(layer.values, wi, wo)
    np.testing.assert_allclose(product_of_factors(layer, wi, wo), expected, rtol=1e-6, atol=1e-9 * expected.max())


UNCOMPILED = """
import json
from engine.material import MODELS, make_layer
from engine.material._kernels import quotient_cosine
layers = [make_layer(model) for model in MODELS.values()]
pair = (0.6, 0.0, 0.8, -0.48, 0.64, 0.6)
found = [quotient_cosine(layer.model.number, layer.quotient_parameters(), *pair) for layer in layers]
print(json.dumps([hasattr(quotient_cosine, "py_func"), *map(float, found)]))
"""


def test_quotients_are_plain_python_where_nothing_is_compiled():
    # NUMBA_DISABLE_JIT, with which a debugger steps through them: the same numbers, models' own quotients included.
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", UNCOMPILED]
    said = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True).stdout
    compiled, *found = json.loads(said)
    wi, wo = np.array([[0.6, 0.0, 0.8]]), np.array([[-0.48, 0.64, 0.6]])
    layers = [make_layer(model) for model in MODELS.values()]
    expected = [all_quotients(each.model.number, each.quotient_parameters(), wi, wo)[0] for each in layers]
    assert not compiled and found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("name", "parameters"), LAYERS)
def test_single_precision_directions(name, parameters):
    # The transport hands over float32 directions: the quotient then agrees to their rounding.
    layer, (wi, wo) = make_layer(MODELS[name], parameters), pairs()
    up = (wi[:, 2] > 0.05) & (wo[:, 2] > 0.05)
    wi, wo, q = wi[up], wo[up], layer.quotient_parameters()
    exact = all_quotients(layer.model.number, q, wi, wo)
    single = all_quotients(layer.model.number, q, wi.astype(np.float32), wo.astype(np.float32))
    np.testing.assert_allclose(single, exact, rtol=2e-4, atol=1e-6 * exact.max())


@pytest.mark.parametrize(("name", "parameters"), LAYERS)
def test_grazing_and_opposite_directions(name, parameters):
    # Cosines of 0, 1e-8, -1e-8 and -1 on either side: exactly 0 below or on the horizon, else a number.
    layer = make_layer(MODELS[name], parameters)
    directions = [[math.sqrt(1 - c * c) * s, 0.0, c] for c in (0.0, -0.0, 1e-8, -1e-8, -1.0, 1.0, 0.5) for s in (1, -1)]
    wi = np.repeat(directions, len(directions), axis=0)
    wo = np.tile(directions, (len(directions), 1))
    found = all_quotients(layer.model.number, layer.quotient_parameters(), wi, wo)
    below = (wi[:, 2] <= 0.0) | (wo[:, 2] <= 0.0)
    assert np.isfinite(found).all() and (found >= 0.0).all()
    formula = layer.model.brdf(layer.values, wi, wo)
    assert (found[below] == 0.0).all() and (found[formula.max(axis=1) > 0.0] > 0.0).all()
    assert np.isfinite(formula).all() and (formula[below] == 0.0).all()
    for kind in ANGLES.values():
        assert np.isfinite(all_gammas(kind, layer.quotient_parameters(), wi, wo)).all()


def test_half_vector_of_opposite_directions_is_the_normal():
    wi, wo = np.array([[1.0, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]])
    assert all_gammas(kinds.THETA_H, np.zeros(8), wi, wo).tolist() == [0.0]
    assert all_gammas(kinds.THETA_D, np.zeros(8), wi, wo)[0] == pytest.approx(math.pi / 2)


components = st.floats(-1.0, 1.0) | st.sampled_from([0.0, 1.0, -1.0, 1e-8, -1e-8, 1e-300])


@settings(max_examples=300, deadline=None, derandomize=True)
@given(raw=st.lists(components, min_size=6, max_size=6), case=st.sampled_from(LAYERS))
def test_any_pair_gives_numbers(raw, case):
    wi, wo = np.array([raw[:3]]), np.array([raw[3:]])
    for v in (wi, wo):
        length = np.linalg.norm(v)
        v[:] = v / length if length > 1e-100 else [[0.0, 0.0, 1.0]]
    layer = make_layer(MODELS[case[0]], case[1])
    q = layer.quotient_parameters()
    quotient = all_quotients(layer.model.number, q, wi, wo)
    assert np.isfinite(quotient).all() and (quotient >= 0.0).all()
    for kind in ANGLES.values():
        found = all_gammas(kind, q, wi, wo)
        assert (found >= 0.0).all() and (found <= math.pi + 1e-9).all()
    assert np.isfinite(layer.model.brdf(layer.values, wi, wo)).all()
