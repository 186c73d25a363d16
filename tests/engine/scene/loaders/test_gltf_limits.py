"""What a glTF file may cost: instances, accessors, sparse rows and images count by the bytes that the file has."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.gltf_buffers import open_gltf
from engine.scene.loaders.gltf_file import FLOATS, GltfFile
from tests.engine.scene.loaders.test_gltf_files import PLACES, Triangle, WriteFile, add_accessor, as_data, only_part


def test_instances_are_limited_by_the_files_size(
    triangle_glb: Triangle, glb_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An accessor without a view has as many rows of zeros as it says."""
    monkeypatch.setattr("engine.scene.loaders.gltf_nodes.MOST_PLACES", 1000)
    tree, binary = triangle_glb
    tree["accessors"].append({"componentType": 5126, "count": 800, "type": "VEC3"})
    many = {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}
    model = read_gltf(glb_file(tree | {"nodes": [many, many], "scenes": [{"nodes": [0, 1]}]}, binary))
    # The instances of the first node, and one copy for the second.
    assert len(model.parts[0].mesh.triangles) == 801
    reason = "places of all meshes = 1600, expected at most 1011 in a file of this size"
    assert any(reason in note for note in model.notes)
    assert model.unshown[0].effect == "one copy of the mesh is shown"


def test_accessors_are_not_read_again_and_again(
    triangle_glb: Triangle, glb_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Strips of one corner have no face, and so no part in the number of copies; but they are read."""
    monkeypatch.setattr("engine.scene.loaders.gltf_file.MOST_READ", 100_000)
    tree, binary = triangle_glb
    tree["accessors"].append({"componentType": 5125, "count": 30_000, "type": "SCALAR"})
    own = tree["meshes"][0]["primitives"][0]
    strips = [own | {"indices": 2, "mode": 5, "extensions": {"ACME_a": {"n": n}}} for n in range(6)]
    for n, refused in ((3, False), (6, True)):
        tree["meshes"][0]["primitives"] = [*strips[:n], own]
        path = glb_file(tree, binary)
        if refused:
            with pytest.raises(LoadError, match="numbers of all accessors = 1200.., expected at most 100704"):
                read_gltf(path)
        else:
            assert only_part(path).mesh.triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("component", [5122, 5124])
def test_indices_of_sparse_rows_are_unsigned(
    triangle_glb: Triangle, glb_file: Callable[..., Path], component: int
) -> None:
    tree, binary = triangle_glb
    where = {"bufferView": 1, "componentType": component}
    tree["accessors"][0]["sparse"] = {"count": 1, "indices": where, "values": {"bufferView": 0}}
    with pytest.raises(LoadError, match=f"sparse: indices: componentType = {component}, expected one of 5121, 5123"):
        read_gltf(glb_file(tree, binary))


def test_a_file_counts_once_however_many_buffers_name_it(triangle_glb: Triangle, mesh_file: WriteFile) -> None:
    tree, binary = triangle_glb
    path = mesh_file("model.gltf", "")
    mesh_file("body.bin", binary)
    tree["buffers"] = [{"byteLength": 42, "uri": uri} for uri in ("body.bin", "./body.bin", "%62ody.bin", "body.bin")]
    tree["bufferViews"] += [{"buffer": k, "byteLength": 36} for k in (1, 2, 3)]
    tree["accessors"] += [{"bufferView": k, "componentType": 5126, "count": 3, "type": "VEC3"} for k in (2, 3, 4)]
    own = tree["meshes"][0]["primitives"][0]
    tree["meshes"][0]["primitives"] = [own | {"attributes": {"POSITION": k}} for k in (0, 2, 3, 4)]
    path.write_text(json.dumps(tree))
    root, buffers = open_gltf(path)
    file = GltfFile.of(root, buffers)
    rows = [
        file.read(each.child("attributes"), "POSITION", "VEC3", FLOATS)
        for each in file.meshes[0].children("primitives")
    ]
    assert all(each.tolist() == PLACES.tolist() for each in rows) and len(rows) == 4
    assert buffers.n_bytes == len(binary)


def test_images_beside_the_file_are_worth_their_own_bytes(
    triangle_glb: Triangle, mesh_file: WriteFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many pixels as in a file that contains them, whatever the size of the geometry."""
    monkeypatch.setattr("engine.scene.loaders.gltf_images.MOST_PIXELS", 0)
    tree, binary = triangle_glb
    binary = add_accessor(tree, binary, np.array([[0, 1], [1, 1], [0, 0]], "<f4"), "VEC2")
    tree["meshes"][0]["primitives"][0] |= {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "material": 0}
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["textures"], tree["images"] = [{"source": 0}], [{"uri": "noise.png"}]
    tree["buffers"][0]["uri"] = as_data(binary)
    noise = np.random.default_rng(1).integers(0, 256, (100, 100, 3)).astype(np.uint8)
    for pixels, n_notes in ((noise, 0), (np.zeros((600, 600, 3), np.uint8), 1)):
        buffer = io.BytesIO()
        Image.fromarray(pixels).save(buffer, "PNG")
        mesh_file("noise.png", buffer.getvalue())
        notes = read_gltf(mesh_file("model.gltf", json.dumps(tree))).notes
        assert len(notes) == n_notes and all("too many pixels" in note for note in notes)
