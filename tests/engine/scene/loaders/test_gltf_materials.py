"""Materials and textures of GLB files: metals, maps of metalness and roughness, and how images are mapped."""

import base64
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.material import MODELS, validate_parameters
from engine.material.bumps import Bumps
from engine.material.layer_maps import LayerMaps
from engine.scene.loaders.gltf import ImportedModel
from engine.scene.loaders.pbr_layers import PbrMaterial, pbr_layers
from engine.scene.map_sampler import look_up_images
from engine.scene.scene_loader import load_scene
from engine.scene.surface_uvs import uvs_at
from tests.engine.scene.conftest import TOY
from tests.engine.scene.loaders.conftest import NUMBERS, Glb, png


def test_metal_is_one_gloss_and_plastic_has_a_base_under_it() -> None:
    (metal,) = pbr_layers(PbrMaterial((0.9, 0.6, 0.2), 1.0, 0.5))
    assert metal.model == "microfacet" and metal.parameters["alpha"] == 0.25
    assert metal.parameters["f0"] == (0.9, 0.6, 0.2) and metal.parameters["f90"] == 1.0
    base, gloss = pbr_layers(PbrMaterial((0.9, 0.6, 0.2), 0.0, 0.0))
    # What the gloss reflects, 4 % head-on and all at grazing angles, is missing below it: both have one F0 and F90.
    assert base.model == "diffuse_base" and base.parameters["albedo"] == (0.9, 0.6, 0.2)
    assert base.follows == gloss.name and base.parameters["f0"] == gloss.parameters["f0"] == (0.04,) * 3
    assert gloss.parameters["alpha"] == 0.01  # a mirror is kept just rough enough to be sampled
    # Of half a metal F0 is half of either, and the base is half as bright.
    base, gloss = pbr_layers(PbrMaterial((0.9, 0.6, 0.2), 0.5, 0.5))
    assert gloss.parameters["f0"] == pytest.approx((0.47, 0.32, 0.12)) and gloss.parameters["f90"] == 1.0
    assert base.parameters["albedo"] == (0.45, 0.3, 0.1) and base.follows is None


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 1.0])
@pytest.mark.parametrize("base", [(0.0, 0.0, 0.0), (1.0, 0.5, 0.0), (1.0, 1.0, 1.0)])
def test_every_material_is_within_the_models_ranges(base, roughness, metallic):
    for layer in pbr_layers(PbrMaterial(base, metallic, roughness)):
        accepted = validate_parameters(MODELS[layer.model], layer.parameters, "model.glb")
        assert set(layer.parameters) <= set(accepted)  # otherwise the call has raised


def test_a_base_colour_texture_lies_as_in_the_file(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.25, 1.0, 1.0]
    glb_file(tree, binary)
    scene = load_scene(scene_file(TOY))
    (toy,) = scene.description.objects
    base, coat = toy.layers
    assert base.model == "diffuse_base" and base.maps == LayerMaps("model.glb#0", "srgb")
    assert base.parameters["albedo"] == pytest.approx((0.5, 0.25, 1.0))
    assert coat.maps.is_plain  # what glass reflects has no colour
    # A quarter and three quarters of the way up: v grows upwards here.
    uv = uvs_at(scene, np.zeros(2, int), np.zeros(2), np.array([0.25, 0.75]))
    np.testing.assert_allclose(uv, [[0.0, 0.25], [0.0, 0.75]], atol=1e-6)
    colours, _ = look_up_images(base.maps.images, scene.textures, uv)
    np.testing.assert_allclose(colours, [[1, 1, 1], [1, 0, 0]], atol=1e-6)


def test_a_normal_texture_turns_normals_as_the_file_means_it(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    image = {"uri": "data:image/png;base64," + base64.b64encode(png([[[128, 179, 243]] * 2] * 2)).decode()}
    transform = {"KHR_texture_transform": {"scale": [2.0, 3.0], "offset": [0.0, -2.0]}}
    normal = {"index": 0, "scale": 0.5, "extensions": transform}
    glb_file(tree | {"images": [image], "materials": [{"normalTexture": normal}]}, binary)
    scene = load_scene(scene_file(TOY))
    bumps = scene.description.objects[0].bumps
    assert bumps == Bumps(normal_map="model.glb#0", bump_strength=0.5, bump_repeats=(2.0, 3.0))
    up, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(1)
    turned = scene.bump_normals.perturb(np.zeros(1, int), none, none, up, up)[0]
    # Green is +Y, upwards in the picture: to where v grows here, and where the triangle's own +Y is.
    assert turned[1] / turned[2] == pytest.approx(0.5 * 51 / 115, rel=1e-3) and abs(turned[0]) < 1e-6
    own = 'bump_map = { file = "model.glb#0" }\n'
    scene = load_scene(scene_file(TOY + own))
    assert scene.description.objects[0].bumps == Bumps(bump_map="model.glb#0")


def test_a_metal_has_the_texture_and_half_a_metal_is_both(read: Callable[..., ImportedModel]) -> None:
    def layers(metallic: float) -> list[tuple[str | None, float, float, bool]]:
        """Name, F0 and F90 in red, and whether it has the texture."""
        pbr = {"baseColorTexture": {"index": 0}, "metallicFactor": metallic}
        (part,) = read(material={"pbrMetallicRoughness": pbr}).parts
        return [(each.name, round(each.parameters["f0"][0], 9), each.parameters["f90"], not each.maps.is_plain)
                for each in part.layers]  # fmt: skip

    # Of a metal, F0 + (1 - F0) r = F0 (1 - r) + r: the texture multiplies the first term alone.
    assert layers(1.0) == [("gloss", 0.0, 1.0, False), ("metal", 1.0, 0.0, True)]
    assert layers(0.0) == [("base", 0.04, 1.0, True), ("gloss", 0.04, 1.0, False)]
    half = [("base", 0.04, 1.0, True), ("gloss", 0.03, 1.0, False), ("metal", 1.0, 0.0, True)]
    assert layers(0.25) == half


def test_metalness_and_roughness_vary_over_the_surface(read: Callable[..., ImportedModel]) -> None:
    image = {"uri": "data:image/png;base64," + base64.b64encode(NUMBERS).decode()}
    pbr = {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.5, "baseColorFactor": [0.5, 0.5, 0.5, 1.0]}
    model = read(image=image, material={"pbrMetallicRoughness": pbr})
    # (1 - m) of a dielectric and m of a metal, both with alpha = (0.5 g)^2; blue is 0.4 everywhere, and no map.
    base, glossy = model.parts[0].layers
    assert base.parameters["albedo"] == pytest.approx((0.3,) * 3) and not base.parameter_maps
    (alpha,) = glossy.parameter_maps.values()
    assert (alpha["channel"], alpha["range"], alpha["response"]) == ("g", (0.0, 0.25), "square")
    assert alpha["map"].startswith("#") and model.notes == ()


def test_where_metalness_varies_the_parts_are_apart(read: Callable[..., ImportedModel]) -> None:
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[:2] = 0, 128, 255
    pixels[2:] = 0, 64, 0
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    image = {"uri": "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()}
    pbr = {"metallicRoughnessTexture": {"index": 0}, "metallicFactor": 0.5, "baseColorFactor": [0.5, 0.5, 0.5, 1.0]}
    model = read(image=image, material={"pbrMetallicRoughness": pbr})
    layers = {layer.name: layer for layer in model.parts[0].layers}
    assert set(layers) == {"base", "gloss", "metal gloss"}
    ranges = {
        name: {key: table["range"] for key, table in layer.parameter_maps.items()} for name, layer in layers.items()
    }
    assert ranges == {
        "base": {"albedo": ((0.5,) * 3, (0.25,) * 3)},
        "gloss": {"scale": ((1.0,) * 3, (0.5,) * 3), "alpha": (0.0, 1.0)},
        "metal gloss": {"scale": ((0.0,) * 3, (0.5,) * 3), "alpha": (0.0, 1.0)},
    }
    assert layers["metal gloss"].parameters["f0"] == (0.5,) * 3
