"""The brute-force oracle against closed forms, and the transport path against the oracle."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from engine.curve.operators import Operator
from engine.light.emitters import emitter_patches
from engine.light.environment import Environment, constant_environment, load_environment
from engine.light.triangle_lights import cut_lights
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_layer, make_layer
from engine.precompute.direct.bandstore import BandStore
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.near_leaves import near_leaves
from engine.precompute.direct.pipeline import Placement
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer
from engine.reference.integrator import integrate_direct
from engine.scene.builtin import builtin_scenes
from engine.scene.scene_loader import load_scene
from engine.visibility.point_visibility import brute_force_visibility, sphere_targets
from tests.engine.precompute.direct.by_hand import caster_of, points_at, square

UP = np.array([[0.0, 1.0, 0.0]])
ORIGIN = np.zeros((1, 3))
# Bands at which a curve's steps no longer show in the comparison; 8 of theta_d leave 2.7 % on the reference's tray.
BANDS = {"theta_d": 32}
N_BANDS = 128


def integrate(hits, layer: Layer, environment: Environment | None = None, lamp=None, level: int = 5) -> np.ndarray:
    patches = None if lamp is None else emitter_patches(lamp, np.ones((len(lamp), 3)), 2048)
    caster = caster_of() if lamp is None else caster_of(lamp)
    rows = np.arange(len(hits.pixel))
    return integrate_direct(hits, rows, caster, lambda _: [layer], environment, 0.0, patches, level)


# ------------------------------------------------------------------------------------------------------ closed forms


def test_a_lambert_plane_under_a_constant_sky() -> None:
    # L = a, whatever the angle: the albedo times the sky's radiance.
    layer = make_layer(MODELS["lambert"], {"albedo": [0.5, 0.25, 1.0]})
    found = integrate(points_at(ORIGIN, UP, np.array([[0.5, 0.5, 0.0]])), layer, constant_environment(2.0))
    np.testing.assert_allclose(found[0], [1.0, 0.5, 2.0], rtol=1e-3)


def test_a_square_lamp_at_height_one() -> None:
    # E = 0.752275 L, so a white plane reflects 0.752275 / π.
    lamp = square((0, 1, 0), (1, 0, 0), (0, 0, 1))
    found = integrate(points_at(ORIGIN, UP), make_layer(MODELS["lambert"], {"albedo": [1.0, 1.0, 1.0]}), lamp=lamp)
    np.testing.assert_allclose(found[0], 0.752275 / np.pi, rtol=1e-3)


def test_hidden_layers_are_not_seen() -> None:
    layer = make_layer(MODELS["lambert"]).replace(visible=False)
    assert not integrate(points_at(ORIGIN, UP), layer, constant_environment(1.0), level=2).any()


# ------------------------------------------------------------------------------------------------------ edited curves


def amplified(layer: Layer, magnitude: float, high: float = np.pi / 2, falloff: float = 0.0) -> Layer:
    """The first curve times the magnitude from 0 to an angle, and fading out over the falloff behind it."""
    operator = Operator("amplify", "y", 0.0, 0.0, high, high + falloff, magnitude)
    return layer.with_operators(layer.model.factors[0].name, (operator,))


def pairs(n: int = 400) -> tuple[np.ndarray, np.ndarray]:
    vectors = np.random.default_rng(8).normal(size=(2, n, 3))
    vectors[..., 2] = np.abs(vectors[..., 2])
    wi, wo = vectors / np.linalg.norm(vectors, axis=2, keepdims=True)
    return wi, wo


@pytest.mark.parametrize("model", sorted(MODELS))
def test_an_edit_that_changes_nothing_changes_nothing(model: str) -> None:
    # Edited, a layer is quotient times curves; unedited, the model's own formula: the same to rounding.
    layer = make_layer(MODELS[model])
    wi, wo = pairs()
    plain = evaluate_layer(layer, wi, wo)
    edited = evaluate_layer(amplified(layer, 1.0), wi, wo)
    np.testing.assert_allclose(edited, plain, rtol=2e-6, atol=1e-9 * plain.max())


@pytest.mark.parametrize("model", sorted(MODELS))
def test_a_curve_three_times_as_high_reflects_three_times_the_light(model: str) -> None:
    layer = make_layer(MODELS[model])
    wi, wo = pairs()
    plain, edited = evaluate_layer(layer, wi, wo), evaluate_layer(amplified(layer, 3.0), wi, wo)
    np.testing.assert_allclose(edited, 3 * plain, rtol=2e-6, atol=1e-9 * plain.max())


# ----------------------------------------------------------------------------------- the transport path and the oracle


def by_transport(
    placement: Placement, layers: Mapping[int, Sequence[Layer]], sky: Environment | None, turn: float, rows: np.ndarray
) -> np.ndarray:
    """Radiance (len(rows), 3) by the editor's way with 4,000 lights, every shadow traced."""
    hits = placement.hits
    lighting = prepare_lighting(None if sky is None else cut_lights(sky, 4000, turn, 6), placement.emitters(256), 0.5)
    seen = [
        brute_force_visibility(hits, placement.caster, targets, rows)
        for targets in (sphere_targets(4), lighting.fine_targets, lighting.emitter_targets)
    ]
    light = VisibleLight(lighting, *seen, near_leaves(hits, placement.caster, lighting.emitters, seen[2], rows))
    radiance = np.zeros((len(rows), 3))
    objects = hits.object_image.ravel()[hits.pixel[rows]]
    for i_object, its_layers in layers.items():
        own = np.flatnonzero(objects == i_object)
        cos_o = np.einsum("pc,pc->p", hits.normal[rows[own]], hits.wo[rows[own]])
        for layer in its_layers if len(own) else ():
            model = layer.model
            curves = [layer.coefficients(f.name, BANDS.get(f.name, N_BANDS)) for f in model.factors]
            bands = (len(curves[0]), len(curves[1]) if len(curves) > 1 else 1)
            shape = LayerShape(model.name, tuple(layer.quotient_parameters().tolist()), bands)
            store = BandStore(bands, tuple(project_layer(hits, rows[own], light, shape)))
            reflected = store.radiance(curves[0], [*curves, np.ones((1, 3))][1]) * lighting.unit * layer.scale()
            if model.view_factor is not None:
                reflected = reflected * layer.curve(model.view_factor.name)(np.arccos(np.clip(cos_o, 0.0, 1.0)))
            radiance[own] += reflected
    return radiance


def off_silhouettes(placement: Placement) -> np.ndarray:
    """Rows whose pixel shows the same object as all pixels within 2 of it, as the masks of the references have it."""
    image = placement.hits.object_image
    inside = minimum_filter(image, 5) == maximum_filter(image, 5)
    return np.flatnonzero(inside.ravel()[placement.hits.pixel])


def compare(path: Path, n_points: int, level: int, edit: float | None = None) -> tuple[float, float]:
    """relRMSE of the points, clamped as DESIGN §11 says, and the relative difference of the means.

    The same random points, off silhouettes, where a light's centre can stand for it; the oracle sees the sky through
    20·4^level directions and emitters through 2,048 patches.
    """
    placement = Placement(load_scene(path, (160, 120)))
    described = placement.scene.description
    turn = described.environment.rotation if described.environment else 0.0
    sky = load_environment(placement.scene.environment_path) if placement.scene.environment_path else None
    layers = {i: [make_layer(MODELS[d.model], d.parameters) for d in o.layers] for i, o in enumerate(described.objects)}
    if edit is not None:
        layers = {i: [amplified(layer, edit, 0.2, 0.5) for layer in given] for i, given in layers.items()}
    random = np.random.default_rng(1)
    rows = np.sort(random.choice(off_silhouettes(placement), n_points, replace=False))
    found = by_transport(placement, layers, sky, turn, rows)
    expected = integrate_direct(
        placement.hits, rows, placement.caster, lambda i: layers[i], sky, turn, placement.patches(2048), level
    )
    largest = np.quantile(expected, 0.999)
    a, b = np.minimum(found, largest), np.minimum(expected, largest)
    return float(np.sqrt(np.mean((a - b) ** 2)) / b.mean()), float(a.mean() / b.mean() - 1)


@pytest.mark.parametrize("name", ["teatray", "cornell"])
def test_transport_agrees_with_the_oracle_on_the_references(shared_reference: Path, name: str) -> None:
    error, difference = compare(shared_reference / f"{name}.toml", 40, 6)
    assert error < 5e-3 and abs(difference) < 2e-3


def test_transport_agrees_with_the_oracle_on_shapes() -> None:
    error, difference = compare(builtin_scenes()["shapes"], 30, 6)
    assert error < 5e-3 and abs(difference) < 2e-3


def test_transport_agrees_with_the_oracle_where_curves_are_edited() -> None:
    # Every first curve twice as high up to 11 degrees, and as it was from 40 degrees on.
    error, difference = compare(builtin_scenes()["shapes"], 20, 6, edit=2.0)
    assert error < 5e-3 and abs(difference) < 2e-3
