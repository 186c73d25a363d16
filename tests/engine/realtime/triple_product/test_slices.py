"""Slices have the energy of sharp lobes; of many glossy layers they are coarser, so that they take no more than they
may."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import qmc

from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core.terms import spherical, to_shading_frame
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.triple_product.slices import SliceLevels, _reflected, slice_bytes_of, table_bytes_of
from engine.realtime.triple_product.visibility import upper_triangles
from engine.reference.path_lobes import N_NUMBERS, Scattering
from engine.scene.description import parse_description
from engine.scene.scene_loader import Scene, build_scene
from engine.sphere.geodesic import geodesic
from tests.scene_text import camera, environment, placed, scaled

SIZE = 32, 24
BRUSHED = make_layer(MODELS["ward_anisotropic"], {})
FEW = 1 << 19  # bytes: each level has a few rows more than a quarter of the next


def metal(number: int) -> Layer:
    return make_layer(MODELS["rough_conductor"], {"alpha": 0.2 + 0.05 * number})


def n_bytes(level: int, is_isotropic: bool = True) -> int:
    return slice_bytes_of(level, is_isotropic) + table_bytes_of(level, is_isotropic)


def test_layers_have_the_finest_triangles_at_which_all_fit() -> None:
    terms = [(metal(i),) for i in range(6)]
    levels = SliceLevels(6 * n_bytes(4))
    levels.choose(terms)
    assert set(levels.of.values()) == {4} and levels.notes == ()
    levels = SliceLevels(6 * n_bytes(4) - 1)
    levels.choose(terms)
    assert list(levels.of.values()) == [4, 4, 4, 4, 4, 3] and "coarser" in levels.notes[0]
    levels = SliceLevels(4 * n_bytes(2) + 2 * n_bytes(3))
    levels.choose(terms)
    assert list(levels.of.values()) == [3, 3, 2, 2, 2, 2]
    levels = SliceLevels(1)
    levels.choose(terms)
    assert set(levels.of.values()) == {1}
    levels.choose([])
    assert levels.of == {} and levels.notes == ()


def test_a_sum_of_layers_counts_with_slices_of_its_own() -> None:
    """Two layers each for themselves, and their sum, which has a grain."""
    sums = [(metal(0), BRUSHED)]
    fits = slice_bytes_of(4, True) + slice_bytes_of(4, False) + n_bytes(4, False)
    for most, level in ((fits, 4), (fits - 1, 3)):
        levels = SliceLevels(most)
        levels.choose(sums)
        assert set(levels.of.values()) == {level}


@pytest.fixture(scope="module")
def scene() -> Scene:
    blocks = [placed(f"block {i}", "cube", scaled(0.5, (i - 1.5, 0.25, 0.3 * i))) for i in range(4)]
    text = camera((0.5, 2.0, 4.0), 40, SIZE) + environment() + "".join(blocks)
    return build_scene(parse_description(tomllib.loads(text), "blocks"), Path("blocks.toml"), SIZE)


def orbit_of(scene: Scene, layers: dict[int, list[Layer]], most_bytes: int) -> Orbit:
    made = Orbit(scene, n_points=200, n_coefficients=320, most_slice_bytes=most_bytes)
    image = np.random.default_rng(1).uniform(0.0, 2.0, (8, 16, 3)).astype(np.float32)
    made.set_light(SkyState(Environment(image, "noise")))
    made.set_bounces(1)
    made.set_layers(layers)
    return made


def pictures(orbit: Orbit, most_bytes: int) -> list[np.ndarray]:
    """Moving and at rest, when all is done; slices stay within these bytes all the while."""
    for _ in orbit.work():
        assert orbit.reflections.slice_bytes <= most_bytes
    assert orbit.is_done
    found = [orbit.draw(orbit.scene.description.camera, SIZE, quality) for quality in ("moving", "rest")]
    assert 0 < orbit.reflections.slice_bytes <= most_bytes
    return found


def test_many_metals_stay_within_their_bytes_and_look_alike(scene: Scene) -> None:
    layers = {i: [metal(2 * i)] for i in range(3)} | {3: [metal(1), BRUSHED]}
    unbounded = orbit_of(scene, layers, 1 << 30)
    exact = pictures(unbounded, 1 << 30)
    n_all = unbounded.reflections.slice_bytes
    assert unbounded.notes == () and n_all > 50e6
    just = pictures(orbit_of(scene, layers, n_all), n_all)
    for found, wanted in zip(just, exact, strict=True):
        np.testing.assert_array_equal(found, wanted)
    for most_bytes, off in ((n_all // 4 + FEW, 0.02), (n_all // 64 + FEW, 0.15)):
        bounded = orbit_of(scene, layers, most_bytes)
        found = pictures(bounded, most_bytes)
        assert "coarser" in bounded.notes[0] and bounded.reflections.slice_bytes > most_bytes // 2
        for one, wanted in zip(found, exact, strict=True):
            error = float(np.sqrt(((one - wanted) ** 2).mean()) / wanted.mean())
            print(most_bytes, error)
            assert 0.0 < error < off


def test_what_was_coarse_is_fine_again_when_there_are_few(scene: Scene) -> None:
    most_bytes = 2 * n_bytes(4) + FEW
    orbit = orbit_of(scene, {i: [metal(i)] for i in range(2)}, most_bytes)
    fine = pictures(orbit, most_bytes)
    orbit.set_layers({i: [metal(i)] for i in range(4)})
    assert orbit.reflections.slice_bytes <= most_bytes and not orbit.is_done
    pictures(orbit, most_bytes)
    orbit.set_layers({i: [metal(i)] for i in range(2)})
    for found, wanted in zip(pictures(orbit, most_bytes), fine, strict=True):
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("column", [0, 3])
@pytest.mark.parametrize("theta", [60.0, 81.3, 85.0])
def test_a_sharp_lobe_has_its_energy_at_grazing_angles(theta: float, column: int) -> None:
    # 2 α cos θ = 0.3 degrees wide at 85, where triangles of the finest level have 2.8: by the middles of their quarters
    # there was 33 % too much at 81.3 degrees and 108 % at 85. The truth draws directions from the lobe itself.
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.03})
    wo = spherical(np.radians([theta]), np.radians([4.5 * column]))
    scattering, numbers = Scattering([layer]), qmc.Sobol(N_NUMBERS, seed=1).random(4096)
    towards = np.tile(to_shading_frame(wo), (len(numbers), 1))
    wi = scattering.sample(numbers, towards)
    value, pdf = scattering.evaluate(wi, towards)
    exact = (value[pdf > 0.0] / pdf[pdf > 0.0, None]).sum(axis=0) / len(numbers)
    found = geodesic(4).solid_angles[upper_triangles()] @ _reflected(layer, wo[0], 1)
    np.testing.assert_allclose(found, exact, rtol=0.04)
