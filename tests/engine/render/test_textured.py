"""Textures and weight maps in pictures: closed forms, the brute-force oracle, and paths of several bounces."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
from engine.material.layer_maps import LayerMaps
from engine.material.strokes import Stroke, Strokes, pack_dabs
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.reference.path_tracer import trace_paths
from engine.render.still import (
    indirect_radiance,
    render_reference,
    render_still,
    still_layers,
    still_quality,
    with_maps,
)
from engine.scene.map_sampler import MapFactors
from engine.scene.primary_hits import object_ids
from engine.scene.scene_loader import Scene, load_scene
from engine.settings import RenderSettings
from tests.scene_text import LAMBERT, camera, placed, scaled

# A card of two units, nearly filling 24 pixels,  that it throws light on.
ROOM = camera((0, 0, 5), 24, (24, 24)) + placed(
    "card", "quad", scaled((2, 2, 1)),
    'smooth = false\nlayer = [{ model = "lambert" }, { model = "phong" }]\n',
)  # fmt: skip
FLOOR = placed("floor", "quad", "2,0,0,0, 0,0,1,-1, 0,-1.5,0,0.8, 0,0,0,1", f"smooth = false\n{LAMBERT}")
SKY = SkyState(constant_environment(1.0))
RED, BLUE = np.array([1.0, 0.2, 0.2]), np.array([0.2, 0.2, 1.0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a checker of four fields, 64 texels each side, and a mask that grows to the right."""
    folder = tmp_path_factory.mktemp("textured")
    field = (np.indices((64, 64)) // 32).sum(axis=0) % 2
    codes = np.where(field[..., None] == 0, np.round(255 * RED), np.round(255 * BLUE)).astype(np.uint8)
    Image.fromarray(codes).save(folder / "checker.png")
    Image.fromarray(np.tile(np.arange(0, 256, 4, dtype=np.uint8), (64, 1))).save(folder / "mask.png")
    return folder


@pytest.fixture(scope="module")
def placement(folder: Path) -> Placement:
    return Placement(scene_of(folder, ROOM))


def scene_of(folder: Path, text: str) -> Scene:
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def layer(model: str, maps: LayerMaps | None = None, **parameters: object) -> Layer:
    return make_layer(MODELS[model], parameters).replace(maps=maps or LayerMaps())


def still(placement: Placement, layers: Mapping[str, Layer]) -> np.ndarray:
    names = [described.name for described in placement.scene.description.objects]
    plan = plan_scene(placement.scene, dict(layers), has_sky=True, still=True, settings=RenderSettings(400))
    seen = with_maps(placement, still_layers(layers.items(), names, plan))
    return run_to_end(render_still(placement, seen, SKY, still_quality(plan)), lambda step: None)


CHECKER = LayerMaps("checker.png", "linear")


def test_a_pixel_is_the_colour_times_the_untextured_pixel(placement: Placement) -> None:
    plain = still(placement, {"card.0": layer("lambert"), "card.1": layer("phong")})
    # Two layers under the same checker: all the card is multiplied by its colour, but for a texel about the edges.
    textured = still(placement, {"card.0": layer("lambert", CHECKER), "card.1": layer("phong", CHECKER)})
    x, y = placement.hits.position[:, 0], placement.hits.position[:, 1]
    inside = (np.abs(np.abs(x) - 0.5) < 0.35) & (np.abs(np.abs(y) - 0.5) < 0.35)
    pixels = placement.hits.pixel[inside]
    colour = np.where((x * y < 0)[inside, None], RED, BLUE)
    np.testing.assert_allclose(
        textured.reshape(-1, 3)[pixels], colour * plain.reshape(-1, 3)[pixels], rtol=2e-6, atol=1e-6
    )
    assert len(pixels) > 200


def test_strength_leads_from_white_to_the_texture(placement: Placement) -> None:
    lambert = [
        still(placement, {"card.0": layer("lambert", maps)})
        for maps in (LayerMaps(), LayerMaps("checker.png", "linear", texture_strength=0.25), CHECKER)
    ]
    np.testing.assert_allclose(lambert[1], 0.75 * lambert[0] + 0.25 * lambert[2], rtol=1e-5, atol=1e-6)
    none = still(placement, {"card.0": layer("lambert", LayerMaps("checker.png", texture_strength=0.0))})
    np.testing.assert_allclose(none, lambert[0], rtol=1e-6)


def test_a_layer_by_weight_and_by_its_complement_is_the_layer(placement: Placement) -> None:
    whole = still(placement, {"card.0": layer("phong")})
    parts = {
        "card.0": layer("phong", LayerMaps(weight="mask.png")),
        "card.1": layer("phong", LayerMaps(weight="mask.png", weight_invert=True)),
    }
    np.testing.assert_allclose(still(placement, parts), whole, rtol=2e-5, atol=1e-6)
    # Black on the left, so that what is weighted is there on the right alone.
    part = still(placement, {"card.0": parts["card.0"]})
    assert part[12, 2].max() < 0.1 * whole[12, 2].max() and part[12, 21].min() > 0.9 * whole[12, 21].min()


def test_the_oracle_of_direct_light_has_the_same_factors(placement: Placement) -> None:
    layers = {"card.0": layer("lambert", CHECKER), "card.1": layer("phong", LayerMaps(weight="mask.png"), exponent=8.0)}
    steps = render_reference(placement, {0: tuple(layers.values())}, SKY, 1, 3)
    oracle = run_to_end(steps, lambda step: None)
    error = np.sqrt(np.mean((still(placement, layers) - oracle) ** 2)) / oracle.mean()
    assert error < 0.02  # 1,280 directions against 400 lights of an even sky


def test_strokes_are_the_same_to_the_camera_and_to_paths(placement: Placement) -> None:
    dab = Stroke(0.6, 1.0, 0.75, 1.0, pack_dabs([0.2, 0.1, 0.0], [0.0, 0.0, 1.0]))
    maps = LayerMaps(weight_start=0.0, strokes=Strokes((dab,)))
    factors, hits = MapFactors(placement.scene, {0: [layer("lambert"), layer("phong", maps)]}), placement.hits
    rays = hits.ray_directions.reshape(-1, 3)
    found = placement.caster.intersect(
        np.tile(placement.scene.camera_position.astype(np.float32), (len(rays), 1)), rays
    )
    seen, met = (
        factors.at_primary_hits(placement.caster, placement.hits),
        factors.at_path_vertices(found, object_ids(placement.scene, found), hits.pixel),
    )
    np.testing.assert_allclose(met, seen, atol=1e-5)
    far = np.linalg.norm(hits.position - [0.2, 0.1, 0.0], axis=1)
    assert (seen[:, 0] == 1.0).all() and (seen[far < 0.55, 1] == 0.75).all() and (seen[far > 0.6, 1] == 0.0).all()


@pytest.fixture(scope="module")
def corner(folder: Path) -> Placement:
    return Placement(scene_of(folder, ROOM.replace("[0, 0, 5]", "[0, 2, 5]") + FLOOR))


def test_further_bounces_see_the_mean(corner: Placement) -> None:
    # Two bounces: the floor is lit by the card, whose checker is (0.6, 0.2, 0.6) on average; paths see the fields.
    maps = LayerMaps("checker.png", "linear", (8.0, 8.0))
    layers = {"card.0": layer("lambert", maps, albedo=0.9), "floor.0": layer("lambert", albedo=0.8)}
    names = [described.name for described in corner.scene.description.objects]
    plan = plan_scene(corner.scene, layers, has_sky=True, still=True, settings=RenderSettings(400))
    seen = with_maps(corner, still_layers(layers.items(), names, plan))
    np.testing.assert_allclose(seen[0].mean_factor, [0.6, 0.2, 0.6], atol=2e-3)
    indirect = run_to_end(indirect_radiance(corner, seen, SKY, BounceSeries(2)), lambda step: None)
    found = run_to_end(render_still(corner, seen, SKY, still_quality(plan), indirect), lambda step: None)
    steps = trace_paths(corner, {0: [layers["card.0"]], 1: [layers["floor.0"]]}, SKY, 2, 256)
    paths = run_to_end(steps, lambda step: None)
    pixels = found.reshape(-1, 3)[corner.hits.pixel]
    error = np.sqrt(np.mean((pixels - paths.radiance) ** 2)) / paths.radiance.mean()
    assert error < 0.04 and abs(pixels.mean() / paths.radiance.mean() - 1.0) < 0.01  # the paths' noise is 0.023
    # Without the card's colours the floor would be lit by half as much more.
    floor = slice(*corner.hits.object_ranges[1])
    white = with_maps(corner, still_layers({**layers, "card.0": layer("lambert", albedo=0.9)}.items(), names, plan))
    plain = run_to_end(indirect_radiance(corner, white, SKY, BounceSeries(2)), lambda step: None)
    ratio = indirect[floor].mean(axis=0) / plain[floor].mean(axis=0)
    np.testing.assert_allclose(ratio, [0.6, 0.2, 0.6], atol=0.03)
