"""Materials and textures of GLB files: indices of metals, images, their mapping, and what is skipped with a note."""

import base64
import copy
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.material import MODELS, validate_parameters
from engine.material.bumps import Bumps
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import MAX_VARIANTS
from engine.scene.loaders.gltf import ImportedModel, read_gltf
from engine.scene.loaders.model import NO_EMISSION, Emission
from engine.scene.loaders.pbr_layers import PbrMaterial, pbr_layers
from engine.scene.map_sampler import look_up_images
from engine.scene.scene_loader import load_scene
from engine.scene.surface_uvs import uvs_at
from engine.texture.texture_files import check_image, read_texture
from tests.engine.scene.conftest import TOY
from tests.scene_text import placed


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


Glb = tuple[dict[str, Any], bytes]


def png(pixels: object) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()


# Red above white: in glTF (0, 0) is the upper left corner of the image.
TWO_ROWS = png([[[255, 0, 0]] * 2, [[255, 255, 255]] * 2])
# Of numbers: roughness in green, metalness in blue.
NUMBERS = png([[[0, 51, 102]] * 2, [[0, 153, 102]] * 2])


@pytest.fixture
def textured(triangle_glb: Glb) -> Glb:
    """The triangle (0,0,0) (1,0,0) (0,1,0) with an embedded image, its lower side at the image's lower edge."""
    tree, binary = copy.deepcopy(triangle_glb)
    uvs = np.array([[0, 1], [1, 1], [0, 0]], "<f4").tobytes()
    start = len(binary) + 2
    tree["bufferViews"] += [
        {"buffer": 0, "byteOffset": start, "byteLength": len(uvs)},
        {"buffer": 0, "byteOffset": start + len(uvs), "byteLength": len(TWO_ROWS)},
    ]
    tree["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"})
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["TEXCOORD_0"] = 2
    primitive["material"] = 0
    tree["images"] = [{"bufferView": 3, "mimeType": "image/png"}]
    tree["textures"] = [{"source": 0}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}]
    tree["buffers"][0]["byteLength"] = start + len(uvs) + len(TWO_ROWS)
    return tree, binary + b"\0\0" + uvs + TWO_ROWS


@pytest.fixture
def read(glb_file: Callable[..., Path], textured: Glb) -> Callable[..., ImportedModel]:
    """read(material=..., image=..., textures=...) reads the file with these in its JSON."""

    def make(**changes: Any) -> ImportedModel:
        tree, binary = textured
        pbr = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
        tree["materials"] = [changes.pop("material", {"pbrMetallicRoughness": pbr})]
        if "image" in changes:
            tree["images"] = [changes.pop("image")]
        return read_gltf(glb_file(tree | changes, binary))

    return make


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


def with_extensions(read: Callable[..., ImportedModel], **extensions: dict[str, Any]) -> dict[str | None, Any]:
    """The layers, by name, of a red dielectric of roughness 0.3 with these extensions, without KHR_materials_."""
    pbr = {"baseColorFactor": [0.8, 0.2, 0.1, 1.0], "metallicFactor": 0, "roughnessFactor": 0.3}
    named = {f"KHR_materials_{name}": values for name, values in extensions.items()}
    (part,) = read(material={"pbrMetallicRoughness": pbr, "extensions": named}).parts
    return {layer.name: layer for layer in part.layers}


def test_index_and_specular_extensions_change_what_glass_reflects(read: Callable[..., ImportedModel]) -> None:
    layers = with_extensions(read, ior={"ior": 2.0}, specular={"specularFactor": 0.5})
    for name in ("base", "gloss"):
        # Half of (1 / 3)² head-on, half of all at grazing angles.
        assert layers[name].parameters["f0"] == pytest.approx((0.5 / 9,) * 3)
        assert layers[name].parameters["f90"] == 0.5
    layers = with_extensions(read, ior={"ior": 0.0}, specular={"specularColorFactor": [0.5, 2.0, 0.1]})
    assert layers["gloss"].parameters["f0"] == (0.5, 1.0, 0.1)  # at most 1 before the strength
    model = read(material={"extensions": {"KHR_materials_ior": {"ior": 0.5}}})
    assert model.notes == ("materials 0: extensions: KHR_materials_ior: ior = 0.5, taken as 1",)


def test_a_specular_texture_is_a_share_and_a_specular_colour_a_texture(read: Callable[..., ImportedModel]) -> None:
    layers = with_extensions(read, specular={"specularTexture": {"index": 0}})
    shares = {name: (layer.maps.weight, layer.maps.weight_channel, layer.maps.weight_invert)
              for name, layer in layers.items()}  # fmt: skip
    assert shares == {"base": ("#0", "a", False), "bare base": ("#0", "a", True), "gloss": ("#0", "a", False)}
    assert layers["bare base"].parameters["f90"] == 0.0  # nothing is taken from it
    layers = with_extensions(read, specular={"specularColorTexture": {"index": 0}})
    assert layers["facing gloss"].maps == LayerMaps("#0", "srgb") and layers["facing gloss"].parameters["f90"] == 0.0
    assert layers["gloss"].maps.is_plain and layers["gloss"].parameters["f0"] == (0.0, 0.0, 0.0)
    assert layers["base"].maps == LayerMaps(weight="#0", weight_channel="max")


def test_a_coat_and_a_sheen_lie_on_what_is_beneath(read: Callable[..., ImportedModel]) -> None:
    coat = {"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.5}
    sheen = {"sheenColorFactor": [0.4, 0.5, 0.6], "sheenRoughnessFactor": 0.5}
    layers = with_extensions(read, clearcoat=coat, sheen=sheen)
    assert {name: layer.under for name, layer in layers.items()} == {
        "base": "sheen", "gloss": "sheen", "sheen": "coat", "coat": None
    }  # fmt: skip
    assert layers["coat"].parameters == {"alpha": 0.25, "ior": 1.5, "scale": 0.7}
    assert layers["sheen"].parameters == {"alpha": 0.25, "scale": (0.4, 0.5, 0.6)}
    layers = with_extensions(read, clearcoat={**coat, "clearcoatTexture": {"index": 0}})
    covered = {name: (layer.under, layer.maps.weight_channel, layer.maps.weight_invert)
               for name, layer in layers.items()}  # fmt: skip
    assert covered == {
        "base": ("coat", "r", False), "base without coat": (None, "r", True), "gloss": ("coat", "r", False),
        "gloss without coat": (None, "r", True), "coat": (None, "r", False),
    }  # fmt: skip
    assert with_extensions(read, clearcoat={}, sheen={}).keys() == {"base", "gloss"}


def test_a_thin_film_colours_gloss_and_base(read: Callable[..., ImportedModel]) -> None:
    film = {"iridescenceFactor": 0.8, "iridescenceIor": 1.6, "iridescenceThicknessMaximum": 300}
    unused = film | {"iridescenceThicknessMinimum": 100}
    listed = read(material={"extensions": {"KHR_materials_iridescence": unused}}).unshown
    assert not any("iridescence" in each.name for each in listed)
    layers = with_extensions(read, iridescence=film)
    shown = {"film": 0.8, "film_ior": 1.6, "thickness": 300.0}
    assert [(each.model, each.follows) for each in layers.values()] == [
        ("thin_film_base", "gloss"),
        ("thin_film", None),
    ]
    assert all(each.parameters.items() >= shown.items() for each in layers.values())
    layers = with_extensions(read, iridescence={**film, "iridescenceTexture": {"index": 0}})
    assert {name: (each.maps.weight_invert, each.parameters["film"]) for name, each in layers.items()} == {
        "base": (False, 0.8), "gloss": (False, 0.8), "bare base": (True, 0.0), "bare gloss": (True, 0.0)
    }  # fmt: skip


def test_specular_glossiness_is_a_dielectric_of_any_reflectance(read: Callable[..., ImportedModel]) -> None:
    old = {"diffuseFactor": [0.5, 0.4, 0.3, 1.0], "specularFactor": [0.2, 0.3, 0.4], "glossinessFactor": 0.8}
    (part,) = read(material={"extensions": {"KHR_materials_pbrSpecularGlossiness": old}}).parts
    base, gloss = part.layers
    assert base.parameters["albedo"] == (0.5, 0.4, 0.3)
    assert gloss.parameters["f0"] == (0.2, 0.3, 0.4) and gloss.parameters["alpha"] == pytest.approx(0.2**2)
    for_others = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "baseColorTexture": {"index": 0}}}
    model = read(material=for_others | {"extensions": {"KHR_materials_pbrSpecularGlossiness": old}})
    assert model.parts[0].layers == part.layers
    assert not any("pbrMetallicRoughness" in each.name for each in model.unshown)
    old |= {"specularFactor": [1.0, 1.0, 1.0], "specularGlossinessTexture": {"index": 0}}
    (part,) = read(material={"extensions": {"KHR_materials_pbrSpecularGlossiness": old}}).parts
    # Where the texture is white nothing is left of the base; it is there by what the texture lacks of white.
    assert [layer.name for layer in part.layers] == ["dull base", "facing gloss", "gloss"]
    assert part.layers[0].maps == LayerMaps(weight="#0", weight_channel="max", weight_invert=True)


def test_what_layers_cannot_have_together_is_listed(read: Callable[..., ImportedModel]) -> None:
    texture = {"index": 0}
    coat = {"clearcoatFactor": 1, "clearcoatTexture": texture, "clearcoatNormalTexture": texture,
            "clearcoatRoughnessTexture": texture}  # fmt: skip
    extensions = {"KHR_materials_clearcoat": coat, "KHR_materials_specular": {"specularTexture": texture}}
    model = read(material={"extensions": extensions, "emissiveFactor": [1, 1, 1]})
    found = {each.name.rpartition(".")[2]: each.effect for each in model.unshown}
    assert found["clearcoatNormalTexture"] == "the coat has the normals of what lies under it"
    assert "clearcoatFactor" in found
    shown = {"clearcoatTexture", "clearcoatRoughnessTexture", "specularTexture", "emissiveFactor"}
    assert not shown & found.keys()
    # Nothing is missed of a coat that is not there.
    model = read(material={"extensions": {"KHR_materials_clearcoat": {**coat, "clearcoatFactor": 0}}})
    assert [each for each in model.unshown if "clearcoat" in each.name] == []


def test_an_emissive_texture_multiplies_the_emission(
    read: Callable[..., ImportedModel], scene_file: Callable[..., Path]
) -> None:
    shifted = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 3.0]}}}
    model = read(material={"emissiveFactor": [1, 0.5, 0], "emissiveTexture": shifted})
    emission = model.parts[0].emission
    assert emission.radiance == (1.0, 0.5, 0.0) and not emission.unlit and model.unshown == ()
    assert emission.texture.texture == "#0" and emission.texture.texture_scale == (2.0, 3.0)
    (toy,) = load_scene(scene_file(TOY)).description.objects
    assert toy.emission_texture.texture == "model.glb#0" and toy.emits and toy.layers
    # Black but for a few lights: without the image nothing shines.
    lost = [{"extensions": {"MSFT_texture_dds": {"source": 0}}}]
    model = read(material={"emissiveFactor": [1, 1, 1], "emissiveTexture": shifted}, textures=lost)
    assert model.parts[0].emission == NO_EMISSION
    assert "materials.emissiveTexture" in {each.name for each in model.unshown}
    # Of a factor of 0 a texture leaves nothing, and nothing is missed.
    model = read(material={"emissiveTexture": shifted})
    assert model.parts[0].emission == NO_EMISSION
    assert not any("emissive" in each.name for each in model.unshown)


def test_unlit_materials_are_their_colour_and_nothing_else(
    read: Callable[..., ImportedModel], scene_file: Callable[..., Path]
) -> None:
    pbr = {"baseColorFactor": [0.5, 0.25, 1, 0.5], "baseColorTexture": {"index": 0}, "metallicFactor": 0.5}
    rest = {"normalTexture": {"index": 0}, "emissiveFactor": [1, 1, 1], "alphaMode": "BLEND"}
    unlit = {"KHR_materials_unlit": {}, "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1]}}
    model = read(material={"pbrMetallicRoughness": pbr, "extensions": unlit} | rest)
    (part,) = model.parts
    assert part.emission == Emission((0.5, 0.25, 1.0), LayerMaps("#0", "srgb"), unlit=True)
    assert part.layers == () and not part.bumps.file and model.unshown == ()
    assert part.opacity.opacity_mode == "blend" and part.opacity.opacity_factor == 0.5
    scene = load_scene(scene_file(TOY))
    assert scene.shining.tolist() == [True] and scene.emitters.tolist() == [False]
    # What is black shines nothing, and reflects nothing.
    (part,) = read(material={"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}, "extensions": unlit}).parts
    assert part.emission == NO_EMISSION and part.layers[0].parameters["albedo"] == (0.0, 0.0, 0.0)


def test_anisotropy_is_a_streak_along_u_and_its_map(
    read: Callable[..., ImportedModel], scene_file: Callable[..., Path]
) -> None:
    streak = {"anisotropyStrength": 0.6, "anisotropyRotation": 0.5, "anisotropyTexture": {"index": 0}}
    pbr = {"metallicFactor": 1.0, "roughnessFactor": 0.5}
    model = read(material={"pbrMetallicRoughness": pbr, "extensions": {"KHR_materials_anisotropy": streak}})
    (part,) = model.parts
    assert model.unshown == ()
    (gloss,) = part.layers
    assert gloss.model == "brushed" and gloss.parameters["alpha"] == 0.25 and gloss.parameters["anisotropy"] == 0.6
    (name, table), *_ = gloss.parameter_maps.items()
    assert name == "anisotropy" and table["channel"] == "b" and table["range"] == (0.0, 0.6)
    assert part.bumps == Bumps(
        tangent_along_u=True, tangent_angle=pytest.approx(np.degrees(0.5)), tangent_map="#0", tangent_vectors=True
    )
    (toy,) = load_scene(scene_file(TOY)).description.objects
    assert toy.bumps.tangent_map == "model.glb#0" and toy.bumps.tangent_along_u
    (plain,) = read(material={"pbrMetallicRoughness": pbr, "extensions": {"KHR_materials_anisotropy": {}}}).parts
    assert plain.layers[0].model == "microfacet" and plain.bumps == Bumps()


def test_variants_are_other_layers_of_a_part(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    colours = {"red": [1, 0, 0, 1], "green": [0, 1, 0, 1], "blue": [0, 0, 1, 1]}
    tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorFactor": each, "metallicFactor": 0}} for each in colours.values()
    ]
    tree["materials"][2]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    tree["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "fir"}, {}, {"name": "fir"}]}}
    primitive = tree["meshes"][0]["primitives"][0]
    mappings = [{"material": 1, "variants": [0]}, {"material": 2, "variants": [2]}]
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": mappings}}
    (part,) = read_gltf(glb_file(tree, binary)).parts
    assert part.layers[0].parameters["albedo"] == (1.0, 0.0, 0.0)
    found = [(each.name, each.layers[0].parameters["albedo"]) for each in part.variants]
    # What is mapped to no material has the primitive's own.
    assert found == [("fir", (0.0, 1.0, 0.0)), ("variant 2", (1.0, 0.0, 0.0)), ("fir 3", (0.0, 0.0, 1.0))]
    (toy,) = load_scene(scene_file(TOY)).description.objects
    assert toy.variants[2].layers[0].maps.texture == "model.glb#0"
    del primitive["extensions"]
    (part,) = read_gltf(glb_file(tree, binary)).parts
    assert part.variants == ()


def test_variants_have_names_that_differ_and_the_first_are_offered(
    textured: Glb, glb_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    tree["materials"] = [{}, {"pbrMetallicRoughness": {"metallicFactor": 0}}]
    named = [{"name": name} for name in ("fir 3", "fir", "fir", "a\nb", *(f"look {k}" for k in range(70)))]
    tree["extensions"] = {"KHR_materials_variants": {"variants": named}}
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [2, 73]}]}}
    model = read_gltf(glb_file(tree, binary))
    names = [each.name for each in model.parts[0].variants]
    assert names[:5] == ["fir 3", "fir", "fir 4", "a b", "look 0"] and len(set(names)) == MAX_VARIANTS
    assert ("KHR_materials_variants.variants.name", 10) in [(each.name, each.count) for each in model.unshown]


def test_variants_bring_their_bumps_opacity_and_emission(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    texture = {"index": 0}
    tree["materials"] = [
        {}, {"normalTexture": texture, "emissiveFactor": [0, 0.5, 0], "alphaMode": "BLEND",
             "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}},
    ]  # fmt: skip
    tree["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}}
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}}
    glb_file(tree, binary)
    scene = load_scene(scene_file(TOY))
    (toy,) = scene.description.objects
    day, night = toy.variants
    assert night.bumps == Bumps("model.glb#0") and day.bumps == Bumps()
    assert night.opacity == Opacity("blend", opacity_factor=0.5) and day.opacity == OPAQUE
    assert night.emission == (0.0, 0.5, 0.0) and day.emission == (0.0, 0.0, 0.0)
    assert toy.emission is None and toy.emits  # its light can be lit
    # What the scene itself says of bumps and opacity counts in all variants.
    own = 'bump_map = { file = "model.glb#0" }\nopacity = { mode = "blend", factor = 0.7 }\n'
    (toy,) = load_scene(scene_file(TOY + own)).description.objects
    assert {each.bumps for each in toy.variants} == {each.opacity for each in toy.variants} == {None}


def test_roughness_of_coat_and_sheen_gloss_and_thickness_vary(read: Callable[..., ImportedModel]) -> None:
    texels = png([[[0, 51, 102, 51], [0, 153, 102, 255]]])
    image = {"uri": "data:image/png;base64," + base64.b64encode(texels).decode()}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 1]}}}

    def maps(name: str, **fields: Any) -> dict[str | None, dict[str, Any]]:
        (part,) = read(image=image, material={"extensions": {f"KHR_materials_{name}": fields}}).parts
        return {layer.name: layer.parameter_maps for layer in part.layers if layer.parameter_maps}

    coat = maps("clearcoat", clearcoatFactor=1, clearcoatRoughnessFactor=0.5, clearcoatRoughnessTexture=texture)
    wide = {"map": "#0", "repeats": (2.0, 1.0)}
    square = {"response": "square", "least": 0.01}
    assert coat == {"coat": {"alpha": {**wide, **square, "channel": "g", "range": (0.0, 0.25)}}}
    sheen = maps("sheen", sheenColorFactor=[1, 1, 1], sheenRoughnessFactor=0.5, sheenRoughnessTexture=texture)
    assert sheen == {"sheen": {"alpha": {**wide, **square, "channel": "a", "range": (0.0, 0.25)}}}
    film = maps("iridescence", iridescenceFactor=1, iridescenceThicknessTexture=texture,
                iridescenceThicknessMinimum=200, iridescenceThicknessMaximum=600)  # fmt: skip
    assert film == {"metal": {"thickness": {**wide, "channel": "g", "range": (200.0, 600.0)}}}
    # alpha = (1 - 0.8 a)²: 1 at black, 0.04 at white, and its root follows the channel.
    old = maps("pbrSpecularGlossiness", glossinessFactor=0.8, specularGlossinessTexture=texture)
    (alpha,) = {str(each["alpha"]): each["alpha"] for each in old.values()}.values()
    assert alpha["channel"] == "a" and alpha["range"] == (1.0, pytest.approx(0.04)) and alpha["response"] == "square"


def test_shares_of_several_images_multiply(read: Callable[..., ImportedModel]) -> None:
    # A coat and a sheen with images over a specular strength with one: eight shares of the base that add up to 1.
    texture = {"index": 0}
    layers = with_extensions(
        read, clearcoat={"clearcoatFactor": 1, "clearcoatTexture": texture},
        sheen={"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.5, "sheenColorTexture": texture},
        specular={"specularTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}}},
    )  # fmt: skip
    bases = [layer for layer in layers.values() if layer.model == "diffuse_base"]
    assert len(bases) == 8 and len(layers) == 8 + 4 + 2 + 1
    shares = {"a": 0.3, "max": 0.6, "r": 0.2}  # by the channel of each image
    total = 0.0
    for base in bases:
        weights = [(shares[base.maps.weight_channel], base.maps.weight_invert)]
        weights += [(shares[each.image.channel], each.invert) for each in base.maps.further_weights]
        assert len(weights) == 3
        total += np.prod([1.0 - share if invert else share for share, invert in weights])
    assert total == pytest.approx(1.0)
    assert {layer.under for layer in bases} == {"sheen", "coat", "sheen without coat", None}


def test_a_sheen_that_is_too_thin_is_noted(read: Callable[..., ImportedModel]) -> None:
    sheen = {"KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1]}}
    model = read(material={"extensions": sheen})
    (layer,) = [layer for layer in model.parts[0].layers if layer.name == "sheen"]
    assert layer.parameters["alpha"] == 0.01
    assert any("sheenRoughnessFactor = 0.0, taken as 0.1" in note for note in model.notes)
    assert any(each.name.endswith("sheenRoughnessFactor") for each in model.unshown)


def test_images_may_be_files_beside_it(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    tree["images"] = [{"uri": "two%20rows.png"}]
    path = glb_file(tree, binary)
    (path.parent / "two rows.png").write_bytes(TWO_ROWS)
    scene = load_scene(scene_file(TOY))
    assert scene.description.objects[0].layers[0].maps.texture == "model.glb#0"
    tree["images"] = [{"uri": "../secret.png"}]
    (note,) = read_gltf(glb_file(tree, binary)).notes
    assert "image 0 is not shown: images 0: uri = ../secret.png (outside the scene folder)" in note


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"image": {"uri": "gone.png"}}, "image 0 is not shown: file = No such file"),
        ({"image": {"uri": "data:image/png;base64,AAAA"}}, "image 0 is no PNG, JPEG, WebP or KTX 2"),
        ({"image": {"uri": "data:image/png;base64,!"}}, "image 0 is not shown: images 0: uri"),
        ({"textures": [{"extensions": {"MSFT_texture_dds": {"source": 0}}}]}, "in a format of an extension"),
        (
            {"material": {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}},
            "without their coordinates",
        ),
        ({"material": {"normalTexture": {"index": 0, "scale": 12}}}, "a normal map's scale of 12 is taken as 10"),
        ({"material": {"alphaMode": "GLASS"}}, "alphaMode = GLASS, taken as OPAQUE"),
    ],
)
def test_skipped_extensions_are_reported(
    read: Callable[..., ImportedModel], changes: dict[str, Any], words: str
) -> None:
    model = read(**changes)
    assert any(words in note for note in model.notes), model.notes
    assert all(layer.maps.is_plain for layer in model.parts[0].layers)


@pytest.mark.parametrize(("mode", "said"), [("MASK", "mask"), ("BLEND", "blend")])
def test_opacity_is_the_factors_times_the_alpha_of_the_base_colours_texture(
    read: Callable[..., ImportedModel], mode: str, said: Any
) -> None:
    image = {"uri": "data:image/png;base64," + base64.b64encode(png([[[255, 0, 0, 200], [0, 0, 0, 9]]])).decode()}
    pbr = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0}
    cutoff = 0.25 if said == "mask" else 0.5  # which only masks have
    material = {"alphaMode": mode, "alphaCutoff": 0.25, "pbrMetallicRoughness": pbr, "doubleSided": True}
    # An image without alpha is opaque; its brightness means nothing.
    assert read(material=material).parts[0].opacity == Opacity(said, cutoff, 0.5)
    model = read(image=image, material=material)
    assert model.parts[0].opacity == Opacity(said, cutoff, 0.5, "#0") and model.notes == ()
    assert not [each.name for each in model.unshown]
    assert read(image=image, material=material | {"alphaMode": "OPAQUE"}).parts[0].opacity == OPAQUE


def test_a_part_has_the_coordinates_of_its_colours_texture(textured: Glb, glb_file: Callable[..., Path]) -> None:
    tree, binary = textured
    attributes, (material,) = tree["meshes"][0]["primitives"][0]["attributes"], tree["materials"]
    attributes["TEXCOORD_1"] = attributes.pop("TEXCOORD_0")  # as files have it whose first set is of a lightmap
    tree["accessors"].append(tree["accessors"][attributes["TEXCOORD_1"]] | {"count": 3})
    attributes["TEXCOORD_0"] = len(tree["accessors"]) - 1
    colour = material["pbrMetallicRoughness"]["baseColorTexture"]
    for named in ({"texCoord": 1}, {"texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}):
        material["pbrMetallicRoughness"]["baseColorTexture"] = colour | named
        material["normalTexture"] = {"index": 0, "texCoord": 0}
        model = read_gltf(glb_file(tree, binary))
        (part,) = model.parts
        assert part.layers[0].maps == LayerMaps("#0", "srgb") and part.bumps == Bumps("#0", bump_uv_set=1)
        assert part.mesh.uvs is not None and part.mesh.uvs[0, :, :2].tolist() == [[0, 0], [1, 0], [0, 1]]
        assert part.mesh.uvs.shape == (1, 3, 4) and model.unshown == ()


def test_opacities_of_a_file_reach_the_scene_unless_it_says_otherwise(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    image = {"uri": "data:image/png;base64," + base64.b64encode(png([[[9, 9, 9, 255]], [[9, 9, 9, 0]]])).decode()}
    tree["materials"][0]["alphaMode"] = "MASK"
    glb_file(tree | {"images": [image]}, binary)
    scene = load_scene(scene_file(TOY))
    assert scene.description.objects[0].opacity == Opacity("mask", opacity_map="model.glb#0")
    # The image's upper row is opaque: in glTF v = 0 is up there.
    v = np.array([0.1, 0.9])
    assert scene.cutouts.opacity_at(np.zeros(2, int), np.zeros(2), v).tolist() == [0.0, 1.0]
    scene = load_scene(scene_file(TOY + 'opacity = { mode = "blend", factor = 0.5 }\n'))
    assert scene.description.objects[0].opacity == Opacity("blend", opacity_factor=0.5)


def test_green_that_means_down_is_turned_and_a_name_with_directx_gets_a_note(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path]
) -> None:
    tree, binary = textured
    image = {"uri": "data:image/png;base64," + base64.b64encode(png([[[128, 179, 243]] * 2] * 2)).decode()}
    image["name"] = "wall_normal_DirectX"
    glb_file(tree | {"images": [image], "materials": [{"normalTexture": {"index": 0}}]}, binary)
    up, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(1)
    slopes = []
    for own in ("", 'normal_map = { file = "model.glb#0", flip_green = true }\n'):
        scene = load_scene(scene_file(TOY + own))
        turned = scene.bump_normals.perturb(np.zeros(1, int), none, none, up, up)[0]
        slopes.append(turned[1] / turned[2])
        assert any("DirectX" in note and "flip" in note for note in scene.notes)
    assert slopes[0] == pytest.approx(51 / 115, rel=1e-3) and slopes[1] == pytest.approx(-51 / 115, rel=1e-3)


def transformed(read: Callable[..., ImportedModel], **transform: Any) -> tuple[LayerMaps, tuple[str, ...]]:
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    model = read(material={"pbrMetallicRoughness": {"baseColorTexture": info, "metallicFactor": 0}})
    return model.parts[0].layers[0].maps, model.notes


def test_where_an_image_lies_is_kept(read: Callable[..., ImportedModel]) -> None:
    maps, notes = transformed(read, scale=[2, 3], offset=[1, 0])
    assert maps == LayerMaps("#0", "srgb", (2.0, 3.0)) and notes == ()  # moved by whole images
    assert transformed(read, offset=[0.25, 0.125])[0].texture_offset == (0.25, -0.125)  # v downwards there
    maps, notes = transformed(read, scale=[0, 1])
    assert maps.texture_scale == (1e-3, 1.0) and "scale = 0.0, taken as 0.001" in notes[0]


@pytest.mark.parametrize(
    "transform",
    [
        {"offset": [0.3, 0.1]},
        {"rotation": 0.4},
        {"scale": [2, 0.5]},
        {"scale": [1.5, -3], "rotation": -2, "offset": [1.2, 3]},
    ],
)
def test_images_are_looked_up_where_the_extension_says(
    textured: Glb, glb_file: Callable[..., Path], scene_file: Callable[..., Path], transform: dict[str, Any]
) -> None:
    """Against the extension's own formula, v downwards as there, in an image that is mirrored along u and clamped along
    v, the path tracer's look-up."""
    tree, binary = textured
    grey = np.random.default_rng(1).integers(60, 200, (8, 8, 1)).repeat(3, axis=2)
    tree["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(png(grey)).decode()}]
    tree["samplers"] = [{"wrapS": 33648, "wrapT": 33071}]
    tree["textures"] = [{"source": 0, "sampler": 0}]
    info = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    glb_file(tree, binary)
    plain = load_scene(scene_file(TOY))
    info["extensions"] = {"KHR_texture_transform": transform}
    glb_file(tree, binary)
    scene = load_scene(scene_file(TOY))
    assert scene.notes == plain.notes
    maps, as_it_is = (each.description.objects[0].layers[0].maps for each in (scene, plain))
    assert as_it_is.texture_wrap == maps.texture_wrap == ("mirror", "clamp")
    u, v = np.random.default_rng(2).random((2, 50))  # v downwards
    scale, offset, angle = transform.get("scale", [1, 1]), transform.get("offset", [0, 0]), transform.get("rotation", 0)
    c, s = np.cos(angle), np.sin(angle)
    there_u, there_v = c * scale[0] * u + s * scale[1] * v + offset[0], -s * scale[0] * u + c * scale[1] * v + offset[1]
    found, _ = look_up_images(maps.images, scene.textures, np.stack([u, 1.0 - v], axis=1))
    expected, _ = look_up_images(as_it_is.images, plain.textures, np.stack([there_u, 1.0 - there_v], axis=1))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_samplers_clamp_and_mirror(read: Callable[..., ImportedModel]) -> None:
    for number, wrap in ((10497, "repeat"), (33648, "mirror"), (33071, "clamp"), (7, "repeat")):
        model = read(textures=[{"source": 0, "sampler": 0}], samplers=[{"wrapT": number}])
        assert model.parts[0].layers[0].maps.texture_wrap == ("repeat", wrap)
        assert len(model.notes) == (number == 7)
    normal = read(
        textures=[{"source": 0, "sampler": 0}], samplers=[{"wrapS": 33071}], material={"normalTexture": {"index": 0}}
    )
    assert normal.parts[0].bumps == Bumps("#0", bump_wrap=("clamp", "repeat"))


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"material": {"pbrMetallicRoughness": {"baseColorTexture": {"index": 7}}}}, "baseColorTexture.index"),
        ({"textures": [{"source": 3}]}, "textures.source"),
        ({"textures": [{"source": 0, "sampler": 2}]}, "textures.sampler"),
        ({"material": {"normalTexture": {"index": 0, "texCoord": "b"}}}, "materials.normalTexture.texCoord"),
        ({"material": {"normalTexture": 3}}, "materials.normalTexture"),
        ({"material": {"pbrMetallicRoughness": {"baseColorFactor": [1]}}}, "pbrMetallicRoughness.baseColorFactor"),
        ({"material": {"alphaMode": 3}}, "materials.alphaMode"),
    ],
)
def test_what_a_material_lacks_is_listed_and_the_rest_shown(
    read: Callable[..., ImportedModel], changes: dict[str, Any], name: str
) -> None:
    model = read(**changes)
    assert len(model.parts) == 1 and model.parts[0].layers
    assert [each.count for each in model.unshown if each.name.endswith(name)] == [1], model.unshown


def test_a_texture_without_coordinates_is_left_out(textured: Glb, glb_file: Callable[..., Path]) -> None:
    tree, binary = textured
    del tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    (part,) = read_gltf(glb_file(tree, binary)).parts
    assert part.mesh.uvs is None and all(layer.maps.is_plain for layer in part.layers)
    # A share by an image is all of it then, and nothing of the inverted one.
    tree["materials"] = [
        {"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatTexture": {"index": 0}}}}
    ]
    (part,) = read_gltf(glb_file(tree, binary)).parts
    assert [(layer.name, layer.under) for layer in part.layers] == [("gloss", "coat"), ("coat", None)]


@pytest.mark.parametrize("name", ["CesiumMan", "Fox"])
def test_real_files_bring_their_pictures(shared_data: Path, scene_file: Callable[..., Path], name: str) -> None:
    scene_path = scene_file(placed("it", f"{name}.glb"))
    (scene_path.parent / f"{name}.glb").write_bytes((shared_data / "glb" / f"{name}.glb").read_bytes())
    scene = load_scene(scene_path)
    maps = scene.description.objects[0].layers[0].maps
    assert maps.texture == f"{name}.glb#0" and scene.has_uvs.all()
    pyramid = scene.textures.texture(maps.images)
    assert pyramid is not None and 0.01 < pyramid.mean.min() and pyramid.mean.max() < 1.0


def damaged(kind: str) -> bytes:
    """A picture with a whole header and end whose inside is wrong, in a way that only decoding tells."""
    buffer = io.BytesIO()
    noise = np.random.default_rng(1).integers(0, 256, (48, 48, 3), np.uint8)
    Image.fromarray(noise).save(buffer, kind, **({"lossless": True} if kind == "WEBP" else {}))
    whole = buffer.getvalue()
    for at in range(20, len(whole) - 64):
        data = whole[:at] + b"\xff\x00" * 16 + whole[at + 32 :]
        try:
            check_image(data, "a")
        except LoadError:
            continue
        try:
            read_texture(data, "a")
        except LoadError:
            return data
    raise AssertionError("no damage is found by decoding alone")


@pytest.mark.parametrize("kind", ["WEBP", "JPEG"])
@pytest.mark.parametrize("use", ["baseColorTexture", "metallicRoughnessTexture", "normalTexture"])
def test_an_image_that_is_damaged_inside_is_listed_and_the_rest_shown(
    textured: Glb,
    mesh_file: Callable,
    glb_file: Callable[..., Path],
    scene_file: Callable[..., Path],
    kind: str,
    use: str,
) -> None:
    mesh_file("bad.bin", damaged(kind))
    tree, binary = textured
    tree["images"] = [{"uri": "bad.bin"}]
    owner = {use: {"index": 0}}
    pbr = {"metallicFactor": 0.5, "roughnessFactor": 0.5, "baseColorFactor": [0.5, 0.25, 1.0, 1.0]}
    tree["materials"] = [
        {"pbrMetallicRoughness": pbr, **owner} if use == "normalTexture" else {"pbrMetallicRoughness": pbr | owner}
    ]
    glb_file(tree, binary)
    scene = load_scene(scene_file(TOY))
    (toy,) = scene.description.objects
    assert toy.layers and not toy.bumps.file and not toy.is_of_files
    assert [each.name for each in scene.unshown if "image" in each.effect or "white" in each.effect], scene.unshown
    # As if the image were white: the factors alone.
    assert toy.layers[0].parameters["albedo"] == pytest.approx((0.25, 0.125, 0.5))
    # One that the scene's own file names is refused.
    layer = '[{ model = "lambert", texture = "bad.webp" }]'
    mesh_file("bad.webp", damaged(kind))
    with pytest.raises(LoadError, match="bad.webp"):
        load_scene(scene_file(placed("toy", "model.glb", more=f"layer = {layer}\n")))


def test_a_grey_normal_map_is_listed(textured: Glb, glb_file: Callable[..., Path], scene_file: Callable) -> None:
    tree, binary = textured
    data = base64.b64encode(png(np.full((4, 4), 128, np.uint8))).decode()
    tree["images"].append({"uri": f"data:image/png;base64,{data}"})
    tree["textures"].append({"source": 1})
    tree["materials"][0]["normalTexture"] = {"index": 1}
    glb_file(tree, binary)
    scene = load_scene(scene_file(TOY))
    (toy,) = scene.description.objects
    assert not toy.bumps.file and toy.layers[0].maps.texture
    assert any("model.glb#1" in each.effect and "normal map" in each.effect for each in scene.unshown)
