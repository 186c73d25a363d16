"""Indirect light under changing lights, against the same records lit from scratch and summed in full."""

from copy import copy
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.light.triangle_lights import cut_lights
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import LightLink, Placement, SkyState, patches_of
from engine.precompute.direct.relight import sky_likeness
from engine.precompute.indirect.emission import N_LIGHTS, in_units, patch_lights, sky_lights
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer, view_factors
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.relighting import (
    IndirectRelighting,
    RelitLayer,
    SceneLight,
    SourceLighting,
    turned_lights,
)
from engine.precompute.indirect.solver import Solver, relit
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placed, placement_of

LAYERS = (matt(0, [0.8, 0.5, 0.3]), matt(1, 0.6), matt(2, [0.2, 0.7, 0.4]))
LAMPS = [
    {"name": "left", "primitive": "cube", "emission": [3.0, 2.0, 1.0], "transform": placed(-0.5, 0.9, -0.4, 0.2)},
    {"name": "right", "primitive": "cube", "emission": [1.0, 1.0, 4.0], "transform": placed(0.5, 0.4, -0.6, 0.2)},
]
LEFT, RIGHT = 3, 4
NOTHING = (0.0, 0.0, 0.0)


def sunny() -> Environment:
    radiance = np.full((16, 32, 3), 0.3, np.float32)
    radiance[3:5, 20:22] += np.float32((30.0, 24.0, 15.0))
    return Environment(radiance, "sunny")


@cache
def solved() -> tuple[Placement, SkyState, IndirectLight]:
    placement, sky = placement_of([*CORNER, *LAMPS], **CORNER_VIEW), SkyState(sunny(), 20.0)
    solver = Solver(placement, dict.fromkeys(range(3), ["lambert"]), sky, 3, QUICK)
    return placement, sky, run_to_end(solver.solve(LAYERS))


class Lit:
    """The corner with two lamps under a sun, and its relighting."""

    def __init__(self, light: IndirectLight | None = None) -> None:
        self.placement, self.sky, self.light = solved()
        self.light = light or self.light
        self.emission = self.placement.scene.emission.copy()
        self.lighting = SourceLighting(self.light, self.placement.scene, self.sky)
        self.n_reflected, self._representation = 0, GatherPolynomial(self.light)
        at_rest = SceneLight(self.sky, self.emission)
        self.relighting = IndirectRelighting(self.lighting, at_rest, LAYERS, self._reflect)

    def _reflect(self, light: OutgoingRadiance):
        self.n_reflected += 1
        return (yield from self._representation.reflect(LAYERS, light))

    def under(self, rotation: float = 20.0, **emission: tuple[float, float, float]) -> list[RelitLayer]:
        changed = self.emission.copy()
        for name, radiance in emission.items():
            changed[{"left": LEFT, "right": RIGHT}[name]] = radiance
        light = SceneLight(replace(self.sky, rotation=rotation), changed)
        return run_to_end(self.relighting.relit(light))

    def picture(self, layers: list[RelitLayer]) -> np.ndarray:
        """What the gather points send to the camera."""
        points = self.light.points
        rows, out = points.samples.points, np.zeros((len(points.samples.points), 3))
        for layer, found in zip(LAYERS, layers, strict=True):
            begin, end = np.searchsorted(rows, points.hits.object_ranges[layer.i_object])
            out[begin:end] += found.now * view_factors(points.hits, rows[begin:end], layer)
        return out

    def from_scratch(self, rotation: float, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The same picture: all irradiance of the records in one sum, reflected by sums that store nothing."""
        environment, n_samples = self.sky.environment, self.lighting._n_samples
        assert environment is not None
        cut, _, unit = in_units(cut_lights(environment, N_LIGHTS, self.sky.rotation), None, 1.0)
        assert cut is not None
        lights = turned_lights(sky_lights(cut), rotation - self.sky.rotation)
        direct = unit * self.light.cache.irradiance(lights, n_samples).astype(np.float64)
        for i, radiance in ((LEFT, left), (RIGHT, right)):
            emission = np.zeros_like(self.emission)
            emission[i] = 1.0
            _, patches, unit = in_units(None, patches_of(replace(self.placement.scene, emission=emission), 256), 1.0)
            assert patches is not None
            direct += unit * self.light.cache.irradiance(patch_lights(patches), n_samples) * np.asarray(radiance)
        by_albedo = self.light.without_glossy_hits()
        lit = replace(by_albedo, light=replace(by_albedo.light, direct=direct.astype(np.float32)), unit=1.0)
        return lit.at_points(LAYERS)


@pytest.fixture
def lit() -> Lit:
    return Lit()


def test_it_is_the_light_of_records_lit_from_scratch(lit: Lit) -> None:
    left, right = np.array([0.5, 3.0, 2.0]), np.array([1.0, 0.0, 1.0])
    lit.under(left=(9.0, 9.0, 9.0))  # an emitter that has changed before
    found = lit.picture(lit.under(65.0, left=tuple(left), right=tuple(right)))
    expected = lit.from_scratch(65.0, left, right)
    assert expected.mean() > 0.01
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5 * float(expected.mean()))


def test_lights_alone_are_taken_over_by_the_same_rays(lit: Lit) -> None:
    """Under another light the same records are lit anew: what single lights give stays."""
    alone = np.zeros_like(lit.emission)
    alone[LEFT] = lit.emission[LEFT]
    run_to_end(lit.relighting.reflect_alone("left", SceneLight(SkyState(None), alone), NOTHING))
    before = lit.relighting.mixed({"left": (2.0, 1.0, 1.0)}, {"left": (1.0, 1.0, 1.0)})
    assert before is not None

    found = run_to_end(relit(lit.light, lit.placement, replace(lit.sky, rotation=90.0), QUICK, 3))
    later = Lit(found)
    later.relighting.take_over(lit.relighting)
    run_to_end(later.relighting.reflect_alone("left", SceneLight(SkyState(None), alone), NOTHING))
    assert later.n_reflected == 0
    after = later.relighting.mixed({"left": (2.0, 1.0, 1.0)}, {"left": (1.0, 1.0, 1.0)})
    assert after is not None
    for one, other in zip(before, after, strict=True):
        np.testing.assert_array_equal(one.now, other.now)

    later.relighting.forget_alone(but=["right"])
    assert later.relighting.mixed({"left": (2.0, 1.0, 1.0)}, {}) is None


def test_a_light_whose_gloss_was_broken_off_gets_it_by_the_next_request(lit: Lit) -> None:
    """An edit ends the steps of the pass with gloss, wherever it is."""
    mirroring = Lit(replace(lit.light, points=replace(lit.light.points, glossy=True)))
    alone = np.zeros_like(lit.emission)
    alone[LEFT] = 1.0
    asked = partial(mirroring.relighting.reflect_alone, "left", SceneLight(SkyState(None), alone))
    run_to_end(asked(NOTHING))
    steps, by_albedo = asked((3.0, 2.0, 1.0)), mirroring.n_reflected
    while mirroring.n_reflected == by_albedo:
        next(steps)
    steps.close()
    run_to_end(asked((3.0, 2.0, 1.0)))
    assert mirroring.n_reflected == by_albedo + 2  # the one that was broken off, and a whole one
    run_to_end(asked((3.0, 2.0, 1.0)))
    assert mirroring.n_reflected == by_albedo + 2


def test_lights_alone_are_not_taken_over_by_other_rays(lit: Lit) -> None:
    alone = np.zeros_like(lit.emission)
    alone[LEFT] = 1.0
    run_to_end(lit.relighting.reflect_alone("left", SceneLight(SkyState(None), alone), NOTHING))
    anew = Solver(lit.placement, dict.fromkeys(range(3), ["lambert"]), lit.sky, 3, QUICK)
    later = Lit(run_to_end(anew.solve(LAYERS)))
    later.relighting.take_over(lit.relighting)
    assert later.relighting.mixed({"left": (1.0, 1.0, 1.0)}, {}) is None


def reflected(light: IndirectLight, layers: list[IndirectLayer]) -> list[np.ndarray]:
    """What each layer reflects at its gather points, (p, 3)."""
    found = run_to_end(GatherPolynomial(light).reflect(layers, light.outgoing_radiance(layers)))
    return [each[:, 0] * light.unit for each in found]


@pytest.mark.parametrize("is_linked", [False, True])
def test_lights_alone_make_the_light_at_rest_and_any_mix_of_it(is_linked: bool) -> None:
    """A floor and a wall beside a wall of metal, which mirrors them and throws light on them; linked, it is lit by one
    lamp alone. By albedo a lamp that turns three times as bright would be a fifth off."""
    metal = indirect_layer(1, make_layer(MODELS["rough_conductor"], {"alpha": 0.2}), (64, 16))
    layers, names = [LAYERS[0], metal, LAYERS[2]], {0: ["lambert"], 1: ["rough_conductor"], 2: ["lambert"]}
    placement, dark = placement_of([*CORNER, *LAMPS], **CORNER_VIEW), SkyState(None)
    links = (LightLink(frozenset({1}), dark, frozenset({LEFT})),) if is_linked else ()
    sky = SkyState(sunny(), 20.0, links=links)
    solver = Solver(placement, names, sky, 3, QUICK)
    light, emission = run_to_end(solver.solve(layers)), placement.scene.emission
    representation = GatherPolynomial(light)
    lighting = SourceLighting(light, placement.scene, sky)
    lighting._n_samples = 1024
    relighting = IndirectRelighting(
        lighting, SceneLight(sky, emission), layers, partial(representation.reflect, layers)
    )
    rest = {"sky": (1.0, 1.0, 1.0), LEFT: (3.0, 2.0, 1.0), RIGHT: (1.0, 1.0, 4.0)}
    for key, weight in rest.items():
        alone = np.zeros_like(emission)
        alone[key if isinstance(key, int) else []] = 1.0
        own = replace(sky if key == "sky" else dark, links=() if key == RIGHT else links)
        run_to_end(relighting.reflect_alone(key, SceneLight(own, alone), weight))
    whole, at_rest = reflected(light, layers), relighting.mixed(rest, rest)
    assert at_rest is not None
    for layer, expected in zip(at_rest, whole, strict=True):
        np.testing.assert_array_equal(layer.now, layer.resting)
        # They differ by the noise of the records' light alone.
        assert np.sqrt(np.mean((layer.resting - expected) ** 2)) < 0.04 * expected.mean()
    now = {"sky": (0.1, 0.1, 0.1), LEFT: (9.0, 2.0, 1.0), RIGHT: (1.0, 1.0, 4.0)}
    brighter = copy(placement)
    brighter.scene = placement.scene.with_emission({"left": now[LEFT]})
    scaled = tuple(link._replace(sky=replace(link.sky, scale=0.1)) for link in links)
    truth = Solver(brighter, names, replace(sky, scale=0.1, links=scaled), 3, QUICK)
    mixed = relighting.mixed(now, rest)
    assert mixed is not None
    for layer, expected in zip(mixed, reflected(run_to_end(truth.solve(layers)), layers), strict=True):
        # Both have the noise of few rays; by eight times as many they are within 1 %.
        np.testing.assert_allclose(layer.now.mean(axis=0), expected.mean(axis=0), rtol=0.08)


def test_it_is_near_light_by_all_samples(lit: Lit) -> None:
    placement = copy(lit.placement)
    placement.scene = placement.scene.with_emission({"left": (6.0, 1.0, 0.5), "right": (0.0, 0.0, 0.0)})
    truth = run_to_end(relit(lit.light, placement, replace(lit.sky, rotation=140.0), QUICK, 3)).at_points(LAYERS)
    found = lit.picture(lit.under(140.0, left=(6.0, 1.0, 0.5), right=(0.0, 0.0, 0.0)))
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.08 * truth.mean()


def test_at_rest_nothing_is_added(lit: Lit) -> None:
    lit.under(200.0, left=(0.0, 0.0, 0.0))
    for layer in lit.under():
        np.testing.assert_array_equal(layer.now, layer.resting)
        np.testing.assert_array_equal(layer.gloss, 1.0)


def test_an_emitter_that_is_dimmed_is_reflected_once(lit: Lit) -> None:
    lit.under(left=(2.0, 2.0, 2.0))
    assert lit.n_reflected == 3  # the sky, the lamp that changes, the other one
    for radiance in (1.0, 0.5, 0.0, 3.0):
        lit.under(left=(radiance, radiance, radiance))
    assert lit.n_reflected == 3
    lit.under(40.0, left=(1.0, 1.0, 1.0))
    assert lit.n_reflected == 4  # the sky where it is now
    lit.under(left=(1.0, 1.0, 1.0))
    assert lit.n_reflected == 4  # and at rest


def test_gloss_follows_the_emitters_in_proportion_and_the_sky_as_far_as_it_is_alike() -> None:
    lit = Lit()
    dark = replace(lit.sky, environment=None)
    lighting = SourceLighting(lit.light, lit.placement.scene, dark)
    one_lamp = lit.emission.copy()
    one_lamp[RIGHT] = 0.0
    relighting = IndirectRelighting(lighting, SceneLight(dark, one_lamp), LAYERS, lit._reflect)
    for factor in (0.0, 0.25, 3.0):
        for layer in run_to_end(relighting.relit(SceneLight(dark, one_lamp * np.float32(factor)))):
            np.testing.assert_allclose(layer.now, factor * layer.resting, rtol=1e-5)
            np.testing.assert_allclose(layer.gloss, factor, rtol=1e-5)
    under_the_sun, turned = (lit.under(rotation)[1].gloss for rotation in (22.0, 140.0))
    assert 0.5 < under_the_sun.mean() < 1.0 and turned.mean() < under_the_sun.mean() - 0.1


def test_skies_are_as_alike_as_their_bright_directions() -> None:
    sky = SkyState(sunny(), 20.0)
    np.testing.assert_array_equal(sky_likeness(replace(sky), sky), 1.0)
    np.testing.assert_allclose(sky_likeness(replace(sky, scale=0.5), sky), 0.5, rtol=1e-6)
    near, far = (sky_likeness(replace(sky, rotation=rotation), sky).max() for rotation in (22.0, 200.0))
    assert 0.7 < near < 1.0 and far < 0.2
    assert not sky_likeness(SkyState(None), sky).any()


@pytest.mark.parametrize("degrees", [0.0, 35.0, -120.0])
def test_turned_lights_are_where_a_rotated_sky_has_them(degrees: float) -> None:
    lights, cut = sky_lights(cut_lights(sunny(), N_LIGHTS, 20.0)), cut_lights(sunny(), N_LIGHTS, 20.0 + degrees)
    share = np.diff(lights.cumulative, prepend=0.0)[:, None]
    found = (share * lights.power).T.astype(float) @ turned_lights(lights, degrees).corners.mean(axis=1)
    expected = cut.power.T.astype(float) @ cut.vertices[cut.corners].mean(axis=1)
    np.testing.assert_allclose(found, expected, atol=0.02 * float(cut.power.sum()))
