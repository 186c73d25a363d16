"""OFF files: what is read, and how each kind of error is reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.core.colour import decode_srgb
from engine.core.errors import LoadError
from engine.scene.loaders.formats import read_model
from tests.engine.scene.conftest import read_mesh

PLACES = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def test_counts_on_either_line_comments_and_polygons(mesh_file: Callable[..., Path]) -> None:
    for head in ("OFF\n# made here\n4 2 0\n", "OFF 4 2 5 # counts\n\n"):
        mesh = read_mesh(mesh_file("a.off", head + PLACES + "4 0 1 2 3 # all\n3 1 2 3\n"))
        assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [1, 2, 3]]
        assert mesh.normals is None and mesh.colours is None


def test_a_concave_polygon_keeps_its_area(mesh_file: Callable[..., Path]) -> None:
    text = "OFF\n6 1 0\n0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n0 2 0\n6 1 2 3 4 5 0\n"
    mesh = read_mesh(mesh_file("L.off", text))
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(3.0)


def test_normals_colours_and_texture_coordinates_stand_behind_positions(mesh_file: Callable[..., Path]) -> None:
    rows = "".join(f"{place} 0 0 1 255 0 128 255 0.5 {k}\n" for k, place in enumerate(PLACES.splitlines()))
    mesh = read_mesh(mesh_file("a.off", "STCNOFF\n4 1 0\n" + rows + "4 0 1 2 3\n"))
    assert mesh.normals is not None and mesh.normals.tolist() == [[0, 0, 1]] * 4
    assert mesh.uvs is not None and mesh.uvs[1].tolist() == [[0.5, 0.0], [0.5, 2.0], [0.5, 3.0]]
    assert mesh.colours is not None
    np.testing.assert_allclose(mesh.colours[0, 0], [1.0, 0.0, decode_srgb(np.array([128 / 255]))[0], 1.0], rtol=1e-6)


def test_colours_of_faces_are_integers_or_shares(mesh_file: Callable[..., Path]) -> None:
    faces = "3 0 1 2 255 0 0\n3 0 2 3 0.0 1.0 0.0 1.0\n3 0 1 3\n3 1 2 3 7\n"
    found = read_model(mesh_file("a.off", "OFF\n4 4 0\n" + PLACES + faces))
    colours = found.parts[0].mesh.colours
    assert colours is not None
    assert colours[:, 0].tolist() == [[1, 0, 0, 1], [0, 1, 0, 1], [1, 1, 1, 1], [1, 1, 1, 1]]
    assert [(each.name, each.count) for each in found.unshown] == [("face.colour index", 1)]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "first word = nothing, expected OFF"),
        ("off\n", "first word = off"),
        ("4OFF\n1 1 1\n", "line 1 = 4OFF, expected OFF in text, with three coordinates"),
        ("OFF BINARY\n", "line 1 = OFF BINARY"),
        ("OFF\n", "the numbers of vertices, faces and edges"),
        ("OFF\n4 x 0\n", "line 2 = 4 x 0, expected the numbers"),
        ("OFF\n4 1 0\n" + PLACES, "lines = 4, expected 4 vertices and 1 faces, as line 2 counts"),
        ("OFF\n999999999 1 0\n" + PLACES, "lines = 4, expected 999999999 vertices"),
        ("OFF\n4 0 0\n" + PLACES, "faces = 0, expected at least one"),
        ("OFF\n4 1 0\n" + PLACES.replace("1 1 0", "1 1") + "3 0 1 2\n", "line 5 = 1 1, expected 3 numbers"),
        ("OFF\n4 1 0\n" + PLACES.replace("1 1 0", "1 1 x") + "3 0 1 2\n", "line 5 = 1 1 x, expected numbers"),
        ("OFF\n4 1 0\n" + PLACES.replace("1 1 0", "1 1 nan") + "3 0 1 2\n", "vertex 2 = [1.0, 1.0, nan], expected"),
        ("OFF\n4 1 0\n" + PLACES + "3 0 1 4\n", "line 7 = 4, expected indices from 0 to 3"),
        ("OFF\n4 1 0\n" + PLACES + "3 0 1 -1\n", "line 7 = -1, expected indices"),
        ("OFF\n4 1 0\n" + PLACES + "3 0 1\n", "line 7 = 3 0 1, expected a number of corners"),
        ("OFF\n4 1 0\n" + PLACES + "2 0 1\n", "faces = 0, expected at least one"),
    ],
)
def test_faulty_files_are_refused_in_one_line(mesh_file: Callable[..., Path], text: str, said: str) -> None:
    with pytest.raises(LoadError) as caught:
        read_model(mesh_file("bad.off", text))
    assert said in str(caught.value) and "bad.off: " in str(caught.value)


def test_points_and_edges_are_left_out_and_lone_numbers_listed(mesh_file: Callable[..., Path]) -> None:
    rows = PLACES.replace("\n", " 7\n")
    found = read_model(mesh_file("a.off", "OFF\n4 4 0\n" + rows + "1 0 9 9 9\n3 0 1 2 255 0 0\n2 0 1\n3 0 2 3\n"))
    mesh = found.parts[0].mesh
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.colours is not None and mesh.colours[:, 0].tolist() == [[1, 0, 0, 1], [1, 1, 1, 1]]
    assert found.notes[0] == "2 faces of less than 3 corners left out"
    assert [(each.name, each.count) for each in found.unshown] == [("vertex.numbers behind", 4)]
