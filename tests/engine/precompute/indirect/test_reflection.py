"""Freezing with what was kept of the rays against the same sums made anew."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from engine.core.generators import StepRunner, run_to_end
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.indirect import reflection
from engine.precompute.indirect._reflection_kernels import _add_shared, add_product
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.reflection import HemisphereSamples, OutgoingRadiance
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placement_of, solve
from tests.naive.fans import reflected as reflected_naively

# Edited is 0 or 1: of both some layers are glossy.
LAYERS = [
    matt(0, 0.5), indirect_layer(0, make_layer(MODELS["rough_conductor"]), (64, 16)),
    matt(1, [0.3, 0.2, 0.1]), indirect_layer(1, make_layer(MODELS["blinn_phong"]), (64,)), matt(2, 0.7),
]  # fmt: skip


@pytest.fixture(scope="module")
def found() -> IndirectLight:
    sky = constant_environment((1.0, 0.8, 0.6))
    return solve(placement_of(CORNER, **CORNER_VIEW), LAYERS, 4, replace(QUICK, n_samples=64), sky)


def frozen(
    fans: HemisphereSamples, light: OutgoingRadiance, layers: Sequence[IndirectLayer], i_object: int
) -> list[np.ndarray]:
    """What the object's layers reflect, and the last one's first curve by band."""
    curves = [each.curves for each in layers if each.i_object == i_object]
    return [*run_to_end(fans.reflect(curves[:-1], light)), run_to_end(fans.by_band(curves[-1], 0, light))]


def louder(layers: Sequence[IndirectLayer], i_object: int) -> list[IndirectLayer]:
    """The layers after an edit of one object's curves, the lower half of each."""

    def edited(layer: IndirectLayer) -> IndirectLayer:
        raised = [curve.copy() for curve in layer.curves.curves]
        for curve in raised:
            curve[: len(curve) // 2] *= [1.5, 0.7, 0.0]
        curves = replace(layer.curves, curves=tuple(raised))
        return replace(layer, curves=curves, second_curves=curves, albedo=layer.albedo * 1.1)

    return [edited(each) if each.i_object == i_object else each for each in layers]


def test_what_is_kept_is_what_is_found_anew(found):
    # Three selections with an edit between them: only what an edit changed is found again.
    kept = [found.points.hemisphere_samples(i, keeps=True) for i in range(3)]
    for layers, edited in ((LAYERS, 0), (LAYERS, 1), (louder(LAYERS, 0), 1), (louder(louder(LAYERS, 0), 1), 0)):
        light = found.outgoing_radiance(layers, edited)
        for i, fans in enumerate(kept):
            anew = frozen(found.points.hemisphere_samples(i), light, layers, i)
            for one, two in zip(frozen(fans, light, layers, i), anew, strict=True):
                assert two.max() > 0.0
                np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-6 * two.max())
    assert all(fans.n_bytes > 0 for fans in kept)
    assert found.points.hemisphere_samples(0).n_bytes == 0


def test_two_freezings_whose_steps_alternate_are_as_each_alone(found, monkeypatch):
    # What a material sends along the rays is kept by one of them while the other is under way.
    monkeypatch.setattr(reflection, "_PART", 8)
    fans, curves = found.points.hemisphere_samples(2, keeps=True), [LAYERS[-1].curves]
    lights = [found.outgoing_radiance(layers) for layers in (LAYERS, louder(LAYERS, 0))]
    runs = [StepRunner(fans.reflect(curves, light)) for light in lights]
    ended = [False, False]
    while not all(ended):
        ended = [is_ended or run.advance() for is_ended, run in zip(ended, runs, strict=True)]
    for light, run in zip(lights, runs, strict=True):
        np.testing.assert_allclose(
            run.result[0], run_to_end(found.points.hemisphere_samples(2).reflect(curves, light))[0], rtol=1e-5
        )
    assert np.abs(runs[0].result[0] - runs[1].result[0]).max() > 0.01 * runs[0].result[0].max()


def test_other_lamps_are_other_light(found):
    # Twice the sky: what glossy surfaces reflect of it directly doubles, though no curve changed.
    fans, light = found.points.hemisphere_samples(2, keeps=True), found.outgoing_radiance(LAYERS)
    curves = [LAYERS[-1].curves]
    run_to_end(fans.reflect(curves, light))
    assert light.glossy is not None
    lamps = light.glossy.all_lights
    brighter = lamps._replace(power=2 * lamps.power, radiance=2 * lamps.radiance)
    doubled = replace(light, glossy=replace(light.glossy, all_lights=brighter))
    [one], [two] = (run_to_end(each.reflect(curves, doubled)) for each in (fans, found.points.hemisphere_samples(2)))
    np.testing.assert_allclose(one, two, rtol=1e-5)


@pytest.mark.parametrize("i_layer", range(len(LAYERS)))
def test_contraction_is_the_sum_over_the_rays(found, i_layer):
    layer = louder(LAYERS, LAYERS[i_layer].i_object)[i_layer]
    matt_only = OutgoingRadiance(found.radiosity(LAYERS, 1), None, None)
    fans = found.with_smoothing(None).points.hemisphere_samples(layer.i_object)
    [reflected] = run_to_end(fans.reflect([layer.curves], matt_only))
    points = range(0, len(fans), len(fans) // 6)
    slowly = np.array([reflected_naively(fans._samples, i, layer.curves, matt_only.diffuse) for i in points])
    np.testing.assert_allclose(reflected[points], slowly, rtol=1e-4, atol=1e-5 * reflected.max())


def test_no_more_is_kept_than_of_the_layers_that_there_are(found):
    # Each roughness weighs the rays anew: after many of them no more is kept than after one.
    kept, sizes = GatherPolynomial(found), []
    for alpha in (0.2, 0.25, 0.3, 0.35):
        gloss = indirect_layer(0, make_layer(MODELS["rough_conductor"], {"alpha": alpha}), (64, 16))
        layers = [LAYERS[0], gloss, *LAYERS[2:]]
        again = run_to_end(kept.freeze(layers, 0, [SelectedCurve(1, 0)]))
        anew = run_to_end(GatherPolynomial(found).freeze(layers, 0, [SelectedCurve(1, 0)]))
        np.testing.assert_array_equal(again.bands[1], anew.bands[1])
        sizes.append(kept.n_bytes)
    assert sizes[0] > 0 and len(set(sizes)) == 1


@njit
def product_and_shares(
    factors: NDArray[np.float32], share: np.float32, lights: NDArray[np.float32], total: NDArray[np.float32],
    bands: NDArray[np.float32],
) -> None:  # fmt: skip
    a, b, c = factors[0], factors[1], factors[2]
    add_product(a, b, c, lights[1], total)
    _add_shared(a, b, c, share, lights[1], bands[0], bands[1])


@pytest.mark.parametrize("n_powers", [1, 2, 5])
def test_products_are_summed_by_power_and_colour(n_powers: int) -> None:
    # The light is one of several, so that its numbers are not those at the beginning of an array.
    generator = np.random.default_rng(n_powers)
    lights, bands = generator.random((3, n_powers, 4), np.float32), generator.random((3, n_powers, 4), np.float32)
    total, factors, share = bands[2].copy(), generator.random(3, np.float32), np.float32(0.3)
    product = lights[1] * [*factors, 0.0]
    expected, shared = total + product, np.stack([bands[0] + 0.7 * product, bands[1] + 0.3 * product, bands[2]])
    product_and_shares(factors, share, lights, total, bands)
    np.testing.assert_allclose(total, expected, rtol=1e-6)
    np.testing.assert_allclose(bands, shared, rtol=1e-6)
