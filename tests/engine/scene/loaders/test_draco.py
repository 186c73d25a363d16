"""Primitives that Draco compresses, written with DracoPy's own encoder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import DracoPy
import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.gltf import read_gltf

Triangle = tuple[dict, bytes]
PLACES = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 4, 0]], np.float32)
FACES = np.array([[0, 1, 2], [2, 1, 3]], np.uint32)
COORDINATES = np.array([[0, 1], [1, 1], [0, 0], [1, 0]], float)


@pytest.fixture
def compressed() -> Triangle:
    """The JSON tree and binary chunk of a square of two triangles whose data are all in the stream."""
    stream = DracoPy.encode(
        PLACES, FACES, quantization_bits=14, preserve_order=True, tex_coord=COORDINATES,
        normals=np.tile([0.0, 0.0, 1.0], (4, 1)), colors=np.arange(16, dtype=np.uint8).reshape(4, 4),
    )  # fmt: skip
    kinds = {each["attribute_type"]: each["unique_id"] for each in DracoPy.decode(stream).attributes}
    numbers = {"POSITION": kinds[0], "NORMAL": kinds[1], "COLOR_0": kinds[2], "TEXCOORD_0": kinds[3]}
    accessor = {"count": 4, "componentType": 5126}
    tree = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_draco_mesh_compression"], "extensionsRequired": ["KHR_draco_mesh_compression"],
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2, "TEXCOORD_0": 3}, "indices": 4,
            "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": numbers}},
        }]}],
        "accessors": [
            accessor | {"type": "VEC3", "min": [0, 0, 0], "max": [4, 4, 0]}, accessor | {"type": "VEC3"},
            {"count": 4, "componentType": 5121, "type": "VEC4", "normalized": True}, accessor | {"type": "VEC2"},
            {"count": 6, "componentType": 5123, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": len(stream)}],
        "buffers": [{"byteLength": len(stream)}],
    }  # fmt: skip
    return tree, stream


def test_all_attributes_come_from_the_stream(compressed: Triangle, glb_file: Callable[..., Path]) -> None:
    model = read_gltf(glb_file(*compressed))
    mesh = model.parts[0].mesh
    order = np.lexsort((mesh.vertices[:, 0].round(), mesh.vertices[:, 1].round()))
    assert np.allclose(mesh.vertices[order], PLACES, atol=1e-3)  # of 14 bits
    assert mesh.normals is not None and np.allclose(mesh.normals, [0, 0, 1], atol=1e-2)
    assert mesh.uvs is not None and mesh.colours is not None and mesh.triangles.shape == (2, 3)
    corners = mesh.vertices[mesh.triangles]
    assert np.allclose(mesh.uvs, corners[..., :2] / 4.0, atol=1e-3)  # v upwards, as y
    assert model.unshown == () and model.notes == ()


def test_a_scan_of_less_than_a_byte_for_each_vertex_and_face_is_read(
    compressed: Triangle, glb_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.scene.loaders.gltf.MOST_COPIED", 0)
    side = 60
    places = np.stack([*np.mgrid[:side, :side], np.random.default_rng(1).random((side, side))], axis=2).reshape(-1, 3)
    corners = np.arange(side * side).reshape(side, side)
    a, b, c, d = (each.ravel() for each in (corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)]).astype(np.uint32)
    stream = DracoPy.encode(places, faces, quantization_bits=11, compression_level=7)
    assert len(stream) < len(places) + len(faces)
    tree, _ = compressed
    (attribute,) = DracoPy.decode(stream).attributes
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["attributes"] = {"POSITION": 0}
    primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"] = {"POSITION": attribute["unique_id"]}
    tree["bufferViews"] = tree["buffers"] = [{"buffer": 0, "byteLength": len(stream)}]
    assert len(read_gltf(glb_file(tree, stream)).parts[0].mesh.triangles) == len(faces)


def test_strips_are_triangles_in_the_stream(compressed: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, stream = compressed
    tree["meshes"][0]["primitives"][0]["mode"] = 5
    assert read_gltf(glb_file(tree, stream)).parts[0].mesh.triangles.shape == (2, 3)


def test_a_fallback_is_not_read(compressed: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, stream = compressed
    tree["buffers"].append({"byteLength": 48, "uri": "gone.bin"})
    tree["bufferViews"].append({"buffer": 1, "byteLength": 48})
    tree["accessors"][0]["bufferView"] = 1
    assert read_gltf(glb_file(tree, stream)).unshown == ()


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            lambda tree, d: d["attributes"].update(POSITION=77),
            "attributes: POSITION = 77, expected the number of an attri",
        ),
        (
            lambda tree, d: d["attributes"].pop("POSITION"),
            "accessors 0: bufferView = nothing, expected a view of posit",
        ),
        (
            lambda tree, d: tree["accessors"][0].update(type="VEC2"),
            "accessors 0: type = VEC2, expected VEC3 for POSITION",
        ),
        (lambda tree, d: d.update(bufferView=3), "KHR_draco_mesh_compression: bufferView = 3, expected an integer"),
        (lambda tree, d: tree["bufferViews"][0].update(byteLength=40), "stream = "),
    ],
)
def test_what_does_not_fit_is_named(
    compressed: Triangle, glb_file: Callable[..., Path], change: Callable, line: str
) -> None:
    tree, stream = compressed
    change(tree, tree["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"])
    with pytest.raises(LoadError) as caught:
        read_gltf(glb_file(tree, stream))
    assert line in str(caught.value)
