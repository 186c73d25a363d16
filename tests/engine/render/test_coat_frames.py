"""Coats whose normals are not those of what they lie on: layers of the coat's frame against closed forms, brute force
and paths."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.reference.path_tracer import trace_halves, trace_paths
from engine.render.still import indirect_radiance, render_reference, render_still, still_layers, still_quality
from engine.scene.scene_loader import load_scene
from engine.settings import RenderSettings
from tests.engine.bump_images import FLOOR, write_bump_images
from tests.scene_text import LAMBERT, camera, placed, scaled

LEAN = 'normal_map = { file = "lean.png" }'
COAT_LEANS = 'coat_normal_map = { file = "lean.png" }'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bump_images(tmp_path_factory.mktemp("coats"))


def placement_of(
    folder: Path, bumps: str, more: str = "", size: tuple[int, int] = (8, 6), layers: str = '{ model = "lambert" }'
) -> Placement:
    text = camera((0.5, 1.6, 3.5), 34, size, (0, 0.2, -0.4))
    text += placed("floor", "quad", FLOOR, f"smooth = false\n{bumps}\nlayer = [{layers}]\n")
    (folder / "scene.toml").write_text(text + more)
    return Placement(load_scene(folder / "scene.toml"))


def layers_of(frame: str = "coat") -> tuple[Layer, ...]:
    base = make_layer(MODELS["lambert"], {"albedo": (0.5,) * 3}).replace(under="coat")
    coat = make_layer(MODELS["clearcoat"], {"alpha": 0.15}, "coat").replace(frame=frame)
    return base.replace(covers=(coat,)), coat


@cache
def sky() -> SkyState:
    """Smooth, with a bright side."""
    row, column = np.mgrid[0:64, 0:128]
    image = 0.3 + 6.0 * np.exp(-((row - 18.0) ** 2 + (column - 84.0) ** 2) / 60.0)
    return SkyState(Environment(np.repeat(image[..., None], 3, axis=2).astype(np.float32), "test"))


def still(placement: Placement, layers: tuple[Layer, ...]) -> np.ndarray:
    """Direct light at the floor's hits, (P, 3)."""
    keys = {f"floor.{i}": layer for i, layer in enumerate(layers)}
    names = [described.name for described in placement.scene.description.objects]
    plan = plan_scene(placement.scene, keys, has_sky=True, still=True, settings=RenderSettings(2000))
    drawn = run_to_end(render_still(placement, still_layers(keys.items(), names, plan), sky(), still_quality(plan)))
    return drawn.reshape(-1, 3)[placement.hits.pixel][slice(*placement.hits.object_ranges[0])]


def test_a_layer_alone_in_the_coats_frame_is_one_of_a_base_with_its_map(folder: Path) -> None:
    gloss = make_layer(MODELS["rough_conductor"], {"alpha": 0.2})
    expected = still(placement_of(folder, LEAN), (gloss,))
    found = still(placement_of(folder, COAT_LEANS), (gloss.replace(frame="coat"),))
    np.testing.assert_array_equal(found, expected)


def test_a_coat_without_a_map_is_that_of_a_smooth_base(folder: Path) -> None:
    bumpy, smooth = (placement_of(folder, bumps) for bumps in (LEAN, ""))
    base, coat = layers_of()
    # The coat's share of the light, and what it takes from a base of the coat's frame.
    for layers in ((coat,), (base.replace(frame="coat"), coat)):
        np.testing.assert_array_equal(still(bumpy, layers), still(smooth, layers))


def test_a_flat_map_of_the_coat_changes_no_bit(folder: Path) -> None:
    bumps = f'{LEAN}\ncoat_normal_map = {{ file = "flat.png" }}'
    found, expected = (still(placement_of(folder, each), layers_of()) for each in (bumps, LEAN))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("bumps", [LEAN, COAT_LEANS])
def test_placement_and_oracles_see_both_frames(folder: Path, bumps: str) -> None:
    placement, layers = placement_of(folder, bumps, size=(18, 12)), layers_of()
    drawn = still(placement, layers)
    oracle = run_to_end(render_reference(placement, {0: layers}, sky(), 1, 5)).reshape(-1, 3)[placement.hits.pixel]
    paths = run_to_end(trace_paths(placement, {0: layers}, sky(), 1, 256)).radiance
    of_base = still(placement, layers_of("base"))
    assert np.sqrt(np.mean((drawn - oracle) ** 2)) / oracle.mean() < 0.012
    assert drawn.mean() == pytest.approx(paths.mean(), rel=0.01)
    assert np.sqrt(np.mean((of_base - oracle) ** 2)) / oracle.mean() > 0.1  # what the test can tell apart


@pytest.mark.parametrize("bumps", [LEAN, COAT_LEANS])
def test_what_bounces_on_is_reflected_in_both_frames(folder: Path, bumps: str) -> None:
    wall = placed("wall", "quad", scaled((4, 1.5, 1), (-1.2, 0.7, -1.2)), LAMBERT)
    layers = (*layers_of(), make_layer(MODELS["lambert"]))
    keys = {"floor.0": layers[0], "floor.1": layers[1], "wall.0": layers[2]}
    placement = placement_of(folder, bumps, wall)
    mine = slice(*placement.hits.object_ranges[0])
    rows = np.arange(mine.start, mine.stop)
    halves = run_to_end(trace_halves(placement, {0: layers[:2], 1: layers[2:]}, sky(), 2, 2048, 0, rows))
    direct, all_light = halves.mean(axis=(0, 1, 3))
    # Whichever frame the layers of the scene's file, and with them the rays, have.
    for each in (placement, placement_of(folder, bumps, wall, layers='{ model = "lambert", frame = "coat" }')):
        plan = plan_scene(each.scene, keys, has_sky=True, still=True, settings=RenderSettings(400))
        own = still_layers(keys.items(), ["floor", "wall"], plan)
        bounced = run_to_end(indirect_radiance(each, own, sky(), BounceSeries(2, 1)))[mine].mean()
        assert bounced == pytest.approx(all_light - direct, rel=0.08)  # 5 % too little for the base alone as well
