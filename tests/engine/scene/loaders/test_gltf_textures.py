"""Textures of glTF materials: where their images are and lie, opacity, and images that cannot be shown."""

import base64
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.material.bumps import Bumps
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.loaders.gltf import ImportedModel, read_gltf
from engine.scene.map_sampler import look_up_images
from engine.scene.scene_loader import load_scene
from engine.texture.texture_files import check_image, read_texture
from tests.engine.scene.conftest import TOY
from tests.engine.scene.loaders.conftest import TWO_ROWS, Glb, png
from tests.scene_text import placed


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
