"""GLB files that are broken or hostile: each is refused in one line, or listed and shown without what is wrong."""

import struct

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.gltf import read_gltf
from tests.engine.scene.loaders.conftest import spoil


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        ("asset.version", "1.0", "asset: version = 1.0, expected 2.0"),
        ("asset", None, "asset: version = nothing, expected 2.0"),
        ("asset", 3, "asset: version = nothing, expected 2.0"),
        ("buffers.0.uri", "../../x.bin", "buffers 0: uri = ../../x.bin (outside the scene folder)"),
        ("buffers.0.uri", "/etc/passwd", "buffers 0: uri = /etc/passwd, expected a relative path"),
        ("buffers.0.uri", "http://x.org/a", "buffers 0: uri = http://x.org/a, expected a relative path"),
        ("buffers.0.uri", "other.bin", "other.bin: file = No such file or directory, expected a readable file"),
        ("buffers.0.uri", "data:;base64,AAAA", "buffers 0: byteLength = 42 in data truncated at byte 3"),
        ("buffers.0.uri", "data:,A", "buffers 0: uri = data:,A, expected data in base64"),
        ("buffers.0.byteLength", 10**9, "buffers 0: byteLength = 1000000000 in a binary chunk truncated at byte 44"),
        ("buffers", [], "bufferViews 0: buffer = 0, expected none: the file has nothing to point at"),
        ("accessors.0.count", 10**9, "accessors 0: count = 1000000000, expected an integer from 1 to 3"),
        ("accessors.0.count", 10**10, "accessors 0: count = 10000000000, expected an integer from 1 to 3"),
        ("accessors.0.count", -1, "accessors 0: count = -1, expected an integer from 1 to 3"),
        ("accessors.0.count", 0, "accessors 0: count = 0, expected an integer from 1 to 3"),
        ("accessors.0.count", 4, "accessors 0: count = 4, expected an integer from 1 to 3"),
        ("accessors.0.count", 3.0, "accessors 0: count = 3.0, expected an integer"),
        ("accessors.0.count", None, "accessors 0: count = nothing, expected an integer"),
        ("accessors.0.byteOffset", 10**12, "accessors 0: byteOffset = 1000000000000, expected an integer from 0 to 36"),
        ("accessors.0.byteOffset", 30, "accessors 0: count = 3, expected at least 1 and at most 0"),
        ("accessors.0.type", "VEC2", "accessors 0: type = VEC2, expected VEC3 for POSITION"),
        ("accessors.0.componentType", 5125, "accessors 0: componentType = 5125, expected one of 5126, 5120, 5121, 512"),
        ("accessors.1.componentType", 5126, "accessors 1: componentType = 5126, expected one of 5121, 5123, 5125"),
        ("accessors.0.sparse", {"count": 9}, "accessors 0: sparse: count = 9, expected an integer from 0 to 3"),
        ("accessors.0.sparse", {"count": 1}, "sparse: indices: componentType = nothing, expected an integer"),
        ("accessors.0.bufferView", None, "accessors 0: bufferView = nothing, expected a view of positions"),
        ("accessors.0.bufferView", 9, "accessors 0: bufferView = 9, expected an integer from 0 to 1"),
        ("bufferViews.0.byteStride", 0, "bufferViews 0: byteStride = 0, expected an integer from 12 to 252"),
        ("bufferViews.0.byteStride", 8, "bufferViews 0: byteStride = 8, expected an integer from 12 to 252"),
        ("bufferViews.0.byteOffset", 10**12, "bufferViews 0: byteOffset = 1000000000000, expected"),
        ("bufferViews.0.byteLength", 100, "bufferViews 0: byteLength = 100, expected an integer from 1 to 44"),
        ("bufferViews.0.buffer", 1, "bufferViews 0: buffer = 1, expected an integer from 0 to 0"),
        ("meshes.0.primitives.0.attributes", {}, "attributes: POSITION = nothing, expected an accessor of positions"),
        ("meshes.0.primitives.0.attributes", [], "attributes = [], expected an object"),
        ("meshes.0.primitives.0.attributes.POSITION", 7, "POSITION = 7, expected an integer from 0 to 1"),
        ("meshes.0.primitives.0.mode", 7, "mode = 7, expected an integer from 0 to 6"),
        ("meshes.0.primitives.0", 3, "primitives 0: attributes: POSITION = nothing"),
        ("meshes.0.primitives", 3, "meshes 0: primitives = 3, expected a list"),
        ("nodes.0.mesh", 5, "nodes 0: mesh = 5, expected an integer from 0 to 0"),
        ("nodes.0.matrix", [1e30] + [0] * 14 + [1], "nodes 0: transform = [1e+30"),
        ("nodes.0.matrix", [0] * 15 + [1], "at least one mesh of triangles in the scene: nodes 0: transform = flat"),
    ],
)
def test_each_lie_in_the_json_is_named(triangle_glb, glb_file, path, value, line):
    tree, binary = triangle_glb
    with pytest.raises(LoadError) as caught:
        read_gltf(glb_file(spoil(tree, path, value), binary))
    text = str(caught.value)
    assert line in text and text.endswith("; nothing was changed") and "\n" not in text


@pytest.mark.parametrize(
    ("path", "value", "name", "note"),
    [
        ("extensionsRequired", 3, "extensionsRequired", "extensionsRequired = 3, expected a list"),
        ("accessors.0.normalized", 1, "accessors.normalized", "normalized = 1, expected true or false"),
        ("meshes.0.primitives.0.material", 0, "meshes.primitives.material", "material = 0, expected none"),
        ("meshes.0.primitives.0.attributes.NORMAL", 7, "meshes.primitives.attributes.NORMAL", "NORMAL = 7"),
        ("meshes.0.primitives.0.attributes.COLOR_0", 1, "meshes.primitives.attributes.COLOR_0", "type = SCALAR"),
        ("meshes.0.primitives.0.attributes.TEXCOORD_0", 0, "meshes.primitives.attributes.TEXCOORD_0", "type = VEC3"),
        ("nodes.0.children", [7], "nodes.children", "nodes 0: children = [7], expected a list of indices"),
        ("nodes.0.matrix", [1] * 15, "nodes.matrix", "nodes 0: matrix = [1, 1"),
        ("nodes.0.matrix", [float("nan")] * 16, "nodes.matrix", "nodes 0: matrix = [nan"),
        ("nodes.0.translation", [10**400, 0, 0], "nodes.translation", "nodes 0: translation = [1000"),
        ("nodes.0.skin", 7, "nodes.skin", ""),
        ("nodes.0.camera", 7, "nodes.camera", ""),
        ("nodes.0.extensions", {"KHR_lights_punctual": {"light": 4}}, "nodes.KHR_lights_punctual.light", ""),
        ("scene", 3, "scene", "scene = 3, expected an integer from 0 to 0"),
        ("animations", [3], "animations", "animations 0 = 3, expected an object"),
        ("materials", 3, "materials", "materials = 3, expected a list of objects"),
    ],
)
def test_a_lie_about_what_can_be_left_out_is_listed_and_the_rest_shown(triangle_glb, glb_file, path, value, name, note):
    tree, binary = triangle_glb
    tree["extensions"] = {"KHR_lights_punctual": {"lights": []}}
    model = read_gltf(glb_file(spoil(tree, path, value), binary))
    assert model.parts[0].mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert [each.count for each in model.unshown if each.name == name] == [1], model.unshown
    assert any(note in each for each in model.notes) or not note, model.notes


def test_a_mesh_that_cannot_be_read_is_listed_beside_one_that_can(triangle_glb, glb_file):
    tree, binary = triangle_glb
    whole = tree["meshes"][0]["primitives"][0]
    broken = [{"attributes": {"POSITION": 9}}, 3, whole | {"indices": 0}, {"attributes": {"POSITION": 0}, "mode": 9}]
    tree["meshes"][0]["primitives"] += broken
    tree["nodes"] += [{"mesh": 9}, {"mesh": 0, "matrix": [1e30] + [0] * 14 + [1]}]
    tree["scenes"][0]["nodes"] = [0, 1, 2]
    model = read_gltf(glb_file(tree, binary))
    assert len(model.parts) == 1 and len(model.parts[0].mesh.triangles) == 1
    listed = {each.name: each.count for each in model.unshown}
    assert listed["meshes.primitives.attributes"] == 4
    assert listed["nodes.mesh"] == 1 and listed["nodes.transform"] == 1


def test_indices_out_of_range_and_vertices_that_are_no_numbers(triangle_glb, glb_file):
    tree, binary = triangle_glb
    with pytest.raises(LoadError, match="faces = 0, .* faces = 1 with an index that is not from 0 to 2, left out"):
        read_gltf(glb_file(tree, binary[:40] + b"\x09\x00"))
    with pytest.raises(LoadError, match=r"faces = 0, .* faces = 1 with a corner that is no number, left out"):
        read_gltf(glb_file(tree, binary[:12] + struct.pack("<f", float("nan")) + binary[16:]))
    with pytest.raises(LoadError, match="faces = 0, .* faces = 0, left out"):
        read_gltf(glb_file(spoil(tree, "accessors.1.count", 2), binary))


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"", "size = truncated at byte 0, expected a header of 12 bytes"),
        (b"glTF", "size = truncated at byte 4, expected a header of 12 bytes"),
        (b"glXF" + struct.pack("<II", 2, 12), "magic = glXF, expected glTF"),
        (b"PK\x03\x04" + b"\0" * 20, "magic = PK"),
        (b"glTF" + struct.pack("<II", 1, 12), "container version = 1, expected GLB 2"),
        (b"glTF" + struct.pack("<II", 2, 12), "chunk at byte 12 = truncated at byte 12"),
        (b"glTF" + struct.pack("<IIII", 2, 20, 0xFFFFFFF0, 0x4E4F534A), "corrupt chunk at byte 12: length = 429496"),
        (b"glTF" + struct.pack("<IIII", 2, 20, 0, 0x004E4942), "first chunk = 0x4e4942, expected JSON"),
        (b"glTF" + struct.pack("<IIII", 2, 20, 0, 0x4E4F534A), "JSON = "),
        (b"glTF" + struct.pack("<II", 2, 11) + b"\0" * 20, "chunk at byte 12 = truncated at byte 11"),
    ],
)
def test_broken_containers_are_named(mesh_file, data, line):
    with pytest.raises(LoadError) as caught:
        read_gltf(mesh_file("bad.glb", data))
    assert line in str(caught.value)


def test_every_cut_of_a_file_is_refused(triangle_glb, glb_file, mesh_file):
    whole = glb_file(*triangle_glb).read_bytes()
    for end in range(0, len(whole), 7):
        with pytest.raises(LoadError, match="truncated at byte"):
            read_gltf(mesh_file("cut.glb", whole[:end]))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (b"[" * 200_000, "JSON = too deep"),
        (b'{"a":' * 200_000, "JSON = too deep"),
        (b"[]", "JSON root = list, expected an object"),
        (b"3", "JSON root = int, expected an object"),
        (b"{", "JSON = "),
        (b"\xff\xfe", "JSON = "),
    ],
)
def test_json_that_is_none_or_too_much(glb_file, text, line):
    with pytest.raises(LoadError) as caught:
        read_gltf(glb_file(None, text=text))
    assert line in str(caught.value)


def test_twenty_thousand_nested_nodes_are_too_deep(triangle_glb, glb_file):
    tree, binary = triangle_glb
    tree["nodes"] = [{"children": [k + 1]} for k in range(20_000)] + [{"mesh": 0}]
    with pytest.raises(
        LoadError, match=r"in the scene: nodes 256: children = \[257\], left out: deeper than 256 levels"
    ):
        read_gltf(glb_file(tree, binary))


def test_instances_do_not_multiply_without_bound(triangle_glb, glb_file, monkeypatch):
    monkeypatch.setattr("engine.scene.loaders.gltf.MOST_COPIED", 300)
    tree, binary = triangle_glb
    tree["nodes"] = [{"mesh": 0}] * 101
    tree["scenes"] = [{"nodes": list(range(101))}]
    # three vertices and a face each; 44 bytes of numbers
    with pytest.raises(LoadError, match="vertices and faces of all copies = 404, expected at most 344 in a file of"):
        read_gltf(glb_file(tree, binary))  # a small file could ask for terabytes


def test_random_damage_ends_in_a_model_or_one_error(triangle_glb, glb_file):
    rng = np.random.default_rng(2)
    whole = bytearray(glb_file(*triangle_glb).read_bytes())
    path, outcomes = glb_file(*triangle_glb), set()
    for _ in range(500):
        data = bytearray(whole)
        for at in rng.integers(20, len(data), 2):
            data[at] = rng.integers(0, 256)
        path.write_bytes(bytes(data))
        try:
            outcomes.add(type(read_gltf(path)).__name__)
        except LoadError as error:
            outcomes.add(type(error).__name__)
    assert outcomes == {"ImportedModel", "LoadError"}  # never another exception
