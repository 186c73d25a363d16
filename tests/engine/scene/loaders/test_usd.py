"""Stages of USD: surfaces of meshes and shapes, by files that the tests write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.scene.mesh import face_normals
from tests.usd_text import CARD, SQUARE, area, box, mesh_of, place, read

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")

# ------------------------------------------------------------------------------------------------------------ topology


def test_a_polygon_mesh_is_flat_where_it_has_no_normals(tmp_path: Path) -> None:
    mesh = mesh_of(read(tmp_path, CARD))
    assert area(mesh) == pytest.approx(4.0) and mesh.normals is None
    assert mesh.uvs is not None and np.allclose(mesh.uvs * 2.0 - 1.0, mesh.vertices[mesh.triangles][..., :2])


def test_concave_polygons_cover_their_own_area(tmp_path: Path) -> None:
    # An L of three unit squares, begun so that a fan would cover four.
    body = """def Mesh "L" {
        int[] faceVertexCounts = [6]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 5]
        point3f[] points = [(2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0), (0, 0, 0)]
        uniform token subdivisionScheme = "none"
    }"""
    assert area(mesh_of(read(tmp_path, body))) == pytest.approx(3.0)


def test_holes_and_polygons_without_three_corners_are_left_out(tmp_path: Path) -> None:
    body = """def Mesh "M" {
        int[] faceVertexCounts = [4, 2, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 0, 1, 2, 0, 2, 3]
        int[] holeIndices = [3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        float[] primvars:displayOpacity = [1, 1, 0.25, 1] (interpolation = "uniform")
        uniform token subdivisionScheme = "none"
    }"""
    mesh = mesh_of(read(tmp_path, body))
    assert area(mesh) == pytest.approx(1.5) and mesh.colours is not None
    assert mesh.colours[:, 0, 3].tolist() == [1.0, 1.0, 0.25]  # values keep the numbers that polygons have in the file


def test_left_handed_faces_are_wound_the_other_way(tmp_path: Path) -> None:
    for orientation, z in (("rightHanded", 1.0), ("leftHanded", -1.0)):
        body = f'def Mesh "M" {{{SQUARE} uniform token orientation = "{orientation}"\n}}'
        mesh = mesh_of(read(tmp_path, body))
        assert face_normals(mesh.vertices, mesh.triangles)[0][:, 2].tolist() == [z, z]
        assert mesh.uvs is not None and np.allclose(mesh.uvs * 2.0 - 1.0, mesh.vertices[mesh.triangles][..., :2])


BLACK, RED, GREEN, BLUE = [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]


@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("constant", [RED], [RED] * 6),
        ("uniform", [RED, GREEN], [RED] * 3 + [GREEN] * 3),
        ("vertex", [BLACK, BLUE, GREEN, RED], [BLACK, BLUE, GREEN, BLACK, GREEN, RED]),
        ("varying", [BLACK, BLUE, GREEN, RED], [BLACK, BLUE, GREEN, BLACK, GREEN, RED]),
        ("faceVarying", [BLACK, BLUE, GREEN, RED, RED, BLUE], [BLACK, BLUE, GREEN, RED, RED, BLUE]),
    ],
)
def test_colours_of_every_interpolation(
    tmp_path: Path, interpolation: str, values: list[list[int]], expected: list[list[int]]
) -> None:
    colours = ", ".join(f"({red}, {green}, {blue})" for red, green, blue in values)
    body = f"""def Mesh "M" {{
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        color3f[] primvars:displayColor = [{colours}] (interpolation = "{interpolation}")
        uniform token subdivisionScheme = "none"
    }}"""
    mesh = mesh_of(read(tmp_path, body))
    assert mesh.colours is not None and mesh.colours[..., :3].reshape(-1, 3).tolist() == expected


def test_indexed_primvars_and_those_of_prims_above(tmp_path: Path) -> None:
    body = f"""def Xform "Above" {{
        color3f[] primvars:displayColor = [(0, 0.5, 0)]
        def Mesh "Own" {{{SQUARE}
            color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] (interpolation = "vertex")
            int[] primvars:displayColor:indices = [1, 0, 1, 0]
        }}
        def Mesh "Inherits" {{{SQUARE}{place(0, 0, 1)}}}
    }}"""
    mesh = mesh_of(read(tmp_path, body))
    assert mesh.colours is not None
    own, inherited = mesh.colours[:2], mesh.colours[2:]
    assert own[0, :, :3].tolist() == [[0, 0, 1], [1, 0, 0], [0, 0, 1]]
    assert (inherited[..., :3] == (0.0, 0.5, 0.0)).all()


def test_normals_of_corners_split_vertices_where_they_differ(tmp_path: Path) -> None:
    body = """def Mesh "M" {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        normal3f[] normals = [(0, 0, 2), (0, 0, 1), (1, 0, 0), (0, 0, 2), (0, 1, 0), (nan, 0, 1)] (
            interpolation = "faceVarying"
        )
        uniform token subdivisionScheme = "none"
    }"""
    model = read(tmp_path, body)
    mesh = mesh_of(model)
    assert len(mesh.vertices) == 5 and mesh.normals is not None  # corner 2 has two normals
    corners = np.round(mesh.normals[mesh.triangles].reshape(-1, 3), 6).tolist()
    # Of length 1; what is no number is that of the face.
    assert corners == [[0, 0, 1], [0, 0, 1], [1, 0, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]]
    assert any("1 that are no numbers" in note for note in model.notes)


def test_subdivided_spheres_are_smooth_and_lie_within_their_cube(tmp_path: Path) -> None:
    body = """def Mesh "Cube" {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0,1,3,2, 2,3,5,4, 4,5,7,6, 6,7,1,0, 1,7,5,3, 6,0,2,4]
        point3f[] points = [(-1,-1,1),(1,-1,1),(-1,1,1),(1,1,1),(-1,1,-1),(1,1,-1),(-1,-1,-1),(1,-1,-1)]
        normal3f[] normals = [(1,0,0)] (interpolation = "constant")
    }"""
    model = read(tmp_path, body)
    mesh = mesh_of(model)
    assert len(mesh.triangles) == 6 * 16 * 2 and mesh.normals is not None
    # The middle of a face is 1 away after one step, and after two (F + 2 R + P) / 4 with F = 55/72, R = 7/8 and P = 1.
    assert float(np.abs(mesh.vertices).max()) == pytest.approx((55.0 / 72.0 + 1.75 + 1.0) / 4.0)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    outward = (mesh.normals * mesh.vertices).sum(axis=1) / radii
    assert outward.min() > 0.95 and radii.max() / radii.min() < 1.2
    assert not model.unshown  # its normals mean nothing


# -------------------------------------------------------------------------------------------------------------- shapes


@pytest.mark.parametrize(
    ("shape", "size", "volume"),
    [
        ('Sphere "S"', "double radius = 2", 4.0 / 3.0 * np.pi * 8.0),
        ('Cube "S"', "double size = 3", 27.0),
        ('Cylinder "S"', 'double radius = 2\n double height = 3\n uniform token axis = "X"', np.pi * 12.0),
        ('Cone "S"', "double radius = 2\n double height = 3", np.pi * 4.0),
        ('Capsule "S"', 'double radius = 1\n double height = 2\n uniform token axis = "Y"', np.pi * (2.0 + 4.0 / 3.0)),
        ('Cylinder_1 "S"', "double radiusTop = 1\n double radiusBottom = 2\n double height = 3", np.pi * 7.0),
    ],
)
def test_shapes_have_their_volume(tmp_path: Path, shape: str, size: str, volume: float) -> None:
    mesh = mesh_of(read(tmp_path, f"def {shape} {{\n{size}\n}}"))
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    # By Gauss' theorem; positive, because all faces look outwards. Tessellation takes a few parts in a thousand.
    assert float((a * np.cross(b, c)).sum() / 6.0) == pytest.approx(volume, rel=4e-3)
    assert mesh.normals is not None and mesh.uvs is not None
    flat, _ = face_normals(mesh.vertices, mesh.triangles)
    assert ((mesh.normals[mesh.triangles] * flat[:, None]).sum(axis=2) > 0.7).all()


def test_shapes_without_sizes_have_those_of_the_schema(tmp_path: Path) -> None:
    sizes = {
        "Sphere": [2, 2, 2], "Cube": [2, 2, 2], "Cylinder": [2, 2, 2], "Cone": [2, 2, 2], "Capsule": [1, 1, 2],
        "Plane": [2, 2, 0],
    }  # fmt: skip
    for kind, size in sizes.items():
        low, high = box(mesh_of(read(tmp_path, f'def {kind} "S" {{}}')))
        assert np.allclose(np.subtract(high, low), size, atol=2e-3), kind


@pytest.mark.parametrize(("axis", "size"), [("X", [0, 4, 3]), ("Y", [3, 0, 4]), ("Z", [3, 4, 0])])
def test_planes_stand_on_their_axis(tmp_path: Path, axis: str, size: list[int]) -> None:
    body = f'def Plane "P" {{\n double width = 3\n double length = 4\n uniform token axis = "{axis}"\n}}'
    mesh = mesh_of(read(tmp_path, body))
    low, high = box(mesh)
    assert np.allclose(np.subtract(high, low), size)
    assert np.allclose(face_normals(mesh.vertices, mesh.triangles)[0], np.eye(3)["XYZ".index(axis)])
