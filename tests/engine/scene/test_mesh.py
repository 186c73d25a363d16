from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.mesh import (
    Mesh,
    cross,
    face_normals,
    join_meshes,
    normalize,
    place_copies,
    read_mesh_file,
    smooth_normals,
    validate_mesh,
)
from engine.scene.primitives import PRIMITIVES, cube, quad, sphere


def area(mesh: Mesh) -> float:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def volume(mesh: Mesh) -> float:
    """Signed: positive where all fronts face outward."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def test_cross_products_are_numpys_bit_by_bit():
    a, b = np.random.default_rng(3).normal(size=(2, 50, 4, 3)) * 10.0 ** np.arange(-8, 42)[:, None, None]
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


def test_primitives_have_unit_size_and_face_outward():
    assert area(quad()) == pytest.approx(1.0) and face_normals(quad().vertices, quad().triangles)[0][0, 2] == 1.0
    assert area(cube()) == pytest.approx(6.0) and volume(cube()) == pytest.approx(1.0)
    # inscribed in the sphere of diameter 1: π and π/6, less the 0.08 % that 64 × 128 cells cut off
    assert area(sphere()) == pytest.approx(np.pi, rel=1e-3) and volume(sphere()) == pytest.approx(np.pi / 6, rel=2e-3)
    assert volume(sphere()) < np.pi / 6


@pytest.mark.parametrize("name", sorted(PRIMITIVES))
def test_primitives_are_centred_and_their_normals_are_those_of_the_surface(name):
    mesh = PRIMITIVES[name]()
    assert np.abs(mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)).max() < 1e-12
    assert mesh.vertices.max() == pytest.approx(0.5)
    flat, solid = face_normals(mesh.vertices, mesh.triangles)
    assert solid.all()
    # at the corners of a face the vertex normals lean at most by the tessellation, 2.9 degrees, off the face's own
    assert np.einsum("tki,ti->tk", mesh.normals[mesh.triangles], flat).min() > np.cos(np.radians(2.9))


def test_smooth_normals_are_weighted_by_angle_not_by_triangulation():
    mesh = cube()
    corners, index = np.unique(mesh.vertices.round(6), axis=0, return_inverse=True)
    normals = smooth_normals(corners, index.reshape(-1)[mesh.triangles].astype(np.int32))
    # at a corner three right angles meet, however each face is cut in two: the diagonal
    assert np.allclose(normals, np.sign(corners) / np.sqrt(3), atol=1e-12)


def test_faces_without_area_have_no_say_and_no_nan():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [5, 5, 5.0]])
    triangles = np.array([[0, 1, 2], [0, 1, 3], [1, 1, 2]], np.int32)  # a face, three in a line, a doubled corner
    flat, solid = face_normals(vertices, triangles)
    assert solid.tolist() == [True, False, False]
    assert flat.tolist() == [[0, 0, 1], [0, 0, 0], [0, 0, 0]]
    normals = smooth_normals(vertices, triangles)
    assert normals[0].tolist() == [0, 0, 1]
    assert normals[4].tolist() == [0, 1, 0]  # a vertex of no face


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_normals_do_not_depend_on_the_scale(scale):
    flat, solid = face_normals(sphere().vertices * scale, sphere().triangles)
    assert solid.all() and np.allclose(flat, face_normals(sphere().vertices, sphere().triangles)[0], atol=1e-9)


def test_normalize_survives_tiny_huge_and_zero_vectors():
    unit = normalize(np.array([[0, 0, 1e150], [0, 0, 0]]), (1.0, 0.0, 0.0))
    assert unit.tolist() == [[0, 0, 1], [1, 0, 0]]
    assert normalize(np.full((1, 3), 1e-200), (1.0, 0.0, 0.0)) == pytest.approx(np.full((1, 3), 3**-0.5))
    assert normalize(np.zeros((0, 3)), (1.0, 0.0, 0.0)).shape == (0, 3)


def test_normals_go_with_the_inverse_transpose():
    stretch = np.diag([4.0, 1.0, 1.0, 1.0])
    placed = place_copies(sphere(), stretch[None])
    # of the ellipsoid (x/4)² + y² + z² = ¼ the gradient is (x/16, y, z)
    gradient = placed.vertices * [1 / 16, 1, 1]
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.allclose(placed.normals, gradient, atol=1e-9)


@pytest.mark.parametrize("name", sorted(PRIMITIVES))
def test_a_mirror_keeps_fronts_in_front(name):
    mirror = np.diag([-2.0, 1.0, 1.0, 1.0])
    placed = place_copies(PRIMITIVES[name](), mirror[None])
    flat, _ = face_normals(placed.vertices, placed.triangles)
    assert np.einsum("tki,ti->tk", placed.normals[placed.triangles], flat).min() > 0.9  # normals and winding agree
    if name != "quad":
        assert volume(placed) > 0  # outward still
    else:
        assert flat[0].tolist() == [0, 0, 1]  # mirrored along X, a card still faces +Z


def test_vertex_normals_of_no_length_become_the_faces_own():
    mesh = Mesh(quad().vertices, quad().triangles, np.array([[0, 0, 5.0], [0, 0, 0], [0, 0, 0], [0, 0, 1e-3]]))
    assert place_copies(mesh, np.eye(4)[None]).normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_joined_meshes_keep_their_triangles_and_get_missing_normals():
    bare = Mesh(quad().vertices, quad().triangles)
    joined = join_meshes([cube(), bare])
    assert joined.triangles[12:].tolist() == (quad().triangles + 24).tolist()
    assert joined.normals is not None and joined.normals[24:].tolist() == [[0, 0, 1]] * 4
    assert join_meshes([bare, bare]).normals is None


def test_validation_names_the_first_vertex_or_face_that_is_wrong():
    good = quad()
    assert validate_mesh(good, Path("f")) is good
    for bad, line in [
        (Mesh(np.full((4, 3), 1e13), good.triangles), "vertex 0"),
        (Mesh(good.vertices, good.triangles + 2), "face 0"),
        (Mesh(good.vertices, good.triangles - 1), "face 0"),
        (Mesh(good.vertices, good.triangles[:0]), "faces"),
        (Mesh(good.vertices, good.triangles, np.full((4, 3), np.nan)), "normal 0"),
    ]:
        with pytest.raises(LoadError, match=f"f: {line} = "):
            validate_mesh(bad, Path("f"))


def test_normals_and_texture_coordinates_that_are_no_numbers_are_mended_with_a_note_each(tmp_path):
    """A square in the plane z = 0, seen from +z: of its four normals, which lean, one is computed from the faces."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    for bad in ("nan", "inf", "-1e999"):
        normals, us = ["1 0 1"] * 4, ["0.5"] * 4
        normals[2], us[3] = f"0 {bad} 1", bad
        rows = [f"{x} {y} 0 {n} {u} 0.25\n" for (x, y), n, u in zip(corners, normals, us, strict=True)]
        head = "ply\nformat ascii 1.0\nelement vertex 4\n"
        head += "".join(f"property float {name}\n" for name in "x y z nx ny nz u v".split())
        head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        (tmp_path / "a.ply").write_text(head + "".join(rows) + "4 0 1 2 3\n")
        lines = [f"v {x} {y} 0\nvn {n}\nvt {u} 0.25\n" for (x, y), n, u in zip(corners, normals, us, strict=True)]
        (tmp_path / "a.obj").write_text("".join(lines) + "f 1/1/1 2/2/2 3/3/3 4/4/4\n")
        for name in ("a.ply", "a.obj"):
            found = read_mesh_file(tmp_path / name)
            np.testing.assert_array_equal(found.mesh.normals, [[1, 0, 1], [1, 0, 1], [0, 0, 1], [1, 0, 1]])
            mended = found.mesh.triangles == 3
            np.testing.assert_array_equal(found.mesh.uvs[..., 0], np.where(mended, 0.0, 0.5))
            assert (found.mesh.uvs[..., 1] == 0.25).all()
            assert [note.split(" ")[:2] for note in found.notes] == [["1", "normals"], [str(mended.sum()), "texture"]]
