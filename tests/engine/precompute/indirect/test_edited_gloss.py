"""Edits of what was frozen against plain sums over the same rays, at the second bounce as well."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.indirect import edited_gloss, gather_polynomial
from engine.precompute.indirect.albedo import albedo_bands, albedo_of
from engine.precompute.indirect.edited_gloss import choose_knots, choose_modes
from engine.precompute.indirect.frozen_light import FrozenLight, LightEdit, SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, albedos_of, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from tests.engine.precompute.indirect.small_scenes import (
    CORNER,
    CORNER_VIEW,
    QUICK,
    SPHERE,
    matt,
    placed,
    placement_of,
    solve,
)

METAL = make_layer(MODELS["rough_conductor"], {"alpha": 0.3, "eta": [0.2, 0.9, 1.1], "k": [3.9, 2.4, 2.1]})
LAMP = {"name": "lamp", "primitive": "cube", "emission": [40.0, 20.0, 10.0], "transform": placed(0.3, 1.4, 0.4, 0.1)}
N_BANDS = 32
# A floor, a wall of metal and paint, and a matt wall.
LAYERS = [matt(0, 0.5), indirect_layer(1, METAL, (N_BANDS, 8)), matt(2, 0.7), matt(1, 0.3)]
GLOSS = SelectedCurve(1, 0)
N_OBJECTS = 4


def edited(layers: Sequence[IndirectLayer], number: int, factor: int, times: np.ndarray) -> list[IndirectLayer]:
    """The layers with a curve multiplied by `times` (J, 3), and the albedo that follows."""
    layer = layers[number]
    curves = [np.array(curve) for curve in layer.curves.curves]
    curves[factor] = curves[factor] * times
    q = tuple(layer.curves.quotient_parameters.tolist())
    e = albedo_bands(layer.curves.model.name, q, tuple(map(len, curves)))
    albedo = albedo_of(e, curves, layer.gain, layer.view_curve)
    changed = replace(
        layer, curves=replace(layer.curves, curves=tuple(curves)), albedo=albedo,
        second_curves=replace(layer.second_curves, curves=tuple(curves)),
    )  # fmt: skip
    return [changed if i == number else each for i, each in enumerate(layers)]


def edit_to(layers: Sequence[IndirectLayer], i_object: int, *selected: SelectedCurve) -> LightEdit:
    """The edit of a freezing that gives these layers."""
    curves = {each.layer: layers[each.layer].curves.curves[each.factor] for each in selected}
    sent = {i: layers[i].gain * curve for i, curve in curves.items()}
    return LightEdit(albedos_of(layers, N_OBJECTS)[i_object], curves, sent)


def assert_as_plain(
    light: IndirectLight, frozen: FrozenLight, layers: Sequence[IndirectLayer], edit: LightEdit, rel: float
) -> None:
    """What was frozen gives for an edit what the layers reflect."""
    plain = run_to_end(GatherPolynomial(light).freeze(layers)).reflected
    for i, expected in plain.items():
        whole = expected[:, 0].T
        np.testing.assert_allclose(frozen.radiance(i, edit), whole, rtol=rel, atol=rel * float(whole.mean()))


@pytest.fixture
def all_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every band is a knot, and there are as many modes."""
    monkeypatch.setattr(gather_polynomial, "choose_knots", partial(choose_knots, most=N_BANDS))
    monkeypatch.setattr(gather_polynomial, "choose_modes", partial(choose_modes, most=N_BANDS))


@pytest.fixture(scope="module")
def corner() -> IndirectLight:
    """One bounce between surfaces."""
    placement = placement_of([*CORNER, LAMP], **CORNER_VIEW)
    return solve(placement, LAYERS, 2, QUICK, constant_environment((1.0, 0.8, 0.6)))


@pytest.fixture(scope="module")
def corner_of_three() -> IndirectLight:
    """The same with light of two bounces between surfaces."""
    placement = placement_of([*CORNER, LAMP], **CORNER_VIEW)
    return solve(placement, LAYERS, 3, QUICK, constant_environment((1.0, 0.8, 0.6)))


def changes(seed: int) -> np.ndarray:
    """Factors (J, 3) on all bands."""
    return np.random.default_rng(seed).uniform(0.3, 2.0, (N_BANDS, 3))


@pytest.mark.parametrize("seed", [1, 2])
def test_light_of_an_edited_curve_is_the_plain_sum(corner: IndirectLight, all_bands: None, seed: int) -> None:
    assert len(corner.points.photons.power) > 100 and len(corner.points.landed.photon) > 100
    frozen = run_to_end(GatherPolynomial(corner).freeze(LAYERS, 1, [GLOSS]))
    [gloss] = frozen.gloss
    assert set(gloss.by_layer) == {0, 2} and not gloss.products and not gloss.pairs  # a plane does not light itself
    after = edited(LAYERS, 1, 0, changes(seed))
    for layers in (LAYERS, after):
        assert_as_plain(corner, frozen, layers, edit_to(layers, 1, GLOSS), 2e-5)
    # It matters: the curve as it was gives another picture.
    still = frozen.radiance(0, replace(edit_to(after, 1, GLOSS), sent=edit_to(LAYERS, 1, GLOSS).sent))
    assert np.abs(still - frozen.radiance(0, edit_to(after, 1, GLOSS))).max() > 0.01 * still.mean()


def test_the_second_curve_of_a_layer_and_its_colour_are_followed_as_well(
    corner: IndirectLight, all_bands: None
) -> None:
    fresnel = SelectedCurve(1, 1)
    frozen = run_to_end(GatherPolynomial(corner).freeze(LAYERS, 1, [fresnel]))
    layers = edited(LAYERS, 1, 1, changes(3)[:8])
    tinted = replace(layers[1], gain=layers[1].gain * [1.0, 0.6, 0.2], albedo=layers[1].albedo * [1.0, 0.6, 0.2])
    layers = [tinted if i == 1 else each for i, each in enumerate(layers)]
    assert_as_plain(corner, frozen, layers, edit_to(layers, 1, fresnel), 2e-5)


def test_paint_beside_an_edited_gloss_stays_as_it_is(corner_of_three: IndirectLight, all_bands: None) -> None:
    # The gloss rises fourfold, and with it the albedo, of which paint no longer has the share that it had.
    frozen = run_to_end(GatherPolynomial(corner_of_three).freeze(LAYERS, 1, [GLOSS]))
    layers = edited(LAYERS, 1, 0, np.full((N_BANDS, 3), 4.0))
    assert_as_plain(corner_of_three, frozen, layers, edit_to(layers, 1, GLOSS), 0.01)


def test_gloss_beside_edited_paint_stays_as_it_is(corner_of_three: IndirectLight) -> None:
    paint = SelectedCurve(3, 0)
    frozen = run_to_end(GatherPolynomial(corner_of_three).freeze(LAYERS, 1, [paint]))
    assert not frozen.gloss
    layers = edited(LAYERS, 3, 0, np.full((16, 3), 2.5))
    assert_as_plain(corner_of_three, frozen, layers, edit_to(layers, 1, paint), 0.01)


def test_an_object_that_sees_itself_follows_the_products_of_its_curve(all_bands: None) -> None:
    layers = [indirect_layer(0, METAL, (N_BANDS, 8))]
    lamp = {"name": "lamp", "primitive": "cube", "emission": [1000.0] * 3, "transform": placed(0.2, 0.1, 0.1, 0.02)}
    light = solve(placement_of([SPHERE, lamp]), layers, 2, replace(QUICK, n_photons=1 << 12))
    curve = SelectedCurve(0, 0)
    frozen = run_to_end(GatherPolynomial(light).freeze(layers, 0, [curve]))
    assert set(frozen.gloss[0].products) == {0}
    after = edited(layers, 0, 0, changes(5))
    assert_as_plain(light, frozen, after, edit_to(after, 0, curve), 2e-4)


@pytest.mark.parametrize("n_bounces", [3, 4])
def test_light_that_meets_the_curve_twice_follows_it_to_second_order(all_bands: None, n_bounces: int) -> None:
    # A hollow ball around a table: its light reaches that by two of its reflections.
    objects = [
        {"name": "table", "primitive": "quad", "transform": [0.8, 0, 0, 0, 0, 0, 0.8, 0.1, 0, -0.8, 0, 0, 0, 0, 0, 1]},
        {"name": "ball", "primitive": "sphere", "smooth": True, "transform": placed(0, 0.6, 0, 2)},
        LAMP | {"transform": placed(0.2, 0.9, 0.1, 0.05)},
    ]
    layers = [matt(0, 0.5), indirect_layer(1, METAL, (N_BANDS, 8))]
    light = solve(
        placement_of(objects, eye=(0.0, 0.8, 0.5), target=(0.0, 0.1, 0.0)), layers, n_bounces,
        replace(QUICK, n_photons=0),
    )  # fmt: skip
    curve = SelectedCurve(1, 0)
    frozen = run_to_end(GatherPolynomial(light).freeze(layers, 1, [curve]))
    [gloss] = frozen.gloss
    assert gloss.pairs and bool(gloss.by_power) == (n_bounces > 3)
    # Change the curve at the second bounce alone, and the albedo by which light is reflected later: the receiver's own
    # curve stays, so that no product has three changes.
    after = edited(layers, 1, 0, changes(6) if n_bounces == 3 else np.full((N_BANDS, 3), [1.6, 1.3, 0.5]))
    held = replace(after[1], curves=layers[1].curves)
    after = [layers[0], held if n_bounces > 3 else replace(held, albedo=layers[1].albedo)]
    held = after[1]
    edit = replace(edit_to(after, 1, curve), sent={1: held.gain * held.second_curves.curves[0]})
    assert_as_plain(light, frozen, after, edit, 2e-3)


def test_an_edit_that_is_taken_back_gives_the_same_bits(corner: IndirectLight) -> None:
    frozen = run_to_end(GatherPolynomial(corner).freeze(LAYERS, 1, [GLOSS]))
    before = [frozen.radiance(i, edit_to(LAYERS, 1, GLOSS)) for i in range(len(LAYERS))]
    frozen.radiance(0, edit_to(edited(LAYERS, 1, 0, changes(7)), 1, GLOSS))
    for i, expected in enumerate(before):
        np.testing.assert_array_equal(frozen.radiance(i, edit_to(LAYERS, 1, GLOSS)), expected)
        assert frozen.dependence(i, edit_to(LAYERS, 1, GLOSS)) != frozen.dependence(
            i, edit_to(edited(LAYERS, 1, 0, changes(7)), 1, GLOSS)
        )


def test_few_knots_are_as_near_as_they_say(corner: IndirectLight) -> None:
    frozen = run_to_end(GatherPolynomial(corner).freeze(LAYERS, 1, [GLOSS]))
    [gloss] = frozen.gloss
    assert len(gloss.knots) == edited_gloss.MOST_KNOTS < N_BANDS
    # A change that the knots hold exactly, and one that they cannot.
    sent = edit_to(LAYERS, 1, GLOSS).sent[1]
    smooth, rough = sent + 1.0, sent * changes(8)
    assert gloss.unrepresented(LightEdit(np.ones(3), {}, {1: smooth})) < 1e-9
    assert gloss.unrepresented(LightEdit(np.ones(3), {}, {1: rough})) > 0.0
    assert gloss.departure(LightEdit(np.ones(3), {}, {1: 2.0 * sent})) == pytest.approx(1.0)


def test_too_little_light_is_not_stored(corner: IndirectLight) -> None:
    dim = replace(LAYERS[1], gain=LAYERS[1].gain * 1e-6, albedo=LAYERS[1].albedo * 1e-6)
    [gloss] = run_to_end(GatherPolynomial(corner).freeze([LAYERS[0], dim, *LAYERS[2:]], 1, [GLOSS])).gloss
    assert not gloss.by_layer and gloss.n_bytes == 0
    # What an edit of it would change is told all the same.
    brighter = LightEdit(np.ones(3), {}, {1: 1e6 * gloss.frozen})
    assert gloss.unrepresented(brighter) > 0.0 and gloss.departure(brighter) == pytest.approx(1e6, rel=1e-5)


# --------------------------------------------------------------------------------------------------- knots and modes


def test_knots_lie_where_light_meets_the_curve_and_it_bends() -> None:
    n = 128
    angles = (np.arange(n) + 0.5) / n
    curve = np.repeat(np.exp(-((angles / 0.1) ** 2))[:, None], 3, axis=1)
    knots = choose_knots(np.ones(n), curve, 16)
    assert knots[0] == 0 and knots[-1] == n - 1 and len(knots) == 16 and (np.diff(knots) > 0).all()

    def missed(of: np.ndarray, stretch: float) -> float:
        bent = np.exp(-((angles * stretch / 0.1) ** 2))
        return float(np.abs(bent - np.interp(np.arange(n), of, bent[of])).sum() / bent.sum())

    even = np.linspace(0, n - 1, 16).astype(int)
    for stretch in (0.5, 1.0, 2.0):
        assert missed(knots, stretch) < min(0.02, 0.8 * missed(even, stretch))
    # Where no light meets the curve, there are fewer.
    late = choose_knots(np.where(np.arange(n) < n // 2, 0.0, 1.0), np.repeat(angles[:, None] ** 2, 3, axis=1), 16)
    assert np.count_nonzero(late >= n // 2) > 10


def test_few_bands_are_all_knots() -> None:
    np.testing.assert_array_equal(choose_knots(np.ones(5), np.ones((5, 3)), 16), np.arange(5))
    np.testing.assert_array_equal(choose_knots(np.zeros(1), np.zeros((1, 3)), 16), [0])


def test_modes_hold_a_curve_that_is_stretched() -> None:
    n = 64
    angles = (np.arange(n) + 0.5) / n
    of = lambda width: np.repeat(np.exp(-((angles / width) ** 2))[:, None], 3, axis=1)  # noqa: E731
    modes = choose_modes(np.ones(n), of(0.2), 10)
    assert modes.shapes.shape == (n, 10) and modes.weights.shape == (10, n)
    for width in (0.1, 0.15, 0.3, 0.5):
        change = of(width) - of(0.2)
        assert np.abs(modes.shapes @ (modes.weights @ change) - change).max() < 0.02


def test_weights_of_other_photons_or_of_another_filter_are_not_used_again(corner: IndirectLight) -> None:
    first = GatherPolynomial(corner)
    run_to_end(first.freeze(LAYERS))
    points = corner.points
    backwards = points.photons._replace(**{
        name: np.ascontiguousarray(getattr(points.photons, name)[::-1]) for name in points.photons._fields
        if name != "per_area"
    })  # fmt: skip
    landed = points.landed._replace(photon=np.int32(len(points.photons.power) - 1) - points.landed.photon)
    other = replace(corner, points=replace(points, photons=backwards, landed=landed))
    unfiltered = replace(corner, points=replace(points, smoothing=None))
    for light in (other, unfiltered, corner.without_glossy_hits()):
        expected = run_to_end(GatherPolynomial(light).freeze(LAYERS)).reflected
        found = run_to_end(first.with_light(light).freeze(LAYERS)).reflected
        for i, each in expected.items():
            np.testing.assert_array_equal(found[i], each)
