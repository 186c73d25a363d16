"""Extensions of glTF materials as layers: coats, sheens, films, glossiness, streaks, emission, and variants."""

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.material.bumps import Bumps
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import MAX_VARIANTS
from engine.scene.loaders.gltf import ImportedModel, read_gltf
from engine.scene.loaders.model import NO_EMISSION, Emission, ImportedPart
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import TOY
from tests.engine.scene.loaders.conftest import Glb, png


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
    assert "clearcoatFactor" in found
    shown = {
        "clearcoatNormalTexture",
        "clearcoatTexture",
        "clearcoatRoughnessTexture",
        "specularTexture",
        "emissiveFactor",
    }
    assert not shown & found.keys()
    # Nothing is missed of a coat that is not there.
    model = read(material={"extensions": {"KHR_materials_clearcoat": {**coat, "clearcoatFactor": 0}}})
    assert [each for each in model.unshown if "clearcoat" in each.name] == []


def test_a_coat_has_normals_of_its_own(read: Callable[..., ImportedModel]) -> None:
    def material(bumps: dict[str, object], **coat: object) -> ImportedPart:
        extension = {"KHR_materials_clearcoat": {"clearcoatFactor": 1, **coat}}
        (part,) = read(material={"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": extension, **bumps}).parts
        return part

    def frames(part: ImportedPart) -> dict[str, str]:
        return {str(layer.name): layer.frame for layer in part.layers}

    # Without any normal map both frames are the same. With one the coat has its own, which is smooth without a map.
    in_base = {"base": "base", "gloss": "base", "coat": "base"}
    assert frames(material({})) == in_base
    under = material({"normalTexture": {"index": 0}})
    assert frames(under) == in_base | {"coat": "coat"} and under.bumps == Bumps("#0")
    texture = {"index": 0, "scale": 0.5, "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}}
    over = material({}, clearcoatNormalTexture=texture)
    assert frames(over) == in_base | {"coat": "coat"}
    assert over.bumps == Bumps(coat_normal_map="#0", coat_strength=0.5, coat_repeats=(2.0, 3.0))
    assert over.bumps.of_coat == Bumps("#0", bump_strength=0.5, bump_repeats=(2.0, 3.0))


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
