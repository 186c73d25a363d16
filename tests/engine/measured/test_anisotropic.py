"""Anisotropic measurements: the compiled look-up against its twin, factors over azimuths and slopes, and pictures."""

from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.curve.operators import Operator
from engine.light.environment import Environment
from engine.material import MODELS, make_layer
from engine.material._kernels import model_quotient_cosine
from engine.material.kinds import CHANNEL
from engine.material.layer import Layer, evaluate_by_curves
from engine.measured import tables
from engine.measured.measurement import Measurement
from engine.measured.tables import read_measurement, table_of
from engine.measured.tensor_files import adaptive_reflection
from engine.planner import plan_scene
from engine.precompute.direct._angle_kernels import tint
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.render.still import render_reference, render_still, still_layers, still_quality
from engine.scene.scene_loader import load_scene
from tests.engine.measured.test_measured import Kept, hemisphere, relative_rmse
from tests.naive.tensor_files import Gloss, acquired, tensor_bytes
from tests.scene_text import camera, placed

GLOSS = Gloss(0.5, 0.15)
TURNS = {"half": {"n_phi": 13, "turn": np.pi}, "quarter": {"n_phi": 7, "turn": np.pi / 2}, "whole": {"n_phi": 25}}
HIGHLIGHTS = ("measured", "measured_around", "measured_twist", "measured_brushed")


def written(folder: Path, turns: str) -> Path:
    path = folder / f"{turns}.bsdf"
    fields = acquired(GLOSS, n_theta=6, n=16, n_facets=32, **TURNS[turns])  # type: ignore[arg-type]
    path.write_bytes(tensor_bytes(fields))
    return path


@pytest.fixture(scope="module")
def brushed_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("brushed"), "half")


@pytest.fixture(scope="module")
def measurement(brushed_file: Path) -> Measurement:
    return run_to_end(read_measurement(brushed_file))


def layers_of(measurement: Measurement, highlight: str) -> list[Layer]:
    return [make_layer(MODELS[name], {"file": measurement}) for name in ("measured_diffuse", highlight)]


@pytest.mark.parametrize("turns", TURNS)
@pytest.mark.parametrize("highlight", HIGHLIGHTS)
def test_unedited_layers_are_the_measurement(tmp_path: Path, turns: str, highlight: str) -> None:
    # Curves times compiled quotients against the slow twin on the file itself: single precision of what is stored.
    path = written(tmp_path, turns)
    found = run_to_end(read_measurement(path))
    wi, wo = hemisphere(3000, 3), hemisphere(3000, 4)
    near = wi[:1000] * [-1, -1, 1] + 0.05 * hemisphere(1000, 5)
    wo[:1000] = near / np.linalg.norm(near, axis=1, keepdims=True)
    expected = np.maximum(adaptive_reflection(path.read_bytes(), path).evaluate(wi, wo), 0.0)
    layers = layers_of(found, highlight)
    np.testing.assert_allclose(sum(layer.brdf(wi, wo) for layer in layers), expected, rtol=2e-4, atol=1e-6)
    terms = sum(layer.scale() * evaluate_by_curves(layer, wi, wo) for layer in layers) / wi[:, 2:]
    np.testing.assert_allclose(terms, expected, rtol=2e-4, atol=1e-5)


def test_a_turned_surface_reflects_otherwise(measurement: Measurement) -> None:
    # Along the brushing the highlight is wide, across it is narrow: at theta_h = 20 degrees the formula has 8.6 / 0.6.
    half = np.radians(20.0)
    along, across = np.array([[np.sin(half), 0, np.cos(half)]]), np.array([[0, np.sin(half), np.cos(half)]])
    found = [
        sum(layer.brdf(v, v) for layer in layers_of(measurement, "measured_brushed"))[0, 0] for v in (along, across)
    ]
    expected = [GLOSS.reflection(v, v)[0, 0] for v in (along, across)]
    assert expected[0] > 3.0 * expected[1]
    assert found == pytest.approx(expected, rel=0.15)


def test_slopes_are_the_factors_of_a_brushed_surface(measurement: Measurement) -> None:
    # GGX with two widths is no product of its slopes, but nearly; of theta_h and phi_h it is far from one.
    report = measurement.report
    assert measurement.is_anisotropic and measurement.highlight == "brushed"
    assert report is not None and report.error < 0.3 and "by theta_h and phi_h" in report.method
    along, across = (measurement.nodes(name)[:, 1] for name in ("theta_u", "theta_v"))
    assert across[30] < 0.4 * across[0] and along[30] > 0.7 * along[0]  # at 10 degrees


def test_a_satin_is_fitted_over_the_azimuth_of_the_half_vector() -> None:
    # A highlight exp(-8 tan^2) (1 + 0.8 cos 2 phi_h), with no other factor: that is found, to a few percent.
    from engine.measured.adaptive import scattered_directions
    from engine.measured.factors import Factors
    from engine.measured.sample_files import ScatteredSamples
    from engine.measured.scattered_fit import fit_anisotropic

    wi, wo = scattered_directions()
    half = wi + wo
    tan2 = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    around = 1.0 + 0.8 * np.cos(2.0 * np.arctan2(half[:, 1], half[:, 0]))
    values = np.repeat((0.05 + np.exp(-8.0 * tan2) * around)[:, None], 3, axis=1)
    *_, factors = fit_anisotropic(ScatteredSamples(wi, wo, values, 0))
    assert isinstance(factors, Factors) and factors.highlight == "around" and factors.error < 0.05
    phi = np.linspace(0.0, np.pi / 2, 91)
    np.testing.assert_allclose(factors.curves["phi_h"][:, 0], (1.0 + 0.8 * np.cos(2.0 * phi)) / 1.8, atol=0.06)


def test_the_colours_of_many_directions_are_those_of_each(measurement: Measurement) -> None:
    model = MODELS["measured_brushed"]
    layer = make_layer(model, {"file": measurement})
    q, wi, wo = np.array(model.bind_parameters(layer.quotient_parameters())), hemisphere(200, 6), hemisphere(1, 7)[0]
    wi[20:40, 2] *= -1.0
    x, y, z = np.ascontiguousarray(wi.T, np.float32)
    ones, found = np.ones((200, 3), np.float32), np.empty((200, 3), np.float32)
    o = wo.astype(np.float32)
    tint(
        model.colours_number(q),
        q,
        np.arange(200),
        x,
        y,
        z,
        *o,
        np.ones(200, np.float32),
        ones,
        np.empty_like(ones),
        found,
    )
    pairs = np.column_stack([x, y, z, np.tile(o, (200, 1))]).astype(float)
    for channel in range(3):
        q[CHANNEL] = channel
        one_by_one = [model_quotient_cosine(model.number, q, *pair) for pair in pairs]
        np.testing.assert_allclose(found[:, channel], one_by_one, rtol=1e-5, atol=1e-9)
    assert not found[20:40].any()


def test_what_was_made_of_a_file_is_kept(
    brushed_file: Path, measurement: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, before = Kept(), table_of(measurement.number).samples
    monkeypatch.setattr(tables, "_tables", {})
    run_to_end(read_measurement(brushed_file, kept))
    monkeypatch.setattr(tables, "_tables", {})
    monkeypatch.delattr(tables, "fit_anisotropic")
    assert run_to_end(read_measurement(brushed_file, kept)) == measurement
    np.testing.assert_array_equal(table_of(measurement.number).samples, before)
    ((key, arrays),) = kept.arrays.items()
    samples = np.array(arrays["samples"])
    for forged in (samples[:-1], samples[:5], np.concatenate([[300.0], samples[1:]]).astype(np.float32)):
        kept.put(key, {**arrays, "samples": forged})
        monkeypatch.setattr(tables, "_tables", {})
        with pytest.raises(NameError):
            run_to_end(read_measurement(brushed_file, kept))


def sky() -> Environment:
    """Bright about two directions, so that the streak shows."""
    v, u = np.meshgrid(np.arange(16), np.arange(32), indexing="ij")
    spots = np.exp(-0.3 * ((u - 8) ** 2 + (v - 4) ** 2)) + np.exp(-0.3 * ((u - 20) ** 2 + (v - 5) ** 2))
    return Environment((0.2 + 6.0 * spots)[..., None].repeat(3, axis=2).astype(np.float32), "two lamps")


@pytest.mark.parametrize(
    ("highlight", "factor"), [("around", ""), ("around", "phi_h"), ("twist", "phi_d"), ("brushed", "theta_v")]
)
def test_picture_of_an_import(tmp_path: Path, measurement: Measurement, highlight: str, factor: str) -> None:
    # A ball in Placement, tangents and all, against brute force with the measurement itself; and with a curve that is
    # raised by half in its middle.
    (tmp_path / "scene.toml").write_text(camera((0, 0.6, 1.8), resolution=(12, 12)) + placed("ball", "sphere"))
    placement, light = Placement(load_scene(tmp_path / "scene.toml")), SkyState(sky())
    layers = layers_of(measurement, f"measured_{highlight}")
    if factor:
        layers[1] = layers[1].with_operators(factor, [Operator("amplify", "y", 0.1, 0.4, 0.9, 1.3, magnitude=1.5)])
    named = {f"ball.{i}": layer for i, layer in enumerate(layers)}
    plan = plan_scene(placement.scene, named, has_sky=True, still=True)
    steps = render_still(placement, still_layers(named.items(), ["ball"], plan), light, still_quality(plan))
    picture = run_to_end(steps, lambda step: None)
    reference = run_to_end(render_reference(placement, {0: layers}, light, 16, 5), lambda step: None)
    seen = placement.hits.object_image == 0
    assert seen.sum() > 20 and relative_rmse(picture[seen], reference[seen]) < 0.02
