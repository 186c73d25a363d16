"""The scene of a single mesh: framed, on a floor, lit, with materials."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.core.camera import project
from engine.core.errors import LoadError
from engine.scene.scene_loader import Scene, load_scene

HEAD = (
    "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
)
FACES = "3 0 1 2\n3 0 3 1\n3 0 2 3\n3 1 3 2\n"  # a tetrahedron; the fifth vertex is of no face


def tetrahedron(size: float, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    corners = size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) + place
    rows = [*corners.tolist(), [100.0 * size, 0.0, 0.0]]
    return HEAD + "".join(f"{x:.17g} {y:.17g} {z:.17g}\n" for x, y, z in rows) + FACES


def seen_of(scene: Scene, i_object: int) -> np.ndarray:
    """Where the picture shows an object's vertices, (N, 2), as shares of its sides."""
    first, last = scene.triangle_ranges[i_object]
    vertices = scene.vertices[np.unique(scene.triangles[first:last])]
    camera = scene.description.camera
    return project(camera, scene.resolution, vertices - scene.camera_position) / scene.resolution


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (3.0, -20.0, 5.0)])
def test_a_mesh_fills_the_picture_and_stands_on_a_floor(
    mesh_file: Callable[..., Path], size: float, place: tuple[float, float, float]
) -> None:
    place = (place[0] * size, place[1] * size, place[2] * size)
    scene = load_scene(mesh_file("Old [thing].ply", tetrahedron(size, place)))
    thing, floor = scene.description.objects
    assert (thing.name, floor.name) == ("Old _thing_", "floor")
    shown = seen_of(scene, 0)
    assert shown.min() > 0.05 and shown.max() < 0.95
    assert np.ptp(shown, axis=0).max() > 0.4  # and is no speck in it
    low = scene.vertices[:, 1].min() + scene.origin[1]
    assert place[1] - 1e-3 * size < low < place[1]  # the floor is the lowest, just below the mesh
    first, last = scene.triangle_ranges[1]
    assert np.allclose(scene.geometric_normals[first:last], [0, 1, 0])
    assert scene.camera_position[1] + scene.origin[1] > place[1] + size  # seen from above


def test_it_is_grey_lit_and_editable(mesh_file: Callable[..., Path]) -> None:
    scene = load_scene(mesh_file("thing.ply", tetrahedron(1.0)), (40, 30))
    thing, floor = scene.description.objects
    assert [layer.model for layer in (*thing.layers, *floor.layers)] == ["lambert", "lambert"]
    assert thing.editable and floor.editable
    assert scene.notes == ("thing: without a material, shown in a grey that can be edited",)
    assert scene.environment_path is not None and scene.environment_path.is_file()
    assert scene.resolution == (40, 30) and scene.description.name == "thing"


def test_a_glb_brings_its_materials(triangle_glb: tuple[dict, bytes], glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    (primitive,) = tree["meshes"][0]["primitives"]
    tree["materials"] = [{}, {"emissiveFactor": [1, 1, 1]}]
    tree["meshes"][0]["primitives"] = [primitive | {"material": k} for k in range(2)]
    scene = load_scene(glb_file(tree, binary))
    first, second, floor = scene.description.objects
    assert [first.name, second.name, floor.name] == ["model 1", "model 2", "floor"]
    assert first.layers and second.emits
    assert second.layers and scene.reflecting.all() and not scene.notes  # it shines and reflects


def test_an_object_that_is_called_floor_keeps_its_name(mesh_file: Callable[..., Path]) -> None:
    scene = load_scene(mesh_file("floor.ply", tetrahedron(1.0)))
    assert [described.name for described in scene.description.objects] == ["floor", "floor+"]


@pytest.mark.parametrize(("size", "place"), [(1e-9, (0.0, 0.0, 0.0)), (1e8, (0.0, 0.0, 0.0)), (1.0, (2e9, 0.0, 0.0))])
def test_what_is_too_small_too_large_or_too_far_is_named(
    mesh_file: Callable[..., Path], size: float, place: tuple[float, float, float]
) -> None:
    said = r"thing\.ply: extent of the mesh = .* expected at least 2e-08 m, within 1e\+09 m"
    with pytest.raises(LoadError, match=said):
        load_scene(mesh_file("thing.ply", tetrahedron(size, place)))


def test_more_materials_than_there_may_be_objects(mesh_file: Callable[..., Path]) -> None:
    binary = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    tree = {
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": 36}], "nodes": [{"mesh": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "materials": [{}] * 4096,
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": k} for k in range(4096)]}],
    }  # fmt: skip
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path = mesh_file("many.glb", struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    with pytest.raises(LoadError, match="materials = 4096, expected at most 4095"):
        load_scene(path)


def names_of(tree: dict, binary: bytes, glb_file: Callable[..., Path]) -> list[tuple[str, str]]:
    """The name of each object, and its name in sessions of version 2."""
    return [(each.name, each.former_name) for each in load_scene(glb_file(tree, binary)).description.objects[:-1]]


def test_objects_are_called_as_in_the_file(triangle_glb: tuple[dict, bytes], glb_file: Callable[..., Path]) -> None:
    tree, binary = triangle_glb
    (primitive,) = tree["meshes"][0]["primitives"]
    tree["materials"] = [{"name": name} for name in ("Oak", "Brass", "Oak", "")]
    one, two, three, four = (primitive | {"material": k} for k in range(4))
    tree["meshes"] = [
        {"name": "table", "primitives": [one]}, {"name": "lamp", "primitives": [two, three]}, {"primitives": [four]},
    ]  # fmt: skip
    tree["nodes"] = [{"mesh": 0, "name": "Table.001"}, {"mesh": 1, "name": "Lamp"}, {"mesh": 2}]
    tree["scenes"] = [{"nodes": [0, 1, 2]}]
    # A node that is a part is called as itself; of the lamp's two parts each is called as its material; without any
    # name it is a number. A point separates paths.
    assert [name for name, _ in names_of(tree, binary, glb_file)] == ["Table_001", "Brass", "Oak", "model 4"]
    assert [former for _, former in names_of(tree, binary, glb_file)] == [f"model {k}" for k in (1, 2, 3, 4)]
    # Two nodes of one material are one part, called as that; a node without a name is called as its mesh.
    tree["nodes"] = [{"mesh": 0, "name": "A"}, {"mesh": 0, "name": "B"}, {"mesh": 1}, {"mesh": 2, "name": "C"}]
    tree["scenes"] = [{"nodes": [0, 1, 2, 3]}]
    assert [name for name, _ in names_of(tree, binary, glb_file)] == ["Oak", "Brass", "Oak_001", "C"]
    tree["nodes"][0] = {"mesh": 0}
    tree["scenes"] = [{"nodes": [0, 3]}]
    assert [name for name, _ in names_of(tree, binary, glb_file)] == ["table", "C"]
