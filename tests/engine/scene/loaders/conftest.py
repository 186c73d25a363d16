"""A GLB file's triangle with an embedded image, and files with other materials on it."""

import copy
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.scene.loaders.gltf import ImportedModel, read_gltf

Glb = tuple[dict[str, Any], bytes]


def png(pixels: object) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()


# Red above white: in glTF (0, 0) is the upper left corner of the image.
TWO_ROWS = png([[[255, 0, 0]] * 2, [[255, 255, 255]] * 2])
# Of numbers: roughness in green, metalness in blue.
NUMBERS = png([[[0, 51, 102]] * 2, [[0, 153, 102]] * 2])


def spoil(tree: dict, path: str, value: object) -> dict:
    """A copy of the tree with the value at a dotted path replaced, or removed for None."""
    tree = copy.deepcopy(tree)
    *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
    node = tree
    for key in way:
        node = node[key]
    if value is None:
        del node[last]
    else:
        node[last] = value
    return tree


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
