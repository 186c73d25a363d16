"""Parameters that vary over a surface, in pictures: weights of texels, and the path tracer's formula at each hit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.document.described import document_from_description
from app.document.document import Document
from app.document.node_layers import channel_images, with_node_layers
from engine.core.errors import LoadError
from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material.layer import Layer
from engine.material.layer_maps import ChannelImage, ChannelWeight, LayerMaps, TextureTransform
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.reference.path_tracer import trace_paths
from engine.reference.texel_parameters import evaluate_layers_by_texel
from engine.scene.map_sampler import MapFactors, MapSampler
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import LEANING_LAMP, camera, material, placed

HEAD = camera((0, 0, 3), 20, (24, 24))
METAL = 'model = "rough_conductor", name = "metal", alpha = 0.3'
ROUGH = METAL + ', parameter_maps = { alpha = { map = "rough.png", range = [0.2, 0.6] } }'
CLAMPED = TextureTransform(wrap=("clamp", "clamp"))


def write(path: Path, pixels: np.ndarray) -> None:
    Image.fromarray(np.asarray(pixels, np.uint8)).save(path)


def opened(folder: Path, layer: str, pixels: np.ndarray, more: str = "", shape: str = "quad") -> tuple[Scene, Document]:
    write(folder / "rough.png", pixels)
    (folder / "scene.toml").write_text(HEAD + placed("card", shape, more=material(layer)) + more)
    scene = load_scene(folder / "scene.toml")
    return scene, document_from_description(str(folder / "scene.toml"), scene.description)


def with_nodes(scene: Scene, document: Document, n: int | None = None) -> tuple[Layer, ...]:
    statistics = {image: scene.textures.channel_statistics(image) for image in channel_images(document)}
    return with_node_layers(document, statistics, n).object("card").layers


def weight(knots: tuple[float, ...], weights: tuple[float, ...], **image: object) -> ChannelWeight:
    return ChannelWeight(ChannelImage("rough.png", **image), knots, weights, weights)  # type: ignore[arg-type]


def test_texels_are_weighted_before_they_are_filtered(tmp_path: Path) -> None:
    # A pixel sees the middles of black and white tiles alike: half of the weight at 0, half of that at 1, and none of
    # that at 0.5 but in the eighth of the card where tiles meet, (4.6 + 4.8) / 2 on average.
    tiles = np.tile((np.arange(256) // 8 % 2 * 255).astype(np.uint8), (8, 1))
    scene, _ = opened(tmp_path, METAL, tiles)
    maps = LayerMaps(node_weights=(weight((0.0, 0.5, 1.0), (0.2, 9.0, 0.6)),))
    caster_hits = Placement(scene)
    seen = MapSampler(scene, caster_hits.caster, caster_hits.hits).sample(0, maps.images)
    expected = 7 / 8 * 0.4 + 1 / 8 * 4.7
    assert seen.texture.mean() == pytest.approx(expected, rel=0.02)
    assert seen.means.factor(maps) == pytest.approx([expected] * 3, rel=0.02)


def test_between_texels_the_map_is_interpolated_and_not_its_weights(tmp_path: Path) -> None:
    # The card is two texels, black and white: from the middle of one to that of the other the weight is a hat.
    scene, _ = opened(tmp_path, METAL, np.array([[0, 255]]))
    maps = LayerMaps(node_weights=(weight((0.0, 0.5, 1.0), (0.0, 1.0, 0.0), transform=CLAMPED),))
    placement = Placement(scene)
    seen = MapSampler(scene, placement.caster, placement.hits).sample(0, maps.images)
    x = placement.hits.position[:, 0] + 0.5
    # Four texels of the finer grid for each: the hat of the map's value at its texels.
    grid = (np.arange(8) + 0.5) / 8
    hat = 1.0 - np.abs(2.0 * np.clip(2.0 * grid - 0.5, 0.0, 1.0) - 1.0)
    assert hat.max() == 0.75  # interpolated weights would be 0 everywhere
    np.testing.assert_allclose(seen.texture[:, 0], np.interp(x, grid, hat), atol=0.03)


def test_weights_multiply_the_texture_and_each_other_texel_by_texel(tmp_path: Path) -> None:
    # Red where the map is black, which has a weight of 0.5; blue where it is white, with weights of 1 and 0.25.
    half = np.zeros((8, 8), np.uint8)
    half[:, 4:] = 255
    scene, _ = opened(tmp_path, METAL, half)
    colours = np.zeros((8, 8, 3), np.uint8)
    colours[:, :4, 0] = colours[:, 4:, 2] = 255
    write(tmp_path / "colours.png", colours)
    one, two = weight((0.0, 1.0), (0.5, 1.0)), weight((0.0, 1.0), (1.0, 0.25), channel="g")
    maps = LayerMaps("colours.png", "linear", node_weights=(one, two))
    found = scene.textures.texture(maps.images)
    middles = np.array([[0.25, 0.5], [0.75, 0.5]])
    assert found is not None
    np.testing.assert_allclose(found.at(middles), [[0.5, 0, 0], [0, 0, 0.25]])
    # At half its strength the texture is half white; the strength is in the texels.
    pale = LayerMaps("colours.png", "linear", texture_strength=0.5, node_weights=(one,))
    texels = scene.textures.texture(pale.images).at(middles)
    np.testing.assert_allclose(texels, [[0.5, 0.25, 0.25], [0.5, 0.5, 1.0]])
    np.testing.assert_allclose(pale.factor(texels, np.ones(2)), texels)


def test_images_in_one_mapping_keep_it_and_others_are_resampled(tmp_path: Path) -> None:
    ramp = np.tile(np.arange(64) * 4, (64, 1))
    scene, _ = opened(tmp_path, METAL, ramp)
    turned = TextureTransform(90.0, (0.25, 0.0), ("mirror", "repeat"))
    same = weight((0.0, 1.0), (0.0, 1.0), repeats=(2.0, 2.0), transform=turned)
    alone = LayerMaps(node_weights=(same,)).images
    assert alone.texture_scale == (2.0, 2.0) and scene.textures.texture(alone).transform == turned
    both = LayerMaps(node_weights=(same, weight((0.0, 1.0), (1.0, 0.0)))).images
    found = scene.textures.texture(both)
    assert both.texture_scale == (1.0, 1.0) and found.size == (
        512,
        512,
    )  # two by two of 64, on a grid of four times that
    uv = np.random.default_rng(2).random((50, 2))
    one, two = (scene.textures.numbers(each.image) for each in both.node.weights)
    expected = one.at(uv * 2.0)[:, 0] * (1.0 - two.at(uv)[:, 0])
    assert np.abs(found.at(uv)[:, 0] - expected).mean() < 0.005  # but for interpolation across seams


def test_weights_below_zero_are_for_the_camera_alone(tmp_path: Path) -> None:
    scene, _ = opened(tmp_path, METAL, np.full((4, 4), 255))
    own = ChannelWeight(ChannelImage("rough.png"), (0.0, 1.0), (1.0, -0.25), (1.0, 0.5))
    maps = LayerMaps(node_weights=(own,))
    placement = Placement(scene)
    seen = MapSampler(scene, placement.caster, placement.hits).sample(0, maps.images)
    np.testing.assert_allclose(seen.texture, -0.25)
    assert seen.means.factor(maps) == pytest.approx([0.5] * 3)


def test_a_constant_map_is_the_plain_picture_bit_for_bit(tmp_path: Path) -> None:
    scene, document = opened(tmp_path, ROUGH, np.full((8, 8), 255))
    (layer,) = with_nodes(scene, document)
    assert layer.maps.is_plain and layer.values["alpha"] == 0.6


def test_nodes_at_pixels_sum_to_the_whole(tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    scene, document = opened(tmp_path, ROUGH, random.integers(0, 256, (40, 30)))
    nodes, placement = with_nodes(scene, document, 4), Placement(scene)
    factors = MapFactors(scene, {0: nodes}).at_primary_hits(placement.caster, placement.hits)
    assert len(nodes) == 4
    np.testing.assert_allclose(factors.sum(axis=1), 1.0, atol=1e-5)


def test_paths_evaluate_the_formula_at_each_texel(tmp_path: Path) -> None:
    # Left half smooth, right half rough, under a lamp: the reference of the whole map is that of the two plain ones.
    half = np.zeros((64, 64), np.uint8)
    half[:, 32:] = 255
    scene, document = opened(tmp_path, ROUGH, half, LEANING_LAMP, "sphere")
    placement, dark = Placement(scene), SkyState(None)
    authored = document.object("card").layers

    def trace(layers: tuple[Layer, ...]) -> np.ndarray:
        return run_to_end(trace_paths(placement, {0: layers}, dark, 1, 32)).radiance

    found = trace(authored)
    plain = [trace((authored[0].replace(parameter_maps=()).with_parameter("alpha", value),)) for value in (0.2, 0.6)]
    uv, _, _ = MapSampler(scene, placement.caster, placement.hits).footprints(0)
    deep = np.abs(((uv[:, 0] + 0.25) % 0.5) - 0.25) > 0.03  # well inside either half
    expected = np.where((uv[:, :1] % 1.0) < 0.5, plain[0], plain[1])
    bright = deep & (expected.sum(axis=1) > 0.05 * expected.sum(axis=1).max())
    assert bright.sum() > 20
    error = found[bright].mean() / expected[bright].mean() - 1.0
    assert abs(error) < 0.05  # other lobes are sampled: the noise of 32 paths a pixel


def test_further_weights_multiply_the_layer(tmp_path: Path) -> None:
    half = np.zeros((64, 64), np.uint8)
    half[:, 32:] = 255
    further = 'further_weights = [{ map = "rough.png" }, { map = "rough.png", invert = true, repeats = [2, 1] }]'
    scene, document = opened(tmp_path, f"{METAL}, {further}", half)
    (layer,) = document.object("card").layers
    assert len(layer.maps.further_weights) == 2 and not layer.maps.has_weight
    found = scene.textures.texture(layer.maps.images)
    # White from a half on, times black in the second half of each half: the third quarter remains.
    seen = found.at(np.stack([np.array([0.1, 0.35, 0.6, 0.9]), np.full(4, 0.5)], axis=1))[:, 0]
    np.testing.assert_allclose(seen, [0.0, 0.0, 1.0, 0.0], atol=1e-5)
    for wrong in ('[{ map = "" }]', "[3]", '[{ map = "rough.png", invert = 1 }]', '[{ map = "../rough.png" }]'):
        with pytest.raises(LoadError, match="further_weights|rough.png"):
            opened(tmp_path, f"{METAL}, further_weights = {wrong}", half)


def test_paths_dim_what_lies_under_a_sheen_by_the_texel(tmp_path: Path) -> None:
    # Under an even sky a white base under a white sheen of any roughness reflects about what falls on it, 1.
    half = np.zeros((64, 64), np.uint8)
    half[:, 32:] = 255
    alpha = 'parameter_maps = { alpha = { map = "rough.png", range = [0.1, 0.8] } }'
    layers = ('model = "lambert", name = "base", albedo = 1.0, under = "sheen"', f'model = "sheen", {alpha}')
    write(tmp_path / "rough.png", half)
    (tmp_path / "scene.toml").write_text(HEAD + placed("card", "quad", more=material(*layers)))
    scene = load_scene(tmp_path / "scene.toml")
    document = document_from_description("scene.toml", scene.description)
    placement, sky = Placement(scene), SkyState(constant_environment((1.0, 1.0, 1.0)))
    # The means of 484 pixels have a standard error of 0.24 % at 64 paths.
    authored = run_to_end(trace_paths(placement, {0: document.object("card").layers}, sky, 1, 64)).radiance
    nodes = run_to_end(trace_paths(placement, {0: with_nodes(scene, document)}, sky, 1, 64)).radiance
    assert authored.mean() == pytest.approx(1.0, abs=0.01)
    assert nodes.mean() == pytest.approx(1.0, abs=0.01)


def test_nodes_are_the_formula_at_each_texel_under_a_wide_light(tmp_path: Path) -> None:
    # The furnace: what is reflected of an even sky depends on roughness, and 4 nodes have it within a percent.
    random = np.random.default_rng(7)
    scene, document = opened(tmp_path, ROUGH, random.integers(0, 256, (64, 64)))
    placement, sky = Placement(scene), SkyState(constant_environment((1.0, 1.0, 1.0)))
    authored = document.object("card").layers
    truth = run_to_end(trace_paths(placement, {0: authored}, sky, 1, 64)).radiance
    blend = run_to_end(trace_paths(placement, {0: with_nodes(scene, document, 4)}, sky, 1, 64)).radiance
    assert blend.mean() == pytest.approx(truth.mean(), rel=0.01)


@pytest.mark.parametrize(("layer", "said"), [
    (METAL + ', parameter_maps = { alfa = { map = "rough.png" } }', "alfa"),
    (METAL + ', parameter_maps = { alpha = { map = "../rough.png" } }', "folder"),
    (METAL + ', parameter_maps = { alpha = { map = "gone.png" } }', "gone.png"),
    (METAL + ', parameter_maps = { alpha = { map = "rough.png", range = [2, 3] } }', "range|alpha"),
])  # fmt: skip
def test_a_scene_with_a_wrong_map_is_refused_in_one_line(tmp_path: Path, layer: str, said: str) -> None:
    with pytest.raises(LoadError, match=said) as caught:
        opened(tmp_path, layer, np.zeros((2, 2)))
    assert "\n" not in str(caught.value)


def test_no_directions_are_evaluated_to_nothing(tmp_path: Path) -> None:
    # As where all of a path tracer's directions lie below the horizon of a mapped layer.
    _, document = opened(tmp_path, ROUGH, np.arange(64, dtype=np.uint8).reshape(8, 8))
    layers, none = document.object("card").layers, np.zeros((0, 3))
    images = [each.image for each in layers[0].parameter_maps]
    found = evaluate_layers_by_texel(layers, images, none, none, np.zeros((0, 1, 3)), np.zeros((0, 1)))
    assert found.shape == (0, 3)
