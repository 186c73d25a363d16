"""glTF in several files, and accessors of all kinds: what is read, from where, and never from elsewhere."""

from __future__ import annotations

import base64
import copy
import io
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.model import ImportedPart
from engine.scene.scene_loader import load_scene
from tests.fuzz.gltf_seeds import meshopts
from tests.fuzz.repair import repaired_glb

Triangle = tuple[dict, bytes]
WriteFile = Callable[[str, "str | bytes"], Path]
PLACES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def picture(colour: tuple[int, int, int] = (200, 100, 50), kind: str = "PNG") -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (4, 4), colour).save(buffer, kind)
    return buffer.getvalue()


def as_data(content: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(content).decode()


def only_part(path: Path) -> ImportedPart:
    (part,) = read_gltf(path).parts
    return part


def add_accessor(tree: dict, binary: bytes, rows: np.ndarray, kind: str, **more: object) -> bytes:
    """Append rows to the first buffer with a view and an accessor; returns the buffer."""
    components = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
    binary += b"\0" * (-len(binary) % 4)
    data = rows.tobytes()
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
    component = components[rows.dtype.str[1:]]
    view = len(tree["bufferViews"]) - 1
    tree["accessors"].append({"bufferView": view, "componentType": component, "count": len(rows), "type": kind} | more)
    tree["buffers"][0]["byteLength"] = len(binary) + len(data)
    return binary + data


# ----------------------------------------------------------------------------------------------------------- containers


@pytest.mark.parametrize("name", ["body.bin", "my body.bin", "parts/body.bin", "Körper.bin"])
@pytest.mark.parametrize("written", ["quoted", "plain"])
def test_a_buffer_beside_the_file(triangle_glb: Triangle, mesh_file: WriteFile, name: str, written: str) -> None:
    from urllib.parse import quote

    tree, binary = triangle_glb
    path = mesh_file("model.gltf", "")
    (path.parent / name).parent.mkdir(exist_ok=True)
    (path.parent / name).write_bytes(binary)
    tree["buffers"][0]["uri"] = quote(name) if written == "quoted" else name
    path.write_text(json.dumps(tree), encoding="utf-8")
    assert only_part(path).mesh.vertices.tolist() == PLACES.tolist()
    assert path.parent / name in load_scene(path).files


def test_buffers_are_data_files_and_the_binary_chunk(
    triangle_glb: Triangle, mesh_file: WriteFile, glb_file: Callable[..., Path]
) -> None:
    tree, binary = triangle_glb
    mesh_file("indices.bin", binary[36:])
    tree["bufferViews"][1] = {"buffer": 1, "byteLength": 6}
    second = {"byteLength": 6, "uri": "indices.bin"}
    for first in ({"byteLength": 36, "uri": as_data(binary[:36])}, {"byteLength": 36}):
        path = glb_file(tree | {"buffers": [first, second]}, binary[:36])
        assert only_part(path).mesh.triangles.tolist() == [[0, 1, 2]]
    tree["buffers"] = [{"byteLength": 36, "uri": as_data(binary[:36])}, second]
    assert only_part(mesh_file("model.gltf", json.dumps(tree))).mesh.triangles.tolist() == [[0, 1, 2]]


def test_the_content_says_which_container_it_is(
    triangle_glb: Triangle, glb_file: Callable, mesh_file: WriteFile
) -> None:
    tree, binary = triangle_glb
    tree["buffers"][0]["uri"] = as_data(binary)
    text = json.dumps(tree)
    assert only_part(mesh_file("really.glb", "\ufeff" + text)).mesh.triangles.tolist() == [[0, 1, 2]]
    packed = glb_file(*copy.deepcopy(triangle_glb)).read_bytes()
    assert only_part(mesh_file("packed.gltf", packed)).mesh.triangles.tolist() == [[0, 1, 2]]


def test_images_beside_the_file_and_as_data(triangle_glb: Triangle, mesh_file: WriteFile) -> None:
    tree, binary = triangle_glb
    binary = add_accessor(tree, binary, np.array([[0, 1], [1, 1], [0, 0]], "<f4"), "VEC2")
    tree["meshes"][0]["primitives"][0] |= {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "material": 0}
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["textures"] = [{"source": 0}]
    mesh_file("red wood.png", picture())
    tree["buffers"][0]["uri"] = as_data(binary)
    for uri in ("red%20wood.png", "red wood.png", as_data(picture()), ".\\red wood.png"):
        tree["images"] = [{"uri": uri}]
        path = mesh_file("model.gltf", json.dumps(tree))
        scene = load_scene(path)
        maps = next(layer.maps for layer in scene.description.objects[0].layers if layer.maps.texture)
        assert maps.texture == "model.gltf#0"
        assert scene.textures.texture(maps.images) is not None
        assert read_gltf(path).unshown == ()


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WebP", "KTX2"])
def test_a_broken_image_does_not_refuse_the_shape(triangle_glb: Triangle, mesh_file: WriteFile, kind: str) -> None:
    tree, binary = triangle_glb
    binary = add_accessor(tree, binary, np.array([[0, 1], [1, 1], [0, 0]], "<f4"), "VEC2")
    tree["meshes"][0]["primitives"][0] |= {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "material": 0}
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["textures"] = [{"source": 0}]
    tree["buffers"][0]["uri"] = as_data(binary)
    ktx2 = Path(__file__).parents[2] / "texture" / "ktx2" / "uastc.ktx2"
    whole = ktx2.read_bytes() if kind == "KTX2" else picture(kind=kind)
    for data, is_whole in ((whole, True), (whole[: len(whole) * 3 // 4], False)):
        tree["images"] = [{"uri": as_data(data)}]
        path = mesh_file("model.gltf", json.dumps(tree))
        scene = load_scene(path)
        shown = [layer.maps.texture for layer in scene.description.objects[0].layers]
        assert ("model.gltf#0" in shown) == is_whole
        assert any("image 0 is not shown: " in note for note in scene.notes) != is_whole


OUTSIDE = ["../body.bin", "%2e%2e/body.bin", "a/../../body.bin", "/etc/hostname", "file:///etc/hostname",
           "http://example.org/body.bin", "//example.org/body.bin", "link.bin", "..\\body.bin"]  # fmt: skip


@pytest.mark.parametrize("uri", OUTSIDE)
def test_nothing_is_read_from_outside_the_folder(triangle_glb: Triangle, tmp_path: Path, uri: str) -> None:
    tree, binary = triangle_glb
    (tmp_path / "body.bin").write_bytes(binary)
    (tmp_path / "wood.png").write_bytes(picture())
    folder = tmp_path / "folder"
    folder.mkdir()
    os.symlink(tmp_path / "body.bin", folder / "link.bin")
    path = folder / "model.gltf"
    path.write_text(json.dumps(tree | {"buffers": [{"byteLength": 42, "uri": uri}]}))
    with pytest.raises(LoadError, match=r"buffers 0: uri = .*expected a relative path to a file inside|file = No such"):
        read_gltf(path)
    # An image from elsewhere is not read either, but the shape is shown.
    tree |= {
        "buffers": [{"byteLength": 42, "uri": as_data(binary)}],
        "images": [{"uri": uri.replace("body.bin", "wood.png")}], "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    }  # fmt: skip
    tree["meshes"][0]["primitives"][0]["material"] = 0
    path.write_text(json.dumps(tree))
    model = read_gltf(path)
    assert model.parts[0].layers[0].maps.is_plain
    assert any("image 0 is not shown: " in note for note in model.notes)


def test_a_buffer_that_nothing_needs_may_be_missing(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    tree["buffers"].append({"byteLength": 10**6, "uri": "gone.bin"})
    assert len(read_gltf(glb_file(tree, binary)).parts) == 1
    tree["bufferViews"][1]["buffer"] = 1
    with pytest.raises(LoadError, match=r"gone\.bin: file = No such file"):
        read_gltf(glb_file(tree, binary))


# ------------------------------------------------------------------------------------------------------------ accessors


@pytest.mark.parametrize("layout", ["<i1", "<u1", "<i2", "<u2"])
@pytest.mark.parametrize("normalized", [True, False])
def test_quantized_positions_normals_and_coordinates(
    triangle_glb: Triangle, glb_file: Callable[..., Path], layout: str, normalized: bool
) -> None:
    """KHR_mesh_quantization: integers are shares of their largest value if they are normalized, else plain numbers."""
    tree, binary = triangle_glb
    most = np.iinfo(layout).max
    unit = 1.0 / most if normalized else 1.0
    places, coordinates = PLACES * (most // 2), np.array([[0, 0], [3, 0], [0, 5]])
    normals = np.tile([0, 0, most], (3, 1))
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    rows = {"POSITION": (places, "VEC3"), "NORMAL": (normals, "VEC3"), "TEXCOORD_0": (coordinates, "VEC2")}
    for key, (values, kind) in rows.items():
        padded = np.zeros((3, 4), layout)  # rows begin at multiples of four bytes
        padded[:, : values.shape[1]] = values
        binary = add_accessor(tree, binary, padded, kind, normalized=normalized)
        tree["bufferViews"][-1]["byteStride"] = padded.itemsize * 4
        attributes[key] = len(tree["accessors"]) - 1
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    model = read_gltf(glb_file(tree, binary))
    mesh = model.parts[0].mesh
    assert np.allclose(mesh.vertices, places * unit, atol=1e-12)
    assert mesh.normals is not None and mesh.normals.tolist() == [[0, 0, 1]] * 3
    expected = coordinates * unit * [1, -1] + [0, 1]
    assert mesh.uvs is not None and np.allclose(mesh.uvs[0], expected, atol=1e-6)
    assert model.unshown == ()


@pytest.mark.parametrize("key", ["POSITION", "NORMAL", "TEXCOORD_0", "indices"])
def test_sparse_rows_replace_those_of_every_attribute(
    triangle_glb: Triangle, glb_file: Callable[..., Path], key: str
) -> None:
    tree, binary = triangle_glb
    primitive = tree["meshes"][0]["primitives"][0]
    binary = add_accessor(tree, binary, np.tile(np.array([0, 0, 1], "<f4"), (3, 1)), "VEC3")
    binary = add_accessor(tree, binary, np.zeros((3, 2), "<f4"), "VEC2")
    primitive["attributes"] |= {"NORMAL": 2, "TEXCOORD_0": 3}
    value = {"POSITION": np.array([[0, 0, 9]], "<f4"), "NORMAL": np.array([[0, 1, 0]], "<f4"),
             "TEXCOORD_0": np.array([[0.25, 0.5]], "<f4"), "indices": np.array([[1]], "<u2")}[key]  # fmt: skip
    changed = primitive["indices"] if key == "indices" else primitive["attributes"][key]
    kind = tree["accessors"][changed]["type"]
    place = 0 if key == "indices" else 1
    binary = add_accessor(tree, binary, np.array([place], "u1"), "SCALAR")
    binary = add_accessor(tree, binary, value, kind)
    n_views = len(tree["bufferViews"])
    del tree["accessors"][-2:]
    tree["accessors"][changed]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": n_views - 2, "componentType": 5121},
        "values": {"bufferView": n_views - 1},
    }
    model = read_gltf(glb_file(tree, binary))
    mesh = model.parts[0].mesh
    assert mesh.normals is not None and mesh.uvs is not None
    found = {
        "POSITION": mesh.vertices[1],
        "NORMAL": mesh.normals[1],
        "TEXCOORD_0": mesh.uvs[0, 1],
        "indices": mesh.triangles[0, :1],
    }
    expected = {"POSITION": [0, 0, 9], "NORMAL": [0, 1, 0], "TEXCOORD_0": [0.25, 0.5], "indices": [1]}
    assert found[key].tolist() == expected[key]
    assert model.unshown == ()


def test_views_compressed_by_meshopt(mesh_file: WriteFile) -> None:
    """A grid of 5 x 5 points, exponential positions and octahedral normals, by both extensions; what is compressed may
    not decode to more than such a file is worth."""
    for content, name in zip(meshopts(Path()), ("EXT_meshopt_compression", "KHR_meshopt_compression"), strict=True):
        model = read_gltf(mesh_file("grid.glb", content))
        mesh = model.parts[0].mesh
        assert mesh.vertices.tolist() == [[x, y, 0] for x in range(5) for y in range(5)] and len(mesh.triangles) == 32
        assert mesh.normals is not None and np.allclose(mesh.normals, [0, 0, 1])
        assert model.unshown == () and model.notes == ()
        bomb = content.replace(b'"count": 25, "mode"', b'"count": 99999999, "mode"')
        with pytest.raises(LoadError, match=f"bufferViews 0: extensions: {name}: decoded bytes = "):
            read_gltf(mesh_file("bomb.glb", repaired_glb(bomb)))


def test_positions_that_an_unknown_extension_has(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    tree["extensionsRequired"] = tree["extensionsUsed"] = ["ACME_squeeze"]
    model = read_gltf(glb_file(tree, binary))  # what is there is shown
    assert [each.name for each in model.unshown] == ["extensionsRequired.ACME_squeeze"]
    del tree["accessors"][0]["bufferView"]
    with pytest.raises(
        LoadError, match="extensionsRequired = ACME_squeeze, expected extensions of geometry that Insitu"
    ):
        read_gltf(glb_file(tree, binary))


# ----------------------------------------------------------------------------------------------------- nodes and scenes


@pytest.mark.parametrize("layout", ["<f4", "<i2"])
def test_instances_of_a_mesh(triangle_glb: Triangle, glb_file: Callable[..., Path], layout: str) -> None:
    tree, binary = triangle_glb
    half = np.sqrt(0.5)
    turns = np.array([[0, 0, 0, 1], [0, 0, half, half]])  # none, and a quarter about Z
    unit = 1.0 if layout == "<f4" else np.iinfo(layout).max
    binary = add_accessor(tree, binary, np.array([[5, 0, 0], [0, 7, 0]], "<f4"), "VEC3")
    binary = add_accessor(tree, binary, np.rint(turns * unit).astype(layout) if unit != 1.0 else turns.astype("<f4"),
                          "VEC4", normalized=layout != "<f4")  # fmt: skip
    binary = add_accessor(tree, binary, np.array([[1, 1, 1], [2, 2, -2]], "<f4"), "VEC3")
    attributes = {"TRANSLATION": 2, "ROTATION": 3, "SCALE": 4}
    tree["nodes"][0] |= {
        "translation": [0, 0, 3],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}},
    }
    tree["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    model = read_gltf(glb_file(tree, binary))
    mesh = model.parts[0].mesh
    expected = [[5, 0, 3], [6, 0, 3], [5, 1, 3], [0, 7, 3], [0, 9, 3], [-2, 7, 3]]
    assert np.allclose(mesh.vertices, expected, atol=1e-3)
    assert model.unshown == ()
    attributes["ROTATION"] = 2
    model = read_gltf(glb_file(tree, binary))
    assert np.allclose(model.parts[0].mesh.vertices, [[0, 0, 3], [1, 0, 3], [0, 1, 3]])  # the node's own
    assert any("accessors 2: type = VEC3, expected VEC4 for ROTATION" in note for note in model.notes)
    assert model.unshown[0].name == "nodes.EXT_mesh_gpu_instancing.attributes"


def test_instances_move_with_their_node(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    binary = add_accessor(tree, binary, np.array([[5, 0, 0], [0, 7, 0]], "<f4"), "VEC3")
    binary = add_accessor(tree, binary, np.array([[0], [1]], "<f4"), "SCALAR")
    binary = add_accessor(tree, binary, np.array([[0, 0, 0], [0, 0, 4]], "<f4"), "VEC3")
    tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}
    tree["animations"] = [
        {"samplers": [{"input": 3, "output": 4}],
         "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}
    ]  # fmt: skip
    rig = only_part(glb_file(tree, binary)).rig
    assert rig is not None and rig.binding.maps[:, :3, 3].tolist() == [[5, 0, 0], [0, 7, 0]]
    assert rig.binding.nodes.tolist() == [0, 0]


def test_one_scale_of_zero_flattens_two_hide(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    cube = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]]
    binary = add_accessor(tree, binary, np.array(cube, "<f4"), "VEC3")
    binary = add_accessor(tree, binary, np.array(faces, "<u2").reshape(-1, 1), "SCALAR")
    tree["meshes"][0]["primitives"] = [{"attributes": {"POSITION": 2}, "indices": 3}]
    tree["nodes"] = [{"mesh": 0, "scale": [1, 0, 2]}, {"mesh": 0, "scale": [0, 0, 1]}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    model = read_gltf(glb_file(tree, binary))
    (part,) = model.parts
    assert part.mesh.vertices[:, 1].tolist() == [0] * 8 and part.mesh.vertices[:, 2].max() == 2
    assert model.notes == ("nodes 1: transform = flat, as two scales of 0, its mesh is not shown",)
    tree["nodes"] = [{"mesh": 0, "scale": [-1, 1, 1]}, {"mesh": 0}]
    mesh = only_part(glb_file(tree, binary)).mesh
    assert mesh.vertices[:, 0].min() == -1
    own, mirrored = mesh.vertices[mesh.triangles[4]], mesh.vertices[mesh.triangles[0]]
    normals = [np.cross(corners[1] - corners[0], corners[2] - corners[0]) for corners in (own, mirrored)]
    assert np.allclose(normals[0] * [-1, 1, 1], normals[1])  # a mirrored front is still a front


def test_another_scene_is_listed_by_name(triangle_glb: Triangle, glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    tree["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 9], "name": "far"}]
    tree["scenes"] = [{"nodes": [1], "name": "Winter"}, {"nodes": [0], "name": "Summer"}]
    for scene, other, height in ((0, "Summer", 9), (1, "Winter", 0)):
        model = read_gltf(glb_file(tree | {"scene": scene}, binary))
        assert model.parts[0].mesh.vertices[:, 2].tolist() == [height] * 3
        found = {each.name: each for each in model.unshown}
        assert (
            set(found) == {"scenes.nodes", "nodes"}
            and f"the scene '{other}' is not shown" in found["scenes.nodes"].effect
        )


def test_a_material_without_area_does_not_refuse_the_others(
    triangle_glb: Triangle, glb_file: Callable[..., Path]
) -> None:
    tree, binary = triangle_glb
    tree["materials"] = [{}]
    tree["meshes"].append({"primitives": [tree["meshes"][0]["primitives"][0] | {"material": 0}]})
    tree["nodes"] = [{"mesh": 0}, {"mesh": 1, "scale": [1, 0, 1]}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    path = glb_file(tree, binary)
    model = read_gltf(path)
    assert len(model.parts) == 1 and model.notes == ("faces of material 0 = none with an area, left out",)
    assert len(load_scene(path).description.objects) == 2  # with the floor
    tree["scenes"] = [{"nodes": [1]}]
    with pytest.raises(LoadError, match="faces with an area = 0, expected at least one"):
        load_scene(glb_file(tree, binary))
