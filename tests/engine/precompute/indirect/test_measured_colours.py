"""The colours of measured layers in indirect light: each of its own quotient, as far as one factor can bring it."""

from dataclasses import replace

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.measured.measurement import Measurement
from engine.measured.sample_files import merl_bytes
from engine.measured.tables import read_measurement
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve

BANDS = 64, 16
TINT = np.array([2.0, 1.0, 0.25])
METAL = indirect_layer(0, make_layer(MODELS["blinn_phong"]), (16,))


@pytest.fixture(scope="module")
def measurement(measured_samples: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Measurement:
    """Its red is 1.8 times as much or as little in turns, which no factor follows: 1 in the mean of logarithms, that is
    in the factors, but (1.8 + 1 / 1.8) / 2 = 1.18 in the mean."""
    squares = (np.arange(90)[:, None] // 3 + np.arange(180) // 4) % 2
    samples = measured_samples.copy()
    samples[..., 0] *= np.where(squares, 1.8, 1.0 / 1.8)
    path = tmp_path_factory.mktemp("measured") / "squares.binary"
    path.write_bytes(merl_bytes(samples))
    return run_to_end(read_measurement(path))


def albedo_of_the_data(layer: Layer) -> np.ndarray:
    """(1/π) ∫∫ ρ cos θ_i cos θ_o dω_i dω_o (3,): by 40 views, even in cos² θ_o, and 5,000 even directions."""
    views, turns = np.arccos(np.sqrt((np.arange(40) + 0.5) / 40)), np.pi * (1 + 5**0.5) * np.arange(5000)
    z = (np.arange(5000) + 0.5) / 5000
    radius = np.sqrt(1 - z * z)
    wi = np.stack([radius * np.cos(turns), radius * np.sin(turns), z], axis=1)
    total = np.zeros(3)
    for view in views:
        wo = np.broadcast_to([np.sin(view), 0.0, np.cos(view)], wi.shape)
        total += (layer.model.brdf(layer.values, wi, wo) * wi[:, 2:]).mean(axis=0)
    return 2 * np.pi * total / len(views)


def test_each_colour_has_the_albedo_of_its_own_data(measurement: Measurement) -> None:
    layer = make_layer(MODELS["measured_cloth"], {"file": measurement})
    expected = albedo_of_the_data(layer)
    np.testing.assert_allclose(equivalent_albedo(layer, BANDS), expected, rtol=0.02)
    found = indirect_layer(0, layer, BANDS)
    np.testing.assert_allclose(found.albedo, expected, rtol=0.02)
    # With the common quotient the red is too dark, the others too bright.
    assert found.curves.tint[0] > 1.03 and np.all(found.curves.tint[1:] < 0.97)


def tinted(layer: IndirectLayer) -> IndirectLayer:
    return replace(
        layer, curves=replace(layer.curves, tint=TINT), second_curves=replace(layer.second_curves, tint=TINT)
    )


def test_sums_over_rays_are_tinted() -> None:
    # What the eye sees of the layer, whole and by band; and what of its light others see in their second bounce.
    layers = [METAL, matt(1, 0.8), matt(2, 0.3)]
    light = solve(placement_of(CORNER, **CORNER_VIEW), layers, 2, replace(QUICK, n_samples=64), constant_environment(1))
    changed = [tinted(METAL), *layers[1:]]
    held = light.outgoing_radiance(layers)
    plain, seen = (run_to_end(light.points.reflect(each, held)) for each in (layers, changed))
    mine = seen[:, 0] > 1.5 * plain[:, 0]
    assert mine.any()
    np.testing.assert_allclose(seen[mine], plain[mine] * TINT, rtol=1e-4)
    selected = [SelectedCurve(0, 0)]
    before, after = (run_to_end(GatherPolynomial(light.without_glossy_hits()).freeze(each, curves=selected),
    lambda _: None)
                     for each in (layers, changed))  # fmt: skip
    np.testing.assert_allclose(after.bands[0], before.bands[0] * TINT[:, None, None, None], rtol=1e-5)
    one, two = (light.outgoing_radiance(each).glossy for each in (layers, changed))
    assert one is not None and two is not None and one.digests[0] != two.digests[0]
    np.testing.assert_allclose(two.layers.gains, one.layers.gains * TINT, rtol=1e-6)
