"""Bumps in Orbit: closed forms of a leaning normal, and the pictures that Placement makes of the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS, make_layer
from engine.material.bumps import NO_BUMPS
from engine.material.layer import Layer
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.render.still import render_still, still_layers, still_quality
from engine.scene.scene_loader import Scene, load_scene
from engine.settings import RenderSettings
from tests.engine.bump_images import FLOOR, TILT, write_bump_images
from tests.scene_text import camera, placed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bump_images(tmp_path_factory.mktemp("orbit_bumps"))


def scene_of(folder: Path, bumps: str, slanted: bool = False) -> Scene:
    seen = camera((0.5, 1.6, 3.5), 34, (24, 16), (0, 0.2, -0.4)) if slanted else camera((0, 6, 0.01), 30, (12, 12))
    text = seen + placed("floor", "quad", FLOOR, f'smooth = false\n{bumps}\nlayer = [{{ model = "lambert" }}]\n')
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def drawn(scene: Scene, layer: Layer | tuple[Layer, ...], sky: SkyState, quality: str) -> np.ndarray:
    orbit = Orbit(scene, n_points=400)
    orbit.set_bounces(1)
    orbit.set_light(sky)
    orbit.set_layers({0: (layer,) if isinstance(layer, Layer) else layer})
    for _ in orbit.work():
        pass
    return orbit.draw(scene.description.camera, scene.resolution, quality)


def lambert() -> Layer:
    return make_layer(MODELS["lambert"], {"albedo": (0.5,) * 3})


def sunny(height: float) -> SkyState:
    """A small sun over +X, so many degrees above the horizon, in an even sky."""
    image = np.full((180, 360, 3), 0.1, np.float32)
    row = round(90 - height)
    image[row - 1 : row + 1, 269:271] = 1000.0
    return SkyState(Environment(image, "test"))


@pytest.mark.parametrize("quality", ["moving", "rest", "still"])
def test_an_even_sky_lights_a_leaning_normal_as_a_plane_that_leans(folder: Path, quality: str) -> None:
    scene = scene_of(folder, 'normal_map = { file = "lean.png" }')
    picture = drawn(scene, lambert(), SkyState(constant_environment(1.0)), quality)
    np.testing.assert_allclose(picture, 0.5 * (1 + np.cos(TILT)) / 2, rtol=0.01)


@pytest.mark.parametrize(("lean", "quality", "within"), [(1, "rest", 0.01), (-1, "rest", 0.01), (1, "moving", 0.06)])
def test_a_sun_lights_it_by_its_cosine(folder: Path, lean: int, quality: str, within: float) -> None:
    # While something moves, what comes from above is taken for a sky's: by (1 - cos 27°) / 2 = 5 % too much.
    flat, sky = scene_of(folder, ""), sunny(50.0)
    scene = scene_of(folder, f'normal_map = {{ file = "lean.png", repeats = [{lean}, 1] }}')
    of_sky = 0.05 * (1 + np.cos(TILT)) / 2
    bumpy, plain = (drawn(each, lambert(), sky, quality).mean() for each in (scene, flat))
    ratio = np.sin(np.radians(50.0) + lean * TILT) / np.sin(np.radians(50.0))
    assert (bumpy - of_sky) / (plain - 0.05) == pytest.approx(ratio, rel=within)


def test_a_flat_map_changes_no_bit(folder: Path) -> None:
    layer = make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
    plain, flat = scene_of(folder, ""), scene_of(folder, 'normal_map = { file = "flat.png" }')
    pictures = [drawn(scene, layer, sunny(50.0), "rest") for scene in (plain, flat)]
    np.testing.assert_array_equal(*pictures)


def test_bumps_may_be_set_at_any_time(folder: Path) -> None:
    flat, bumpy = scene_of(folder, ""), scene_of(folder, 'normal_map = { file = "lean.png" }')
    orbit = Orbit(flat, n_points=400)
    orbit.set_light(sunny(50.0))
    orbit.set_layers({0: (lambert(),)})
    for _ in orbit.work():
        pass
    before, version = orbit.draw(flat.description.camera, (12, 12)), orbit.version
    orbit.set_bumps({"floor": bumpy.description.objects[0].bumps})
    assert orbit.version > version and not orbit.is_done  # what is matt keeps more of the light under bumps
    for _ in orbit.work():
        pass
    after = orbit.draw(flat.description.camera, (12, 12))
    assert after.mean() > 1.1 * before.mean()
    orbit.set_bumps({"floor": NO_BUMPS})
    np.testing.assert_array_equal(orbit.draw(flat.description.camera, (12, 12)), before)


@pytest.mark.parametrize(("model", "parameters", "rest", "still"), [
    ("lambert", {}, 0.03, 0.03), ("rough_conductor", {"alpha": 0.25}, 0.15, 0.04), ("oren_nayar", {}, 0.06, 0.03),
])  # fmt: skip
def test_it_is_placements_picture(
    folder: Path, model: str, parameters: dict[str, float], rest: float, still: float
) -> None:
    bumps = 'bump_map = { file = "bumps.png", height = 0.06, repeats = [6, 6] }'
    errors = errors_in_placement(folder, bumps, (make_layer(MODELS[model], parameters),))
    assert errors["rest"] < rest and errors["still"] < still


@pytest.mark.parametrize("bumps", ["normal_map", "coat_normal_map"])
def test_coats_have_normals_of_their_own(folder: Path, bumps: str) -> None:
    base = make_layer(MODELS["lambert"], {"albedo": (0.5,) * 3})
    coat = make_layer(MODELS["clearcoat"], {"alpha": 0.3}, "coat").replace(frame="coat")
    layers, lean = (base.replace(under="coat", covers=(coat,)), coat), f'{bumps} = {{ file = "lean.png" }}'
    errors = errors_in_placement(folder, lean, layers)
    # A highlight at rest is looked up from where the unperturbed surface mirrors alike, at another Fresnel factor: 0.42
    # without the ratio of the two.
    assert errors["rest"] < 0.08 and errors["still"] < 0.03
    alike = tuple(
        each.replace(frame="base", covers=tuple(c.replace(frame="base") for c in each.covers)) for each in layers
    )
    assert min(errors_in_placement(folder, lean, layers, alike).values()) > 0.1  # what the test can tell apart


def errors_in_placement(
    folder: Path, bumps: str, layers: tuple[Layer, ...], others: tuple[Layer, ...] = ()
) -> dict[str, float]:
    """The error of the layers, or of others in their place, against Placement's picture, by quality."""
    scene = scene_of(folder, bumps, slanted=True)
    row = np.mgrid[0:64, 0:128]
    image = 0.3 + 6.0 * np.exp(-((row[0] - 18.0) ** 2 + (row[1] - 84.0) ** 2) / 60.0)
    sky = SkyState(Environment(np.repeat(image[..., None], 3, axis=2).astype(np.float32), "test"))
    placement, keys = Placement(scene), {f"floor.{i}": layer for i, layer in enumerate(layers)}
    plan = plan_scene(scene, keys, has_sky=True, still=True, settings=RenderSettings(1000))
    every = still_layers(keys.items(), ["floor"], plan)
    expected = run_to_end(render_still(placement, every, sky, still_quality(plan)))
    wanted, found = expected.reshape(-1, 3)[placement.hits.pixel], {}
    for quality in ("rest", "still"):
        picture = drawn(scene, others or layers, sky, quality).reshape(-1, 3)[placement.hits.pixel]
        found[quality] = float(np.sqrt(np.mean((picture - wanted) ** 2)) / wanted.mean())
    return found


def test_sharp_gloss_shows_bumps_while_something_moves(folder: Path) -> None:
    bumpy = scene_of(folder, 'bump_map = { file = "bumps.png", height = 0.06, repeats = [6, 6] }', slanted=True)
    flat, layer = scene_of(folder, "", slanted=True), make_layer(MODELS["rough_conductor"], {"alpha": 0.1})
    row = np.mgrid[0:64, 0:128]
    image = 0.3 + 6.0 * np.exp(-((row[0] - 18.0) ** 2 + (row[1] - 84.0) ** 2) / 60.0)
    image[14:16, 82:86] = 40.0
    sky = SkyState(Environment(np.repeat(image[..., None], 3, axis=2).astype(np.float32), "test"))
    still, moving, without = drawn(bumpy, layer, sky, "still"), *(drawn(s, layer, sky, "moving") for s in (bumpy, flat))

    def off(picture: np.ndarray) -> float:
        return float(np.sqrt(np.mean((picture - still) ** 2)) / still.mean())

    assert off(moving) < 0.5 * off(without)
