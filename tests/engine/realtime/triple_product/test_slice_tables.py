"""Slices of BRDFs as tables: symmetric across the grain, sharp and coarse by their levels, means over triangles."""

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import evaluate_layers, make_layer
from engine.realtime.core.terms import diffuse_reflectance, has_isotropic_reflection, spherical, to_shading_frame
from engine.realtime.triple_product import _slice_kernels as slice_kernels
from engine.realtime.triple_product.reflections import SHARP
from engine.realtime.triple_product.slices import slice_bytes_of, slice_steps, table_bytes_of
from engine.realtime.triple_product.visibility import upper_triangles
from engine.sphere.geodesic import geodesic
from tests.engine.realtime.triple_product.test_incident import BRUSHED, GOLD, slices_of

MATT = make_layer(MODELS["lambert"], {"albedo": [0.5, 0.25, 1.0]})
MATT_LIKE = make_layer(MODELS["oren_nayar"], {"sigma": 0.3})


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_the_same_mirrored_across_its_grain(name: str) -> None:
    # So that slices over half a turn of the eye serve all of it.
    layer, mirror = make_layer(MODELS[name]), np.array([-1.0, 1.0, 1.0])
    polar, azimuth = np.random.default_rng(3).random((2, 2, 64)) * np.array([1.4, 2.0 * np.pi])[:, None, None]
    wi, wo = (spherical(polar[i], azimuth[i]) for i in range(2))
    there = evaluate_layers([layer], to_shading_frame(wi), to_shading_frame(wo))
    back = evaluate_layers([layer], to_shading_frame(wi * mirror), to_shading_frame(wo * mirror))
    np.testing.assert_allclose(back, there, rtol=1e-6, atol=1e-9)


def test_what_turns_with_its_grain_is_told_from_what_does_not() -> None:
    assert (
        has_isotropic_reflection(GOLD)
        and has_isotropic_reflection(make_layer(MODELS["oren_nayar"]))
        and not has_isotropic_reflection(BRUSHED)
    )
    assert (
        diffuse_reflectance(GOLD) is None
        and diffuse_reflectance(make_layer(MODELS["oren_nayar"], {"sigma": 0.5})) is None
    )
    assert diffuse_reflectance(MATT) == pytest.approx(np.array([0.5, 0.25, 1.0]) / np.pi)


def test_how_sharp_a_layer_is_is_told_by_its_slices() -> None:
    # Of a matt one f = cos θ: (∫ f)² / ∫ f² = π² / (2 π / 3).
    assert slices_of(MATT).lobe == pytest.approx(1.5 * np.pi, rel=1e-2)
    blunt, sharp = (make_layer(MODELS["rough_conductor"], {"alpha": alpha}) for alpha in (0.3, 0.1))
    assert run_to_end(slice_steps(sharp, -1)).lobe < SHARP < run_to_end(slice_steps(blunt, -1)).lobe


def test_a_layer_with_gloss_is_kept_in_seven_megabytes() -> None:
    slices = slices_of(GOLD)
    tables = slices.make_tables()
    assert tables.table.nbytes + slices.packed.nbytes < 7.2e6 and np.shares_memory(tables.values, slices.packed)


def entries(flat: np.ndarray, images: np.ndarray) -> np.ndarray:
    """Of tables, every eleventh slice (S, symmetries, 5120 or 2560, 3), as the kernels find them."""
    n_slices = 24 * (9 if len(images) == 10 else 41)
    some = flat[:-1].reshape(n_slices, -1, 3)[::11]
    return slice_kernels.unpacked(np.ascontiguousarray(some))[:, images]


@pytest.mark.parametrize("level", [1, 2, 3])
@pytest.mark.parametrize("layer", [GOLD, BRUSHED], ids=["isotropic", "brushed"])
def test_coarse_slices_are_read_as_even_fine_ones(layer, level: int) -> None:
    coarse = slices_of(layer, -1).at_level(level)
    fine = coarse.at_level(4)
    assert coarse.packed.shape[2] == 10 * 4**level and fine.packed.shape[2] == 2560
    near, far = coarse.make_tables(), fine.make_tables()
    made = near.table.nbytes, near.values.nbytes
    assert made == (table_bytes_of(level, layer is GOLD), slice_bytes_of(level, layer is GOLD))
    np.testing.assert_array_equal(entries(near.values, near.places), entries(far.values, far.places))
    kept, even = entries(near.table, near.images), entries(far.table, far.images)
    np.testing.assert_allclose(kept, even, rtol=0.01, atol=1e-6 * even.max())
    np.testing.assert_allclose(coarse.albedo, fine.albedo, rtol=0.01)
    both, twice = (each + slices_of(MATT_LIKE) for each in (coarse, fine))
    np.testing.assert_array_equal(both.packed, twice.packed)
    turned = coarse.half_around()
    assert not turned.is_isotropic and turned.level == level
    np.testing.assert_array_equal(turned.at_level(4).packed, fine.half_around().packed)


def test_slices_over_larger_triangles_are_means_and_have_the_first_coefficients() -> None:
    fine = slices_of(GOLD)
    coarse = fine.at_level(3)
    means = fine.values.reshape(24, 9, 640, 4, 3).mean(axis=3)
    np.testing.assert_allclose(coarse.values, means, rtol=2**-8)
    near, far = coarse.make_tables(), fine.make_tables()
    first = slice(0, 20 * 4**3)
    kept, all_of_them = entries(near.table, near.images)[:, :, first], entries(far.table, far.images)[:, :, first]
    np.testing.assert_allclose(kept, all_of_them, rtol=0.01, atol=2e-3 * all_of_them.max())


def test_finer_slices_are_the_means_over_finer_triangles() -> None:
    # Where a layer is about even, triangles are asked in their middles alone; a highlight is sharper than that.
    sharp = make_layer(MODELS["rough_conductor"], {"alpha": 0.1})
    found, weights = (
        run_to_end(slice_steps(sharp)).values[8, 3],
        geodesic(5).solid_angles.reshape(-1, 4)[upper_triangles()],
    )
    wi = geodesic(5).centres.reshape(-1, 4, 3)[upper_triangles()].reshape(-1, 3)
    wo = spherical(np.array([np.radians(89.0) / 23 * 8]), np.array([np.radians(4.5 * 3)]))
    values = evaluate_layers([sharp], to_shading_frame(wi), np.tile(to_shading_frame(wo), (len(wi), 1))).reshape(
        -1, 4, 3
    )
    exact = np.einsum("kp,kpi->ki", weights, values) / weights.sum(axis=1)[:, None]
    assert np.linalg.norm(found - exact) < 0.005 * np.linalg.norm(exact)
