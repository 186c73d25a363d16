"""What trimesh makes of files that our own readers read or refuse: why there are such (see `engine.scene.mesh`).

Each test holds what our reader says against what trimesh 5 says. Where one fails because trimesh has learned better,
the reader of that format may go.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.gltf import read_glb
from tests.engine.scene.conftest import pack_glb, read_mesh

trimesh = pytest.importorskip("trimesh")

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLY = (
    "ply\nformat {} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
CORNERS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def theirs(path: Path) -> list[list[int]]:
    """The faces that trimesh reads, left as they are."""
    options: dict[str, Any] = {"process": False, "skip_materials": True, "maintain_order": True, "force": "mesh"}
    return trimesh.load(path, **options).faces.tolist()


def written(folder: Path, name: str, data: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def test_indices_of_an_obj_file_count_back_from_where_they_stand(tmp_path: Path) -> None:
    # Wavefront's -4 is the fourth vertex before the face; trimesh counts from the end of the file, without a word.
    path = written(tmp_path, "a.obj", SQUARE + "f -4 -3 -2\nv 9 9 9\nv 8 8 8\n")
    assert read_mesh(path).triangles.tolist() == [[0, 1, 2]]
    assert theirs(path) == [[2, 3, 4]]


@pytest.mark.parametrize("face", ["f 0 1 2", "f 1/1/1/1 2 3", "f 1//1 2//1 3//1", "f 1 2 3 \\"])
def test_faulty_obj_faces_are_taken_without_a_word(tmp_path: Path, face: str) -> None:
    path = written(tmp_path, "a.obj", SQUARE + face)
    assert len(theirs(path)) == 1
    with pytest.raises(LoadError, match="line 5"):
        read_mesh(path)


def test_an_obj_face_may_end_in_a_comment(tmp_path: Path) -> None:
    path = written(tmp_path, "a.obj", SQUARE + "f 1 2 3 # the first\n")
    assert read_mesh(path).triangles.tolist() == [[0, 1, 2]]
    with pytest.raises(ValueError, match="unmatched data"):
        theirs(path)


def test_binary_ply_files_hold_polygons_of_different_size(tmp_path: Path) -> None:
    faces = struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 3)
    corners = np.array(CORNERS.split(), "<f4").tobytes()
    path = written(tmp_path, "a.ply", PLY.format("binary_little_endian", 2).encode() + corners + faces)
    assert read_mesh(path).triangles.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]
    with pytest.raises(ValueError, match="unexpected length"):
        theirs(path)


@pytest.mark.parametrize("face", ["3 0 1 1.5", "1000000000 0 1 2", "3 0 1 2 3"])
def test_faulty_ply_rows_are_taken_without_a_word(tmp_path: Path, face: str) -> None:
    path = written(tmp_path, "a.ply", PLY.format("ascii", 1) + CORNERS + face + "\n")
    assert len(theirs(path)) == 1
    with pytest.raises(LoadError, match="expected"):
        read_mesh(path)


@pytest.mark.parametrize(
    "lie",
    [
        {"asset": {"version": "1.0"}},
        {"buffers": [{"byteLength": 10**9}]},
        {"accessors 0": {"sparse": {"count": 1}}},  # the true positions are elsewhere
        {"accessors 0": {"type": "VEC2"}},
        {"bufferViews 0": {"byteStride": 8}},
        {"nodes 0": {"scale": [1, 0, 0]}},
        {"nodes 0": {"children": [0]}},
        {"meshes 0": {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 7}]}},
    ],
)
def test_faulty_glb_files_are_taken_without_a_word(
    triangle_glb: tuple[dict, bytes], tmp_path: Path, lie: dict[str, Any]
) -> None:
    tree, binary = triangle_glb
    for place, value in lie.items():
        name, _, index = place.partition(" ")
        if index:
            tree[name][int(index)] |= value
        else:
            tree[name] = value
    path = written(tmp_path, "a.glb", pack_glb(tree, binary))
    assert theirs(path) == [[0, 1, 2]]
    with pytest.raises(LoadError, match="expected"):
        read_glb(path)


def test_skins_are_lost(shared_data: Path) -> None:
    (mesh,) = trimesh.load(shared_data / "glb" / "CesiumMan.glb", process=False).geometry.values()
    assert not {"JOINTS_0", "WEIGHTS_0"} & set(mesh.vertex_attributes)
