"""Nothing of a glTF file is hidden: each property is read, or listed as not shown."""

from __future__ import annotations

import copy
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.gltf_unshown import MOST_LISTED, UNKNOWN, UNUSED
from tests.engine.scene.loaders.test_gltf_files import add_accessor

Triangle = tuple[dict, bytes]
WriteGlb = Callable[..., Path]


def unshown(path: Path) -> dict[str, tuple[int, str]]:
    """Count and effect of what is listed, by name."""
    return {each.name: (each.count, each.effect) for each in read_gltf(path).unshown}


@pytest.fixture
def sample(triangle_glb: Triangle) -> Triangle:
    """A file with a little of everything: textures and their mappings, a skin, a morph target, an animation, a camera,
    instances, a sparse accessor, and other extensions."""
    tree, binary = copy.deepcopy(triangle_glb)
    for rows, kind in (
        (np.array([[0, 1], [1, 1], [0, 0]], "<f4"), "VEC2"),
        (np.tile(np.array([0, 0, 1], "<f4"), (3, 1)), "VEC3"),
        (np.tile(np.array([1, 0, 0, 1], "<f4"), (3, 1)), "VEC4"),
        (np.zeros((3, 4), "u1"), "VEC4"),
        (np.tile(np.array([1, 0, 0, 0], "<f4"), (3, 1)), "VEC4"),
        (np.array([[0], [1]], "<f4"), "SCALAR"),
        (np.array([[0, 0, 0], [0, 0, 4]], "<f4"), "VEC3"),
        (np.tile(np.eye(4, dtype="<f4").reshape(1, 16), (1, 1)), "MAT4"),
    ):
        binary = add_accessor(tree, binary, rows, kind, name="rows", min=[0], max=[1])
    places = len(binary) + -len(binary) % 4
    binary += b"\0" * (places - len(binary)) + b"\1\0\0\0" + np.array([1, 0, 0], "<f4").tobytes()
    buffer = io.BytesIO()
    Image.new("RGB", (2, 2)).save(buffer, "PNG")
    tree["bufferViews"] += [
        {"buffer": 0, "byteOffset": places, "byteLength": 1}, {"buffer": 0, "byteOffset": places + 4, "byteLength": 12},
        {"buffer": 0, "byteOffset": len(binary), "byteLength": len(buffer.getvalue()), "target": 34962, "name": "i"},
    ]  # fmt: skip
    binary += buffer.getvalue()
    tree["buffers"] = [{"byteLength": len(binary), "name": "all"}]
    tree["accessors"][0]["sparse"] = {
        "count": 1, "indices": {"bufferView": 10, "componentType": 5121}, "values": {"bufferView": 11}
    }  # fmt: skip
    texture = {
        "index": 0,
        "texCoord": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0.1, 0], "scale": [2, 2]}},
    }
    attributes = {"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 2, "NORMAL": 3, "TANGENT": 4}
    elsewhere = {"index": 0, "texCoord": 0, "scale": 0.5, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    tree |= {
        "asset": {"version": "2.0", "generator": "a test", "extras": {"a": 1}},
        "extensionsUsed": ["KHR_texture_transform", "KHR_materials_clearcoat", "ACME_shine", "ACME_nowhere"],
        "extensionsRequired": ["KHR_texture_transform"],
        "samplers": [{"wrapS": 33071, "wrapT": 10497, "magFilter": 9729, "minFilter": 9987}],
        "images": [{"bufferView": 12, "mimeType": "image/png", "name": "wood"}],
        "textures": [{"source": 0, "sampler": 0, "name": "wood"}],
        "materials": [
            {"name": "wood", "normalTexture": elsewhere, "pbrMetallicRoughness": {
                "baseColorTexture": texture, "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0},
             "extensions": {"ACME_shine": {"shine": 1, "colour": [1, 2, 3]}, "ACME_empty": {}}},
            {"name": "nobody's", "pbrMetallicRoughness": {}},
        ],
        "meshes": [{
            "primitives": [
                {"attributes": attributes, "indices": 1, "material": 0, "mode": 4},
                {"attributes": attributes, "indices": 1, "material": 0},
                {"attributes": attributes | {"JOINTS_0": 5, "WEIGHTS_0": 6, "_TEMPERATURE": 2}, "indices": 1,
                 "targets": [{"POSITION": 3}], "extras": {}},
                {"attributes": {"POSITION": 0}, "mode": 0},
            ],
            "weights": [0.5], "name": "card", "extras": {"targetNames": ["up"]},
        }],
        "skins": [{"joints": [2], "inverseBindMatrices": 9, "skeleton": 2, "name": "bones"}],
        "cameras": [{"type": "perspective", "name": "front",
                     "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1, "zfar": 100}}],
        "nodes": [
            {"name": "top", "children": [1, 2, 3, 4], "scale": [1, 1, 1], "rotation": [0, 0, 0, 1]},
            {"mesh": 0, "skin": 0, "translation": [0, 0, 0], "weights": [0.25]},
            {"name": "joint", "extras": {"a": 1}},
            {"camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
            {"name": "empty"},
        ],
        "animations": [{
            "name": "wave",
            "samplers": [{"input": 7, "output": 8, "interpolation": "LINEAR"}],
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "translation"}}],
        }],
        "scenes": [{"nodes": [0], "name": "all"}],
    }  # fmt: skip
    return tree, binary


def objects(value: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], dict]]:
    """All objects of a JSON tree with their places."""
    if isinstance(value, dict):
        yield place, value
    for key, each in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from objects(each, (*place, key))


def name_of(place: tuple[str | int, ...]) -> str:
    return ".".join(str(part) for part in place if not isinstance(part, int) and part != "extensions")


def test_what_the_sample_does_not_show(sample: Triangle, glb_file: WriteGlb) -> None:
    """Written out: all else of it is shown, or has no effect."""
    assert unshown(glb_file(*sample)) == {
        "extensionsUsed.ACME_nowhere": (1, UNKNOWN),
        "materials": (1, UNUSED),
        "materials.ACME_empty": (1, UNKNOWN),
        "materials.ACME_shine.colour": (1, UNKNOWN),
        "materials.ACME_shine.shine": (1, UNKNOWN),
        "meshes.primitives.attributes.TEXCOORD_1": (1, "coordinates that no shown texture uses"),
        "meshes.primitives.attributes._TEMPERATURE": (1, "data of an application"),
        "meshes.primitives.mode": (1, "points and lines are not drawn"),
    }


def test_every_object_is_watched(sample: Triangle, glb_file: WriteGlb) -> None:
    """A property that nobody knows is listed wherever it stands, except in what is listed as a whole or belongs to the
    program that wrote the file."""
    tree, binary = sample
    whole = {("materials", 1), ("meshes", 0, "primitives", 3)}
    n = 0
    for place, _ in list(objects(tree)):
        if "extras" in place or place[:1] == ("asset",) or place[-1:] == ("extensions",):
            continue
        if any(place[: len(each)] == each for each in whole):
            continue
        changed = copy.deepcopy(tree)
        found: Any = changed
        for key in place:
            found = found[key]
        found["novelty"] = 1
        name = name_of((*place, "novelty"))
        assert unshown(glb_file(changed, binary)).get(name, (0, ""))[1], name
        n += 1
    assert n > 50


def test_equal_primitives_are_read_once_and_counted_each(sample: Triangle, glb_file: WriteGlb) -> None:
    tree, binary = sample
    for primitive in tree["meshes"][0]["primitives"][:2]:
        primitive["attributes"] = primitive["attributes"] | {"COLOR_7": 4}
    del tree["meshes"][0]["primitives"][0]["mode"]
    assert unshown(glb_file(tree, binary))["meshes.primitives.attributes.COLOR_7"][0] == 2


def test_an_animation_that_cannot_be_read_is_listed(sample: Triangle, glb_file: WriteGlb) -> None:
    tree, binary = sample
    tree["animations"] *= 2
    tree["animations"][1] = copy.deepcopy(tree["animations"][0])
    tree["animations"][1]["samplers"][0]["interpolation"] = "WOBBLY"
    tree["animations"][0]["channels"].append({"sampler": 0, "target": {"path": "pointer", "extensions": {}}})
    found = unshown(glb_file(tree, binary))
    assert found["animations.channels.target"] == (1, "a channel that is not played: it cannot be read")


@pytest.mark.parametrize("filtering", [9728, 9729])
def test_texels_that_should_show_as_squares(sample: Triangle, glb_file: WriteGlb, filtering: int) -> None:
    tree, binary = sample
    tree["samplers"][0]["magFilter"] = filtering
    assert ("samplers.magFilter" in unshown(glb_file(tree, binary))) == (filtering == 9728)


@pytest.mark.parametrize(
    ("name", "fields", "effect"),
    [
        ("transmission", {"transmissionFactor": 0.5, "transmissionTexture": {"index": 0}}, "opaque"),
        ("volume", {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0, 0]}, "tinted or thick"),
        ("dispersion", {"dispersion": 0.2}, "spread colours"),
        ("diffuse_transmission", {"diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [1, 0, 0]},
         "shine through thin surfaces"),
    ],
)  # fmt: skip
def test_what_lets_light_through_is_listed_property_by_property(
    sample: Triangle, glb_file: WriteGlb, name: str, fields: dict[str, Any], effect: str
) -> None:
    tree, binary = sample
    extension = f"KHR_materials_{name}"
    tree["materials"][0]["extensions"] |= {extension: fields}
    found = unshown(glb_file(tree | {"extensionsUsed": [extension]}, binary))
    listed = {key.split(".")[2]: each for key, each in found.items() if key.startswith(f"materials.{extension}.")}
    assert listed.keys() == fields.keys()
    assert all(count == 1 and effect in words for count, words in listed.values())


def test_a_flood_of_properties_is_cut_with_its_number(triangle_glb: Triangle, glb_file: WriteGlb) -> None:
    tree, binary = triangle_glb
    tree["nodes"][0] |= {f"x{i:05}\x1b": i for i in range(3000)}
    listed = read_gltf(glb_file(tree, binary)).unshown
    assert len(listed) == MOST_LISTED + 1 and sum(each.count for each in listed) == 3000
    assert all(each.name.isprintable() for each in listed)
