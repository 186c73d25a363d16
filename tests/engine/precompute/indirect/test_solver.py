"""Indirect light as a whole: closed forms, and the polynomial against the plain sum on the same paths."""

from dataclasses import replace

import numpy as np
import pytest

from engine.core.clamping import is_clamped
from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect import irradiance_cache, smoothing
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.precompute.indirect.irradiance_cache import NO_OBJECT
from engine.precompute.indirect.sampling_settings import ROUGH
from engine.precompute.indirect.solver import Solver
from tests.engine.precompute.indirect.small_scenes import (
    CORNER,
    CORNER_VIEW,
    LAMP,
    LAMP_RADIANCE,
    LAMP_SIDE,
    QUICK,
    SPHERE,
    matt,
    placement_of,
    solve,
)


@pytest.fixture(scope="module")
def corner():
    placement = placement_of(CORNER, **CORNER_VIEW)
    layers = [matt(0, 0.5), matt(1, [0.8, 0.2, 0.1]), matt(2, [0.1, 0.3, 0.9])]
    return solve(placement, layers, 5, sky=constant_environment((1.0, 1.0, 1.0))), layers


@pytest.fixture(scope="module")
def ball():
    """An integrating sphere."""
    placement = placement_of([SPHERE, LAMP])
    return {n: solve(placement, [matt(0, 0.6)], n) for n in (2, 4, 8)}


@pytest.mark.parametrize("albedo", [0.0, 0.6, 1.0, 1.3])
@pytest.mark.parametrize("n_bounces", [2, 4, 8])
def test_integrating_sphere(ball, n_bounces, albedo):
    # The wall of a sphere sees every part of it alike: E_n = ρ^n Φ/A, so that L = ρ/π Σ ρ^n Φ/A, n = 1 … N-1.
    flux = 6 * LAMP_SIDE**2 * np.pi * LAMP_RADIANCE
    powers = albedo ** np.arange(1, n_bounces)
    expected = albedo / np.pi * powers.sum() * flux / (4 * np.pi)
    found = ball[n_bounces].picture([matt(0, albedo)])
    assert found.mean() == pytest.approx(expected, rel=0.01, abs=1e-12)
    assert np.abs(found - expected).max() <= 0.05 * expected


def test_the_polynomial_is_the_sum_over_the_same_paths(corner):
    found, layers = corner
    generator = np.random.default_rng(7)
    for edited in range(3):
        bright = found.radiosity(layers, edited)
        for albedo in (np.zeros(3), *generator.uniform(0.0, 1.5, (3, 3))):
            changed = [replace(x, albedo=albedo) if x.i_object == edited else x for x in layers]
            plain = found.radiosity(changed, NO_OBJECT)[:, 0]
            powers = albedo ** np.arange(bright.shape[1])[:, None]
            np.testing.assert_allclose((bright * powers).sum(axis=1), plain, rtol=1e-5, atol=1e-6 * plain.max())


@pytest.mark.parametrize("model", ["rough_conductor", "ashikhmin_shirley", "lambert", "phong"])
def test_bands_times_the_curve_are_the_reflection(corner, model):
    found, layers = corner
    layer = make_layer(MODELS[model])
    glossy = indirect_layer(0, layer, (16, 8)[: len(layer.model.factors)])
    light = found.outgoing_radiance([*layers, indirect_layer(1, make_layer(MODELS["rough_conductor"]), (16, 8))], 1)
    [whole] = run_to_end(found.points.hemisphere_samples(0).reflect([glossy.curves], light))
    assert whole.max() > 0.0
    for factor, curve in enumerate(glossy.curves.curves):
        bands = run_to_end(found.points.hemisphere_samples(0).by_band(glossy.curves, factor, light))
        contracted = np.einsum("cjnp,jc->pnc", bands, curve)
        np.testing.assert_allclose(contracted, whole, rtol=1e-4, atol=1e-5 * whole.max())


def test_an_edit_is_a_fresh_computation(corner):
    found, layers = corner
    edited = [replace(x, gain=x.gain * 0.3, albedo=x.albedo * 0.3) if x.i_object == 1 else x for x in layers]
    placement = placement_of(CORNER, **CORNER_VIEW)
    fresh = solve(placement, edited, 5, sky=constant_environment((1.0, 1.0, 1.0)))
    # The filter is what the materials at first called for, and would be another one now.
    one, two = found.with_smoothing(None).picture(edited), fresh.with_smoothing(None).picture(edited)
    # Nor are its gather points the same: six of 196 lie where the lattice was refined under the other albedo alone.
    assert np.sqrt(np.mean((one - two) ** 2)) / two.mean() < 0.01


def test_the_same_scene_has_the_same_light(corner):
    # Whichever thread comes first: cells keep the same places whatever the order of the rays that hit them.
    found, layers = corner
    for _ in range(2):
        again = solve(placement_of(CORNER, **CORNER_VIEW), layers, 5, sky=constant_environment((1.0, 1.0, 1.0)))
        np.testing.assert_array_equal(again.picture(layers), found.picture(layers))


def test_halves_tell_the_noise(corner):
    found, layers = corner
    first, second = run_to_end(found.points.halves(layers, found.outgoing_radiance(layers))) * found.unit
    whole = found.at_points(layers)
    np.testing.assert_allclose(0.5 * (first + second), whole, rtol=1e-3, atol=1e-4 * whole.max())
    noise = np.sqrt(np.mean((first - second) ** 2)) / whole.mean() / 2
    assert 0.0 < noise < 0.05
    rows, weights = found.footprint
    one, two = (np.einsum("pk,pkc->pc", weights, half[rows]) for half in (first, second))
    told, mean = run_to_end(found.noise(layers), lambda step: None)
    assert mean == pytest.approx(found.picture(layers).mean(), rel=1e-3)
    assert told == pytest.approx(np.sqrt(np.mean((one - two) ** 2)) / (one + two).mean(), rel=1e-3)
    placement = placement_of(CORNER, **CORNER_VIEW)
    sky = constant_environment((1.0, 1.0, 1.0))
    more = solve(placement, layers, 2, replace(QUICK, n_rays=16 * QUICK.n_rays), sky)
    assert run_to_end(more.noise(layers), lambda step: None)[0] < 0.5 * told


def test_darkness_and_black_objects(corner):
    placement = placement_of(CORNER, **CORNER_VIEW)
    assert not solve(placement, [matt(0, 0.5)], 4).picture([matt(0, 0.5)]).any()
    found, layers = corner
    assert not found.picture([matt(i, 0.0) for i in range(3)]).any()


def test_a_lamp_around_the_camera_and_in_the_surface():
    # A lamp that cuts through the wall: its own inside and what lies in it stay finite.
    lamp = LAMP | {"transform": [0.3, 0, 0, 1.0, 0, 0.3, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 1]}
    found = solve(placement_of([SPHERE, lamp]), [matt(0, 0.9)], 4)
    picture = found.picture([matt(0, 0.9)])
    assert np.isfinite(picture).all() and picture.min() >= 0.0 and picture.max() > 0.0


def test_one_open_object_sees_nothing_of_itself():
    found = solve(placement_of(CORNER[:1], **CORNER_VIEW), [matt(0, 1.0)], 4, sky=constant_environment((1.0,) * 3))
    assert not found.picture([matt(0, 1.0)]).any() and len(found.light.objects) == 0


def test_a_rough_picture_is_near_the_fine_one(corner):
    _, layers = corner
    placement = placement_of(CORNER, **CORNER_VIEW, n=96)
    sky = constant_environment((1.0, 1.0, 1.0))
    fine, quick = (solve(placement, layers, 5, each, sky=sky).picture(layers) for each in (QUICK, ROUGH))
    assert np.sqrt(np.mean((fine - quick) ** 2)) / fine.mean() < 0.15


def test_memory_does_not_grow_with_the_number_of_objects():
    bytes_of = []
    for n in (1, 4):
        objects = [
            CORNER[0] | {"transform": [2 / n, 0, 0, (2 * i + 1) / n - 1, 0, 0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1]}
            | {"name": f"part{i}"} for i in range(n)
        ]  # fmt: skip
        placement = placement_of([*objects, CORNER[1]], **CORNER_VIEW)
        layers = [matt(i, 0.5) for i in range(n + 1)]
        bytes_of.append(solve(placement, layers, 4, sky=constant_environment((1.0,) * 3)).n_bytes)
    assert bytes_of[1] == pytest.approx(bytes_of[0], rel=0.01)


NOISE = Environment((np.random.default_rng(3).random((16, 32, 3)) ** 4).astype(np.float32), "noise")


def _under_a_gradient(scale: float, *layers) -> np.ndarray:
    """Indirect light of the corner under a sky that is not even, `scale` times as bright."""
    solver = Solver(
        placement_of(CORNER, **CORNER_VIEW, n=12), {0: ["lambert"], 1: ["lambert"], 2: ["cook_torrance"]},
        SkyState(NOISE, 20.0, scale), 4, replace(QUICK, n_rays=64, n_samples=64),
    )  # fmt: skip
    return run_to_end(solver.solve(layers), lambda step: None).picture(layers).astype(np.float64)


def _glossy(i_object: int, times: float = 1.0):
    """A Cook-Torrance layer with its first curve so many times as high."""
    layer = indirect_layer(i_object, make_layer(MODELS["cook_torrance"], {}), (32, 16))
    seen, sent = (
        replace(each, curves=(times * each.curves[0], each.curves[1])) for each in (layer.curves, layer.second_curves)
    )
    return replace(layer, curves=seen, second_curves=sent, albedo=times * layer.albedo)


def test_light_is_linear_over_sixty_decades():
    layers = [matt(0, 0.7), matt(1, (0.8, 0.4, 0.2)), _glossy(2)]
    one = _under_a_gradient(1.0, *layers)
    assert one.max() > 0.0
    np.testing.assert_array_equal(_under_a_gradient(2.0**-60, *layers), 2.0**-60 * one)  # the same bits
    for scale in (1e-30, 1e30):
        found = _under_a_gradient(scale, *layers) / scale
        assert np.sqrt(np.mean((found - one) ** 2)) / one.mean() < 1e-6, scale


def test_curves_that_make_light_of_nothing_are_bright_and_never_black():
    # Two bounces on such a surface take 1e18 to the second power, three to the third, which is beyond 3.4e38.
    once, thrice = (_under_a_gradient(1.0, matt(0, 0.7), matt(1, 0.5), _glossy(2, times)) for times in (1.0, 1e18))
    assert np.isfinite(thrice).all() and (thrice[once > 0.0] > 0.0).all()
    all_three = _under_a_gradient(1.0, matt(0, 1e18), matt(1, 1e18), _glossy(2, 1e18))
    assert np.isfinite(all_three).all() and is_clamped(all_three)


def test_its_progress_grows_to_near_its_end(corner, monkeypatch):
    monkeypatch.setattr(smoothing, "NOISY", 0.0)
    placement, (_, layers) = placement_of(CORNER, **CORNER_VIEW), corner
    models = {layer.i_object: [layer.curves.model.name] for layer in layers}
    for changes in ({"adaptive": False}, {}, {"max_extra_sets": 1}):
        sky = SkyState(constant_environment((1.0, 1.0, 1.0)))
        steps = Solver(placement, models, sky, 3, replace(QUICK, **changes)).solve(layers)
        told = [fraction for fraction, _ in steps]
        assert told == sorted(told) and told[0] == 0.0 and 0.9 < told[-1] < 1.0


def test_light_on_cells_and_the_filter_come_in_steps_and_are_the_same(corner, monkeypatch):
    # So that whoever moves a camera meanwhile waits for one of them alone.
    placement, (_, layers) = placement_of(CORNER, **CORNER_VIEW), corner
    models = {layer.i_object: [layer.curves.model.name] for layer in layers}
    pictures, told = [], []
    for n_samples in (1 << 30, 64):
        monkeypatch.setattr(irradiance_cache, "_SAMPLES", n_samples)
        solver, texts = Solver(placement, models, SkyState(constant_environment((1.0, 1.0, 1.0))), 3, QUICK), []
        pictures.append(
            run_to_end(solver.solve(layers), lambda step, texts=texts: texts.append(step[1])).picture(layers)
        )
        told.append(texts)
    np.testing.assert_array_equal(*pictures)
    assert told[1].count("light between surfaces") > told[0].count("light between surfaces") + 10
    assert told[0].count("taking out noise") >= 2 * len(layers)
