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
from engine.scene.loaders.gltf import read_gltf
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


def test_an_off_file_loses_faces_colours_and_concave_outlines(tmp_path: Path) -> None:
    cut = written(tmp_path, "cut.off", "OFF\n4 2 0\n" + CORNERS + "3 0 1 2\n")
    assert len(theirs(cut)) == 1
    with pytest.raises(LoadError, match="4 vertices and 2 faces"):
        read_mesh(cut)
    coloured = written(tmp_path, "c.off", "COFF\n4 1 0\n" + CORNERS.replace("\n", " 255 0 0 255\n") + "3 0 1 2\n")
    assert trimesh.load(coloured, process=False).visual.kind is None and read_mesh(coloured).colours is not None
    outline = "OFF\n6 1 0\n0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n0 2 0\n6 1 2 3 4 5 0\n"  # an L of area 3
    concave = written(tmp_path, "L.off", outline)
    assert trimesh.load(concave, process=False).area > 3.5
    a, b, c = (mesh := read_mesh(concave)).vertices[mesh.triangles].transpose(1, 0, 2)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(3.0)


def test_facets_of_an_stl_text_are_lost_or_mixed(tmp_path: Path) -> None:
    """What our checks before it refuse."""
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    solid = f"solid a\n{facet}{facet}endsolid a\n"
    cut = written(tmp_path, "cut.stl", solid + f"solid b\n{facet}")
    assert len(theirs(cut)) == 2  # the second solid is left out
    mixed = solid.replace("vertex 0 1 0\n", "", 1).replace("vertex 0 0 0\n", "vertex 0 0 0\nvertex 5 5 5\n", 1)
    mixed = mixed.replace("vertex 5 5 5\n", "").replace(
        "endloop\nendfacet\nendsolid", "vertex 5 5 5\nendloop\nendfacet\nendsolid"
    )
    shifted = written(tmp_path, "mixed.stl", mixed)  # two vertices in one facet, four in the other
    assert len(theirs(shifted)) == 2
    for path in (cut, shifted):
        with pytest.raises(LoadError, match="an end for each solid|expected three vertices"):
            read_mesh(path)


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
        read_gltf(path)


def test_skins_are_lost(shared_data: Path) -> None:
    (mesh,) = trimesh.load(shared_data / "glb" / "CesiumMan.glb", process=False).geometry.values()
    assert not {"JOINTS_0", "WEIGHTS_0"} & set(mesh.vertex_attributes)
