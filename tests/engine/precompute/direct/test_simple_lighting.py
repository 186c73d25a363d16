"""Simple lighting: nothing hides the sky or a lamp, and one distant light brings what the scene's light brings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.bandstore import BandStore
from engine.precompute.direct.pipeline import COARSE, DRAG, FINAL, PREVIEW, Placement, SkyState
from engine.precompute.direct.projection import LayerShape, project_layer
from engine.precompute.direct.simple_lighting import (
    distant_light,
    simple_lighting,
    strongest_light,
    texel_direction,
)
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, facing_down, facing_up, placed, scaled

GROUND = camera((0, 4, 0.01), 40, (33, 33)) + placed("ground", "quad", facing_up(20))
LAMP = placed("lamp", "quad", facing_down(1, (1.5, 1, 0)), "emission = [2, 2, 2]\n")
BALL = placed("ball", "sphere", scaled(1, (0, 1, 0)))


def placement_of(text: str, folder: Path) -> Placement:
    path = folder / "scene.toml"
    path.write_text(text)
    return Placement(load_scene(path))


def radiance(placement: Placement, sky: SkyState, quality, rows, model="lambert", **values) -> np.ndarray:
    """Radiance (len(rows), 3) of one layer."""
    light = run_to_end(placement.light(sky, quality), lambda fraction: None)
    layer = make_layer(MODELS[model], values)
    n_bands = (64, 8) if len(layer.model.factors) == 2 else (64, 1)
    shape = LayerShape(model, tuple(layer.quotient_parameters().tolist()), n_bands)
    store = BandStore(n_bands, tuple(project_layer(placement.hits, rows, light, shape)))
    curves = [layer.coefficients(factor.name, n) for factor, n in zip(layer.model.factors, n_bands, strict=False)]
    return light.lighting.unit * store.radiance(*curves, *[np.ones((1, 3))] * (2 - len(curves)))


@pytest.mark.parametrize("quality", [COARSE, PREVIEW, FINAL, DRAG], ids=lambda quality: quality.name)
def test_a_ball_hides_nothing(tmp_path: Path, quality) -> None:
    # Under a constant sky of radiance 3 the ground beneath a ball receives π L, as without it.
    placement = placement_of(GROUND + BALL, tmp_path)
    bare, sky = simple_lighting(placement, SkyState(constant_environment(2.0), scale=1.5), "no_shadows")
    rows = placement.rows_of(0, quality.stride)
    shown = radiance(bare, sky, quality, rows)
    ground = placement_of(GROUND, tmp_path)
    alone = radiance(ground, sky, quality, ground.rows_of(0, quality.stride))
    np.testing.assert_allclose(shown, alone.mean(), rtol=1e-2)
    # With shadows the ground below the ball is darker: the test can fail.
    assert radiance(placement, sky, FINAL, placement.rows_of(0)).min() < 0.9 * shown.mean()
    assert placement.has_shadows and not bare.has_shadows


def test_without_shadows_an_object_looks_as_it_does_alone(tmp_path: Path) -> None:
    # A glossy ball beside a wall and below a lid: the picture of it that the whole way makes where it is alone.
    sun = np.full((16, 32, 3), 0.3, np.float32)
    sun[4, 20] = 30.0
    sky = SkyState(Environment(sun, "a sun"), rotation=20.0)
    view = camera((0, 1, 5), 35, (24, 24))
    lid = placed("lid", "quad", facing_down(6, (0, 2.2, 0))) + placed("wall", "quad", scaled((6, 6, 1), (0, 1, -1.5)))
    ball = placed("ball", "sphere", scaled(1, (0, 1, 0)))
    alone = placement_of(view + ball, tmp_path)
    expected = radiance(alone, sky, FINAL, alone.rows_of(0), "cook_torrance", sigma=0.3)
    among = placement_of(view + ball + lid, tmp_path)
    bare, same = simple_lighting(among, sky, "no_shadows")
    assert same is sky
    found = radiance(bare, sky, FINAL, bare.rows_of(0), "cook_torrance", sigma=0.3)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.02 * expected.mean()
    hidden = radiance(among, sky, FINAL, among.rows_of(0), "cook_torrance", sigma=0.3)
    assert np.sqrt(np.mean((hidden - expected) ** 2)) > 0.1 * expected.mean()


def test_nothing_hides_a_lamp_either(tmp_path: Path) -> None:
    no_sky = SkyState(None)
    lit = placement_of(GROUND + LAMP, tmp_path)
    expected = radiance(lit, no_sky, FINAL, lit.rows_of(0))
    lid = placed("lid", "quad", facing_down(1.5, (1.5, 0.5, 0)))
    hidden = placement_of(GROUND + LAMP + lid, tmp_path)
    bare, _ = simple_lighting(hidden, no_sky, "no_shadows")
    # The lid covers what the camera sees of the ground below it; of the rest each point is one of the other scene's.
    rows = hidden.rows_of(0)
    same = np.isin(lit.hits.pixel[lit.rows_of(0)], hidden.hits.pixel[rows])
    found = radiance(bare, no_sky, FINAL, rows)
    assert np.sqrt(np.mean((found - expected[same]) ** 2)) < 0.02 * expected.mean()
    assert radiance(hidden, no_sky, FINAL, rows).mean() < 0.8 * found.mean()


def test_one_light_is_as_bright_as_the_sky_on_average(tmp_path: Path) -> None:
    # A constant sky of radiance L: E = 4 π L facing the light, so that the ground, at an angle of its own, has E cos.
    placement = placement_of(GROUND + BALL, tmp_path)
    sky = SkyState(constant_environment(2.0), scale=1.5)
    towards, irradiance = strongest_light(placement, sky)
    assert irradiance == pytest.approx(np.full(3, 4.0 * np.pi * 3.0), rel=1e-3)
    bare, point = simple_lighting(placement, sky, "point_light")
    rows = placement.rows_of(0)
    ground = radiance(bare, point, FINAL, rows)
    unlit = radiance(placement.without_shadows(), SkyState(constant_environment(1.0)), FINAL, rows)
    reflectance = unlit.mean() / np.pi  # of the ground, per irradiance: under the sky E is π where nothing hides it
    assert ground == pytest.approx(np.full_like(ground, 12.0 * np.pi * max(towards[1], 0.0) * reflectance), rel=0.01)


@pytest.mark.parametrize("rotation", [0.0, 75.0, -140.0])
def test_the_one_light_shines_from_the_brightest_place(tmp_path: Path, rotation: float) -> None:
    image = np.full((64, 128, 3), 0.1, np.float32)
    image[20:22, 90:92] = (50.0, 40.0, 30.0)
    environment = Environment(image, "a sun")
    placement = placement_of(GROUND, tmp_path)
    towards, irradiance = strongest_light(placement, SkyState(environment, rotation))
    # What the environment itself says of that direction: the sun.
    assert environment.evaluate(towards[None], rotation)[0, 0] > 25.0
    assert irradiance[0] > irradiance[1] > irradiance[2] > 0.0
    light = distant_light(towards, irradiance)
    assert light.evaluate(towards[None])[0, 0] > 0.0 and np.count_nonzero(light.radiance[..., 0]) == 1


def test_a_texel_is_where_the_environment_has_it() -> None:
    image = np.zeros((8, 16, 3), np.float32)
    image[2, 11] = 1.0
    environment = Environment(image, "one texel")
    for rotation in (0.0, 30.0):
        towards = texel_direction(2, 11, 8, 16, rotation)
        assert environment.evaluate(towards[None], rotation)[0] == pytest.approx([1.0, 1.0, 1.0], abs=1e-6)


def test_a_lamp_becomes_a_distant_light(tmp_path: Path) -> None:
    placement = placement_of(GROUND + LAMP, tmp_path)
    towards, irradiance = strongest_light(placement, SkyState(None))
    middle = placement.hits.position.mean(axis=0)
    expected = np.array([1.5, 1.0, 0.0]) - middle
    assert towards @ (expected / np.linalg.norm(expected)) > 0.98 and (irradiance > 0.0).all()
    bare, sky = simple_lighting(placement, SkyState(None), "point_light")
    assert bare.emitters(32) is None and sky.environment is not None
    # The scene's own placement keeps its lamp.
    assert placement.emitters(32) is not None


def test_in_place_nothing_is_changed(tmp_path: Path) -> None:
    placement, sky = placement_of(GROUND, tmp_path), SkyState(constant_environment(1.0))
    assert simple_lighting(placement, sky, "scene") == (placement, sky)
