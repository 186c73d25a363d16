"""Bumps in pictures: the irradiance of a tilted plane below the true horizon, and one picture by three methods."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.reference.path_tracer import trace_paths
from engine.render.still import indirect_radiance, render_reference, render_still, still_layers, still_quality
from engine.scene.scene_loader import load_scene
from engine.settings import RenderSettings
from tests.engine.bump_images import FLOOR, TILT, write_bump_images
from tests.scene_text import LAMBERT, camera, placed, scaled


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bump_images(tmp_path_factory.mktemp("bumpy"))


def placement_of(folder: Path, bumps: str, more: str = "", size: int = 16) -> Placement:
    text = camera((0, 6, 0.01), 30, (size, size)) + placed(
        "floor", "quad", FLOOR, f'smooth = false\n{bumps}\nlayer = [{{ model = "lambert" }}]\n'
    )
    (folder / "scene.toml").write_text(text + more)
    return Placement(load_scene(folder / "scene.toml"))


def still(placement: Placement, layers: Mapping[str, Layer], sky: SkyState, n_lights: int = 2000) -> np.ndarray:
    """Direct light at the hits, (P, 3)."""
    plan = plan_scene(placement.scene, dict(layers), has_sky=True, still=True, settings=RenderSettings(n_lights))
    names = [described.name for described in placement.scene.description.objects]
    drawn = run_to_end(render_still(placement, still_layers(layers.items(), names, plan), sky, still_quality(plan)))
    return drawn.reshape(-1, 3)[placement.hits.pixel]


def traced(placement: Placement, layers: Mapping[str, Layer], sky: SkyState, n: int, bounces: int = 1) -> np.ndarray:
    by_object = {i: (layer,) for i, layer in enumerate(layers.values())}
    return run_to_end(trace_paths(placement, by_object, sky, bounces, n)).radiance


def lambert(albedo: float = 0.5) -> Layer:
    return make_layer(MODELS["lambert"], {"albedo": (albedo,) * 3})


@cache
def sun(height: float) -> SkyState:
    """A small sun over +X, so many degrees above the horizon, of irradiance 1 across its rays."""
    image = np.zeros((180, 360, 3), np.float32)
    row = round(90 - height)
    image[row - 1 : row + 1, 269:271] = 1.0
    theta = np.radians([row - 1, row, row + 1])
    image /= 2 * np.radians(1.0) * (np.cos(theta[0]) - np.cos(theta[2]))
    return SkyState(Environment(image, "test"))


def test_an_even_sky_lights_a_leaning_normal_as_a_plane_that_leans(folder: Path) -> None:
    # Above both horizons is a lune and half a sphere: E = pi (1 + cos tilt) / 2 of a sky of radiance 1.
    placement, layers = placement_of(folder, 'normal_map = { file = "lean.png" }'), {"floor.0": lambert()}
    sky, expected = SkyState(constant_environment(1.0)), 0.5 * (1 + np.cos(TILT)) / 2
    np.testing.assert_allclose(still(placement, layers, sky), expected, rtol=3e-3)
    assert traced(placement, layers, sky, 64).mean() == pytest.approx(expected, rel=5e-3)
    oracle = run_to_end(render_reference(placement, {0: (lambert(),)}, sky, 1, 4))
    np.testing.assert_allclose(oracle.reshape(-1, 3)[placement.hits.pixel], expected, rtol=5e-3)


@pytest.mark.parametrize("height", [60.0, 12.0])
@pytest.mark.parametrize("lean", [1, -1])
def test_a_sun_lights_it_by_its_cosine(folder: Path, height: float, lean: int) -> None:
    # Towards the sun or away from it; a sun at 12 degrees is below the horizon of what leans away by 26.6.
    bumps = f'normal_map = {{ file = "lean.png", repeats = [{lean}, 1] }}'
    placement, layers, sky = placement_of(folder, bumps, size=6), {"floor.0": lambert()}, sun(height)
    expected = 0.5 / np.pi * max(np.sin(np.radians(height) + lean * TILT), 0.0)
    np.testing.assert_allclose(still(placement, layers, sky), expected, rtol=0.02, atol=2e-4)
    assert traced(placement, layers, sky, 256).mean() == pytest.approx(expected, rel=0.02, abs=1e-6)


def test_a_sun_below_the_floor_lights_no_bump(folder: Path) -> None:
    # The floor is open below; a normal that leans to it must not let its light through.
    placement, layers = placement_of(folder, 'normal_map = { file = "lean.png", scale = 1.9 }', size=6), lambert()
    for drawn in (still(placement, {"floor.0": layers}, sun(-10)), traced(placement, {"a": layers}, sun(-10), 64)):
        np.testing.assert_array_equal(drawn, 0.0)


def test_a_flat_map_changes_no_bit(folder: Path) -> None:
    gloss = {"floor.0": make_layer(MODELS["rough_conductor"], {"alpha": 0.2})}
    pictures = [
        still(placement_of(folder, bumps, size=8), gloss, sun(40), 200)
        for bumps in ("", 'normal_map = { file = "flat.png" }', 'bump_map = { file = "bumps.png", scale = 0 }')
    ]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("model", ["lambert", "rough_conductor", "ward_anisotropic"])
def test_placement_and_oracles_see_the_same_bumps(folder: Path, model: str) -> None:
    """Seen at a slant, under a sky with a bright side, with a wall that shades."""
    placement = walled(folder, model)
    sky, layers = bright_side(), {"floor.0": make_layer(MODELS[model], {}), "wall.0": lambert(0.7)}
    mine = slice(*placement.hits.object_ranges[0])
    drawn, paths = still(placement, layers, sky)[mine], traced(placement, layers, sky, 256)[mine]
    by_object = {i: (layer,) for i, layer in enumerate(layers.values())}
    oracle = run_to_end(render_reference(placement, by_object, sky, 1, 5)).reshape(-1, 3)[placement.hits.pixel][mine]
    assert np.sqrt(np.mean((drawn - oracle) ** 2)) / oracle.mean() < 0.012
    assert drawn.mean() == pytest.approx(paths.mean(), rel=0.015)


def test_what_bounces_on_lights_bumps_alike(folder: Path) -> None:
    placement = walled(folder, "lambert")
    sky, layers = bright_side(), {"floor.0": lambert(0.6), "wall.0": lambert(0.8)}
    mine = slice(*placement.hits.object_ranges[0])
    plan = plan_scene(placement.scene, layers, has_sky=True, still=True, settings=RenderSettings(400))
    flat = still_layers(layers.items(), ["floor", "wall"], plan)
    bounced = run_to_end(indirect_radiance(placement, flat, sky, BounceSeries(2, 1)))[mine].mean()
    once, twice = (traced(placement, layers, sky, 512, n)[mine].mean() for n in (1, 2))
    assert bounced == pytest.approx(twice - once, rel=0.06)


def walled(folder: Path, model: str) -> Placement:
    wall = placed("wall", "quad", scaled((4, 1.5, 1), (-1.2, 0.7, -1.2)), LAMBERT)
    text = camera((0.5, 1.6, 3.5), 34, (18, 12), (0, 0.2, -0.4)) + placed(
        "floor", "quad", FLOOR,
        f'bump_map = {{ file = "bumps.png", height = 0.06, repeats = [6, 6] }}\nlayer = [{{ model = "{model}" }}]\n',
    )  # fmt: skip
    (folder / "scene.toml").write_text(text + wall)
    return Placement(load_scene(folder / "scene.toml"))


@cache
def bright_side() -> SkyState:
    """Smooth, as oracles and transport differ in how they look up between texels."""
    row, column = np.mgrid[0:64, 0:128]
    image = 0.3 + 6.0 * np.exp(-((row - 18.0) ** 2 + (column - 84.0) ** 2) / 60.0)
    return SkyState(Environment(np.repeat(image[..., None], 3, axis=2).astype(np.float32), "test"))
