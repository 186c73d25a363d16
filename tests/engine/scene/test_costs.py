"""The cost of small files is proportional to their bytes, counted in calls and bytes rather than in seconds."""

import io
import struct
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.scene._polygon_kernels import cut_ears
from engine.scene.description import ObjectDescription
from engine.scene.loaders.formats import read_model
from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.model import ImportedModel, ImportedPart
from engine.scene.object_meshes import _objects_of
from engine.scene.primitives import quad
from engine.scene.scene_loader import load_scene
from engine.texture import texture_files
from tests.engine.scene.conftest import TOY, n_calls, read_mesh
from tests.scene_text import placed

SQUARE_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def cpu_seconds(work: Callable[[], object]) -> float:
    """The least of three times: other programs on the machine lengthen some."""
    times = []
    for _ in range(3):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    return min(times)


def nodes(tree: dict, n: int, node: dict) -> dict:
    return tree | {"nodes": [node] * n, "scenes": [{"nodes": list(range(n))}]}


def primitives(tree: dict, n: int, **more: object) -> dict:
    (primitive,) = tree["meshes"][0]["primitives"]
    return tree | {"meshes": [{"primitives": [primitive | more for _ in range(n)]}]}


def empty_nodes(tree: dict) -> dict:
    return tree | {"nodes": [{"mesh": 0}, *[{}] * 4000], "scenes": []}


def moving_nodes(tree: dict) -> dict:
    """Copies that an animation could move; none is read of it."""
    return nodes(tree, 4000, {"mesh": 0}) | {"animations": [{}]}


GLB = {  # a file that costs much, and the calls a byte that it may cost
    "many nodes of one mesh": (lambda tree: nodes(tree, 4000, {"mesh": 0}), 3),  # it was 39
    "many nodes of one mesh beside an animation": (moving_nodes, 4),  # 46
    "many nodes of nothing": (empty_nodes, 6),  # 45
    "one list of triangles many times": (lambda tree: primitives(tree, 2000), 4),  # 14
    "materials that nothing has": (lambda tree: tree | {"materials": [{}] * 4000}, 4),  # 68
}


@pytest.mark.parametrize("name", GLB)
def test_glb_files_of_many_small_parts(name: str, triangle_glb: tuple[dict, bytes], glb_file: Callable) -> None:
    change, most = GLB[name]
    tree, binary = triangle_glb
    path = glb_file(change(tree), binary)
    read_gltf(path)  # what is imported at first is not counted
    assert n_calls(lambda: read_gltf(path)) <= most * path.stat().st_size


def test_parts_of_one_name_are_numbered_in_proportion() -> None:
    item = ObjectDescription(name="a", mesh="a.glb")

    def calls(n: int) -> int:
        model = ImportedModel((ImportedPart(quad(), name="leaf"),) * n)
        return n_calls(lambda: _objects_of(item, model, Path("a.glb"), set()))

    calls(2)  # what is imported at first is not counted
    assert calls(1600) < 5 * calls(400)


def png(side: int) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((side, side, 3), np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()


def textured(tree: dict, binary: bytes, image: bytes, n: int, **pbr: object) -> tuple[dict, bytes]:
    """n materials in use, each with an image of its own that is the same bytes, by the names in `pbr`."""
    binary += b"\0\0" + struct.pack("<6f", 0, 0, 1, 0, 0, 1)
    views = [
        *tree["bufferViews"],
        {"buffer": 0, "byteOffset": 44, "byteLength": 24},
        {"buffer": 0, "byteOffset": 68, "byteLength": len(image)},
    ]
    accessors = [*tree["accessors"], {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"}]
    (primitive,) = tree["meshes"][0]["primitives"]
    primitive = primitive | {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}}
    return tree | {
        "buffers": [{"byteLength": 68 + len(image)}], "bufferViews": views, "accessors": accessors,
        "images": [{"bufferView": 3}] * n, "textures": [{"source": k} for k in range(n)],
        "materials": [{"pbrMetallicRoughness": {key: {"index": k} for key in pbr}} for k in range(n)],
        "meshes": [{"primitives": [primitive | {"material": k} for k in range(n)]}],
    }, binary + image  # fmt: skip


@pytest.fixture
def n_decoded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by one whenever an image is decoded."""
    decoded: list[int] = []
    read = texture_files._integers

    def note(*given: Any) -> Any:
        decoded.append(1)
        return read(*given)

    monkeypatch.setattr(texture_files, "_integers", note)
    return decoded


@pytest.mark.parametrize("use", ["metallicRoughnessTexture", "baseColorTexture"])
def test_an_image_that_is_there_many_times_is_decoded_once(
    use: str, triangle_glb: tuple[dict, bytes], glb_file: Callable, scene_file: Callable, n_decoded: list[int]
) -> None:
    glb_file(*textured(*triangle_glb, png(8), 20, **{use: True}))
    load_scene(scene_file(TOY))
    assert sum(n_decoded) == 1


def test_images_of_more_pixels_than_a_file_is_worth_are_left_out(
    triangle_glb: tuple[dict, bytes], glb_file: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.scene.loaders.gltf_images.MOST_PIXELS", 0)
    model = read_gltf(glb_file(*textured(*triangle_glb, png(256), 1, baseColorTexture=True)))
    (part,) = model.parts
    assert all(layer.maps.is_plain for layer in part.layers)
    assert model.notes == ("images are not shown that have, with those before them, too many pixels for such a file",)


def test_lines_that_go_on_cost_in_proportion(mesh_file: Callable[..., Path]) -> None:
    def face(n: int) -> Callable[[], object]:
        path = mesh_file(f"{n}.obj", SQUARE_OBJ + "f 1 2 3 \\\n" + "\\\n" * n + "1\n")
        return lambda: read_mesh(path)

    face(1000)()
    # Eight times as many lines: 8 in proportion; joined line by line they were 45 to 60.
    assert cpu_seconds(face(240_000)) < 25 * cpu_seconds(face(30_000))


def test_material_libraries_cost_nothing(mesh_file: Callable[..., Path]) -> None:
    path = mesh_file("same.obj", SQUARE_OBJ + "mtllib a b\n" * 1000 + "f 1 2 3\n")
    assert n_calls(lambda: read_mesh(path)) <= 2 * path.stat().st_size  # it was 47


def test_an_outline_that_crosses_itself_without_end_stays_a_fan_after_steps_in_proportion(
    mesh_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ears are cut in steps whose number grows with the square of such an outline's corners."""
    allowed: list[int] = []

    def note(flat: object, starts: object, lengths: object, most_steps: int, *found: object) -> tuple[int, int]:
        allowed.append(most_steps)
        return cut_ears(flat, starts, lengths, most_steps, *found)

    monkeypatch.setattr("engine.scene._polygon_kernels.cut_ears", note)
    monkeypatch.setattr("engine.scene.polygons._FEWEST_STEPS", 0)
    rng = np.random.default_rng(5)
    places = "".join(f"v {x:.3f} {y:.3f} 0\n" for x, y in rng.normal(size=(900, 2)).tolist())
    path = mesh_file("wild.obj", places + "f " + " ".join(map(str, rng.integers(1, 900, 15_000))) + "\n")
    model = read_model(path)
    assert "faces of 15000 corners and more: 1 not cut exactly, which would take too long" in model.notes
    assert allowed == [400 * path.stat().st_size]  # 1 s a megabyte


def ply_of_lists(n: int) -> bytes:
    """A card and, after it, n rows of 16 lists without a number in them, but for the last."""
    lists = "".join(f"property list uchar uchar p{k}\n" for k in range(16))
    head = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\n"
        f"element extra {n}\n{lists}end_header\n"
    )
    card = struct.pack("<9fB3i", 0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2)
    return head.encode() + card + bytes(16 * n - 1) + b"\1\0"


def test_ply_lists_that_nobody_asks_for_are_stepped_over(mesh_file: Callable[..., Path]) -> None:
    path = mesh_file("lists.ply", ply_of_lists(4000))
    read_mesh(path)
    assert n_calls(lambda: read_mesh(path)) <= 2 * path.stat().st_size  # it was 7
    tracemalloc.start()
    try:
        read_mesh(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak <= 4 * path.stat().st_size  # it was 150


def test_lists_of_different_lengths_hold_what_they_held(mesh_file: Callable[..., Path]) -> None:
    # Rows of a list, a number and the corners: each length but the corners' differs from row to row.
    head = (
        "ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 3\nproperty list ushort double extra\nproperty uchar flag\n"
        "property list uint short vertex_index\nend_header\n"
    )
    vertices = struct.pack(">12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)
    rows = struct.pack(">HBI3h", 0, 7, 3, 0, 1, 2) + struct.pack(">H2dBI4h", 2, 0.5, 1.5, 7, 4, 3, 2, 1, 0)
    rows += struct.pack(">HdBI3h", 1, 0.5, 7, 3, 1, 2, 3)
    mesh = read_mesh(mesh_file("rows.ply", head.encode() + vertices + rows))
    assert mesh.triangles.tolist() == [[0, 1, 2], [3, 2, 1], [3, 1, 0], [1, 2, 3]]


def test_too_many_triangles_are_refused_before_copies_are_made(
    scene_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.scene.scene_placement.MAX_TRIANGLES", 20)
    monkeypatch.setattr("engine.scene.scene_placement.place_copies", None)
    cubes = "".join(placed(str(k), "cube") for k in range(2))
    with pytest.raises(LoadError, match="triangles = 24, expected at most 20"):
        load_scene(scene_file(cubes))
