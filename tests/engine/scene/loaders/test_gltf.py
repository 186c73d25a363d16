"""GLB files: geometry, nodes and parts that are read."""

import copy
import json

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.bump_normals import corner_tangents
from engine.scene.loaders.gltf import read_gltf
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import TOY
from tests.engine.scene.loaders.conftest import spoil
from tests.scene_text import material


def test_one_triangle(triangle_glb, glb_file):
    model = read_gltf(glb_file(*triangle_glb))
    (part,) = model.parts
    assert part.mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert part.mesh.triangles.tolist() == [[0, 1, 2]]
    assert part.layers[0].model == "lambert"  # no material: plain grey
    assert model.notes == ()


def test_without_indices_corners_come_in_order(triangle_glb, glb_file):
    tree, binary = triangle_glb
    del tree["meshes"][0]["primitives"][0]["indices"]
    assert read_gltf(glb_file(tree, binary)).parts[0].mesh.triangles.tolist() == [[0, 1, 2]]


def test_interleaved_attributes_are_read_at_their_stride(triangle_glb, glb_file):
    tree, binary = triangle_glb
    rows = np.zeros((3, 6), "<f4")
    rows[:, :3] = np.frombuffer(binary, "<f4", 9).reshape(3, 3)
    rows[:, 5] = 2.0  # a normal along +Z, not unit
    tree["bufferViews"][0] |= {"byteLength": 72, "byteStride": 24}
    tree["bufferViews"][1]["byteOffset"] = 72
    tree["buffers"][0]["byteLength"] = 78
    tree["accessors"].append({"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC3"})
    tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2
    mesh = read_gltf(glb_file(tree, rows.tobytes() + binary[36:])).parts[0].mesh
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.normals is not None and mesh.normals.tolist() == [[0, 0, 1]] * 3


def test_nodes_place_meshes_and_instances_repeat_them(triangle_glb, glb_file):
    tree, binary = triangle_glb
    half = float(np.sqrt(0.5))
    tree["nodes"] = [
        {"children": [1, 2], "translation": [0, 0, 5]},
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 2, 2]},  # a quarter turn about Z, twice the size
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]},  # mirrored, moved by 7 along X
    ]
    mesh = read_gltf(glb_file(tree, binary)).parts[0].mesh
    assert np.allclose(mesh.vertices[:3], [[0, 0, 5], [0, 2, 5], [-2, 0, 5]])
    assert np.allclose(mesh.vertices[3:], [[7, 0, 5], [6, 0, 5], [7, 1, 5]])
    corners = mesh.vertices[mesh.triangles[1]]
    # the mirrored triangle still faces +Z, because its winding was turned with it
    assert np.cross(corners[1] - corners[0], corners[2] - corners[0])[2] > 0


def test_points_and_lines_are_left_out_with_a_note(triangle_glb, glb_file):
    tree, binary = triangle_glb
    tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1})
    assert read_gltf(glb_file(tree, binary)).notes == ("1 primitives of points or lines left out",)
    with pytest.raises(LoadError, match="faces = 0, expected at least one mesh of triangles"):
        read_gltf(glb_file(spoil(tree, "meshes.0.primitives.0.mode", 0), binary))


@pytest.mark.parametrize(("name", "n_triangles"), [("CesiumMan", 4672), ("Fox", 576)])
def test_agrees_with_an_independent_reader(shared_data, monkeypatch, name, n_triangles):
    """Which has no skins."""
    monkeypatch.setattr("engine.scene.loaders.gltf_rig.RigReader._hung", lambda *_: None)
    trimesh = pytest.importorskip("trimesh")
    path = shared_data / "glb" / f"{name}.glb"
    (part,) = read_gltf(path).parts
    theirs = trimesh.load(path, process=False).to_mesh()
    assert len(part.mesh.triangles) == n_triangles
    assert np.allclose(part.mesh.vertices[part.mesh.triangles], theirs.vertices[theirs.faces], atol=1e-6)


def with_accessor(triangle_glb, values, kind, **more) -> tuple[dict, bytes, int]:
    """The triangle's tree and binary chunk with one more accessor, and its number."""
    tree, binary = copy.deepcopy(triangle_glb[0]), triangle_glb[1] + bytes(-len(triangle_glb[1]) % 4)
    component = {"f4": 5126, "u2": 5123, "u1": 5121}[values.dtype.str[1:]]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
    accessor = {"bufferView": len(tree["bufferViews"]) - 1, "componentType": component, "count": len(values)}
    tree["accessors"].append(accessor | {"type": kind} | more)
    binary += values.tobytes()
    tree["buffers"][0]["byteLength"] = len(binary)
    return tree, binary, len(tree["accessors"]) - 1


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        # every second triangle of a strip is turned, so that all face +Z; one with a corner twice is left out
        (5, [[0, 1, 2], [1, 3, 2], [4, 5, 6]]),
        (6, [[1, 2, 0], [2, 3, 0], [4, 5, 0], [5, 6, 0]]),
    ],
)
def test_strips_and_fans(triangle_glb, glb_file, mode, expected):
    places = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]], "<f4")
    tree, binary, positions = with_accessor(triangle_glb, places, "VEC3")
    strip = [0, 1, 2, 3, 3, 4, 4, 5, 6] if mode == 5 else [0, 1, 2, 3, 3, 4, 5, 6]
    tree, binary, corners = with_accessor((tree, binary), np.array(strip, "<u2"), "SCALAR")
    tree["meshes"][0]["primitives"] = [{"attributes": {"POSITION": positions}, "indices": corners, "mode": mode}]
    triangles = read_gltf(glb_file(tree, binary)).parts[0].mesh.triangles
    kept = [sorted(each) for each in triangles.tolist()]
    for each in expected:
        assert sorted(each) in kept
    if mode == 5:
        corners = places[triangles]
        assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()


def test_sparse_accessors(triangle_glb, glb_file):
    tree, binary, index = with_accessor(triangle_glb, np.array([2], "<u1"), "SCALAR")
    tree, binary, value = with_accessor((tree, binary), np.array([[0, 3, 0]], "<f4"), "VEC3")
    views = [tree["accessors"][k]["bufferView"] for k in (index, value)]
    sparse = {
        "count": 1,
        "indices": {"bufferView": views[0], "componentType": 5121},
        "values": {"bufferView": views[1]},
    }
    tree["accessors"][0]["sparse"] = sparse
    assert read_gltf(glb_file(tree, binary)).parts[0].mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 3, 0]]
    # without a view all others are 0: the face has no area
    zeros = spoil(tree, "accessors.0.bufferView", None)
    assert read_gltf(glb_file(zeros, binary)).parts[0].mesh.vertices.tolist() == [[0, 0, 0], [0, 0, 0], [0, 3, 0]]
    with pytest.raises(LoadError, match="sparse: indices: indices = 2, expected indices from 0 to 1"):
        read_gltf(glb_file(spoil(tree, "accessors.0.count", 2), binary))
    with pytest.raises(LoadError, match="sparse: values: count = 2, expected an integer from 1 to 1"):
        read_gltf(
            glb_file(
                spoil(spoil(tree, "accessors.0.sparse.count", 2), "accessors.0.sparse.indices.bufferView", 0), binary
            )
        )
    with pytest.raises(LoadError, match="count = 1000000000, expected an integer from 1 to 10"):  # zeros cost nothing
        read_gltf(glb_file(spoil(zeros, "accessors.0.count", 10**9), binary))


def test_numbers_beyond_their_range_are_clamped_with_a_note(triangle_glb, glb_file):
    tree, binary = triangle_glb
    pbr = {"baseColorFactor": [1.0000000149, 0.5, 0.5, 1], "metallicFactor": -1e-9, "roughnessFactor": 1.25}
    tree["materials"] = [{"pbrMetallicRoughness": pbr}]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    model = read_gltf(glb_file(tree, binary))
    base, coat = model.parts[0].layers
    assert base.parameters["albedo"] == (1.0, 0.5, 0.5) and coat.parameters["alpha"] == 1.0
    place = "materials 0: pbrMetallicRoughness: "
    assert model.notes == (
        f"{place}baseColorFactor = 1.0000000149, taken as 1",
        f"{place}metallicFactor = -1e-09, taken as 0",
        f"{place}roughnessFactor = 1.25, taken as 1",
    )


def test_emission_is_factor_times_strength(triangle_glb, glb_file):
    tree, binary = triangle_glb
    tree["meshes"][0]["primitives"][0]["material"] = 0
    strong = {"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 10}}}
    for more, expected in (({}, (1.0, 0.5, 0.0)), (strong, (10.0, 5.0, 0.0))):
        tree["materials"] = [{"emissiveFactor": [1.5, 0.5, 0]} | more]
        model = read_gltf(glb_file(tree, binary))
        assert model.parts[0].emission.radiance == expected
        assert model.notes == ("materials 0: emissiveFactor = 1.5, taken as 1",)


def test_a_normal_that_is_no_number_is_computed(triangle_glb, glb_file):
    normals = np.array([[1, 0, 0], [np.nan, np.nan, np.nan], [0, 0, 2]], "<f4")
    tree, binary, number = with_accessor(triangle_glb, normals, "VEC3")
    tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = number
    model = read_gltf(glb_file(tree, binary))
    assert model.parts[0].mesh.normals.tolist() == [[1, 0, 0], [0, 0, 1], [0, 0, 1]]
    assert "NORMAL = 1 that are no numbers, computed from the faces" in model.notes[0]


def test_bytes_after_the_end_are_left_out_with_a_note(triangle_glb, glb_file):
    path = glb_file(*triangle_glb)
    path.write_bytes(path.read_bytes() + b"more")
    model = read_gltf(path)
    assert len(model.parts) == 1
    assert model.notes == ("4 bytes after the end that the header gives are left out",)


def test_json_with_a_mark_before_it_and_zeros_behind(triangle_glb, glb_file):
    tree, binary = triangle_glb
    text = b"\xef\xbb\xbf" + json.dumps(tree).encode() + b"\0\0\0\0"
    assert len(read_gltf(glb_file(tree, binary, text=text)).parts) == 1


def test_a_node_scaled_by_zero_shows_nothing(triangle_glb, glb_file):
    tree, binary = triangle_glb
    tree["nodes"] = [{"mesh": 0}, {"mesh": 0, "scale": [1, 0, 0], "children": [2]}, {"mesh": 0}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    model = read_gltf(glb_file(tree, binary))
    assert len(model.parts[0].mesh.triangles) == 1
    assert len(model.notes) == 2 and "nodes 1: transform = flat, as two scales of 0" in model.notes[0]


def test_quaternions_of_other_lengths_turn_by_their_direction(triangle_glb, glb_file):
    tree, binary = triangle_glb
    for rotation, turned in (([0, 0, 3, 3], [0, 1, 0]), ([0, 0, 0, 0], [1, 0, 0])):
        model = read_gltf(glb_file(spoil(tree, "nodes.0.rotation", rotation), binary))
        assert model.parts[0].mesh.vertices[1] == pytest.approx(turned, abs=1e-12)
        assert "nodes 0: rotation = " in model.notes[0]


def test_coordinates_that_are_no_numbers_do_not_refuse_a_file(triangle_glb, glb_file):
    tree, binary, uvs = with_accessor(triangle_glb, np.array([[np.nan, 0], [1, 0], [0, 1]], "<f4"), "VEC2")
    tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uvs
    model = read_gltf(glb_file(tree, binary))
    assert np.isfinite(model.parts[0].mesh.uvs).all() and "TEXCOORD_0 = 1 numbers beyond" in model.notes[0]


def test_a_mesh_without_normals_is_flat(triangle_glb, glb_file, scene_file):
    """Beside one with normals in the same object, too: two faces that share an edge at a right angle."""
    places = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1]], "<f4")
    tree, binary, positions = with_accessor(triangle_glb, places, "VEC3")
    tree, binary, corners = with_accessor((tree, binary), np.array([0, 1, 2, 0, 3, 1], "<u2"), "SCALAR")
    bare = {"attributes": {"POSITION": positions}, "indices": corners}
    tree["meshes"][0]["primitives"] = [bare]
    scene = load_scene(glb_file(tree, binary))
    assert scene.smooth.tolist() == [False, True]  # its own, and the floor
    tree, binary, normals = with_accessor((tree, binary), np.tile(np.array([[0, 1, 0]], "<f4"), (4, 1)), "VEC3")
    tree["meshes"][0]["primitives"] = [bare, {"attributes": bare["attributes"] | {"NORMAL": normals}}]
    tree, binary, third = with_accessor((tree, binary), np.array([1, 2, 3], "<u2"), "SCALAR")
    tree["meshes"][0]["primitives"][1]["indices"] = third
    for layer in ("", material('model = "lambert", albedo = 0.2')):
        glb_file(tree, binary)
        scene = load_scene(scene_file(TOY + layer))
        assert scene.smooth.tolist() == [True]
        at_corners = scene.normals[scene.triangles]
        assert np.allclose(at_corners[:2], [[[0, 0, 1]] * 3, [[0, -1, 0]] * 3])
        assert np.allclose(at_corners[2], (0, 1, 0))


def two_materials(tree: dict) -> dict:
    """The tree with the triangle twice, in a metal and in a shining dielectric."""
    tree = copy.deepcopy(tree)
    metal = {"baseColorFactor": [1, 0.5, 0, 1], "metallicFactor": 1, "roughnessFactor": 0.5}
    tree["materials"] = [
        {"pbrMetallicRoughness": metal},
        {"emissiveFactor": [1, 1, 0], "pbrMetallicRoughness": {"metallicFactor": 0}},
    ]
    primitive = tree["meshes"][0]["primitives"][0]
    tree["meshes"][0]["primitives"] = [primitive | {"material": 0}, primitive | {"material": 1}]
    return tree


def test_a_scene_object_becomes_one_object_a_material(triangle_glb, glb_file, scene_file):
    tree, binary = triangle_glb
    glb_file(two_materials(tree), binary)
    scene = load_scene(scene_file(TOY))
    first, second = scene.description.objects
    assert (first.name, first.part, second.name, second.part) == ("toy 1", 0, "toy 2", 1)
    assert [layer.model for layer in first.layers] == ["microfacet"]  # a metal has no diffuse part
    assert first.layers[0].parameters["alpha"] == 0.25  # roughness²
    assert second.emits and scene.emitters.tolist() == [False, True]


def test_parts_are_chosen_and_own_layers_win(triangle_glb, glb_file, scene_file):
    tree, binary = triangle_glb
    glb_file(two_materials(tree), binary)
    one = load_scene(scene_file(TOY + "part = 0\n"))
    assert len(one.triangles) == 1 and one.description.objects[0].name == "toy"
    own = load_scene(scene_file(TOY + material('model = "lambert", albedo = 0.2')))
    assert own.description.objects[0].layers[0].model == "lambert"
    assert len(own.triangles) == 1  # both parts are the same triangle, which is shown once
    with pytest.raises(LoadError, match="object 'toy': part = 2, expected a part from 0 to 1"):
        load_scene(scene_file(TOY + "part = 2\n"))


def with_tangents(triangle_glb, *tangents: float) -> tuple[dict, bytes]:
    """The triangle with normals along +Z, coordinates that grow along X and Y, and one tangent at all corners."""
    tree, binary = copy.deepcopy(triangle_glb)
    own = {
        "NORMAL": ("VEC3", np.tile([0, 0, 1], (3, 1))),
        "TEXCOORD_0": ("VEC2", np.array([[0, 1], [1, 1], [0, 0]])),  # v downwards
        "TANGENT": ("VEC4", np.tile(tangents, (3, 1))),
    }
    binary += bytes(-len(binary) % 4)
    for name, (kind, values) in own.items():
        data = values.astype("<f4").tobytes()
        tree["meshes"][0]["primitives"][0]["attributes"][name] = len(tree["accessors"])
        view = {"bufferView": len(tree["bufferViews"]), "componentType": 5126, "count": 3, "type": kind}
        tree["accessors"].append(view)
        tree["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary += data
    tree["buffers"][0]["byteLength"] = len(binary)
    return tree, binary


def test_tangents_are_the_file_s_and_a_mirror_turns_their_hand(triangle_glb, glb_file):
    tree, binary = with_tangents(triangle_glb, 0.6, 0.8, 0.0, -1.0)
    mirrored = [-2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 3, 0, 0, 1]
    for node, tangent, hand in (({"mesh": 0}, (0.6, 0.8, 0), -1), ({"mesh": 0, "matrix": mirrored}, (-0.6, 0.8, 0), 1)):
        tree["nodes"] = [node]
        tangents, hands = corner_tangents(load_scene(glb_file(tree, binary)), 0)
        assert np.allclose(tangents, tangent, atol=1e-6) and hands.tolist() == [hand]
    # Without them u grows along +X, with v to its left; beside no normals they count for nothing.
    for name in ("TANGENT", "NORMAL"):
        bare = spoil(tree, f"meshes.0.primitives.0.attributes.{name}", None)
        tangents, hands = corner_tangents(load_scene(glb_file(bare | {"nodes": [{"mesh": 0}]}, binary)), 0)
        assert np.allclose(tangents, (1, 0, 0), atol=1e-6) and hands.tolist() == [1]


def test_tangents_that_are_no_numbers_are_computed(triangle_glb, glb_file):
    model = read_gltf(glb_file(*with_tangents(triangle_glb, np.nan, 0.0, 0.0, 1.0)))
    assert model.parts[0].mesh.tangents is None
    assert any("TANGENT = 3 that are no numbers, all are computed" in note for note in model.notes)
    tree, binary = with_tangents(triangle_glb, 1.0, 0.0, 0.0, 1.0)
    tree["accessors"][-1]["count"] = 2
    model = read_gltf(glb_file(tree, binary))
    assert model.parts[0].mesh.tangents is None
    assert any("TANGENT = 2 rows, expected 3, as there are positions" in note for note in model.notes)
