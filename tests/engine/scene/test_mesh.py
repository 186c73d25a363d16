"""Meshes: readers, normals, winding, and copies under transforms."""

import time
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.formats import read_model
from engine.scene.mesh import (
    Mesh,
    cross,
    face_normals,
    inconsistent_faces,
    join_meshes,
    normalize,
    place_copies,
    position_ids,
    smooth_normals,
    validate_mesh,
    weld_equal_vertices,
    with_normals,
)
from engine.scene.primitives import PRIMITIVES, cube, disc, quad, sphere
from engine.scene.scene_loader import load_scene


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
    # 64 sides cut off 1 - sin(2π / 64) / (2π / 64) of the circle, 0.16 %
    assert area(disc()) == pytest.approx(np.pi / 4, rel=2e-3)
    assert face_normals(disc().vertices, disc().triangles)[0][:, 2].min() == 1.0


@pytest.mark.parametrize("name", sorted(PRIMITIVES))
def test_primitives_are_centred_and_their_normals_are_those_of_the_surface(name):
    mesh = PRIMITIVES[name]()
    assert np.abs(mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)).max() < 1e-12
    assert mesh.vertices.max() == pytest.approx(0.5)
    flat, solid = face_normals(mesh.vertices, mesh.triangles)
    assert solid.all()
    # At the corners of a face the vertex normals lean at most by the tessellation off the face's own: on a torus by
    # half of 360 / 48 degrees around its tube, and half of 360 / 96 around its axis.
    most = 4.2 if name == "torus" else 2.9
    assert np.einsum("tki,ti->tk", mesh.normals[mesh.triangles], flat).min() > np.cos(np.radians(most))


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
    if name not in ("quad", "disc", "backdrop"):
        assert volume(placed) > 0  # outward still
    elif name != "backdrop":
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
            found = read_model(tmp_path / name)
            mesh = found.parts[0].mesh
            np.testing.assert_array_equal(mesh.normals, [[1, 0, 1], [1, 0, 1], [0, 0, 1], [1, 0, 1]])
            mended = mesh.triangles == 3
            np.testing.assert_array_equal(mesh.uvs[..., 0], np.where(mended, 0.0, 0.5))
            assert (mesh.uvs[..., 1] == 0.25).all()
            assert [note.split(" ")[:2] for note in found.notes] == [["1", "normals"], [str(mended.sum()), "texture"]]


def some_turned(triangles: np.ndarray, share: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The triangles, a share of them turned round, and which."""
    turned = np.random.default_rng(seed).random(len(triangles)) < share
    return np.where(turned[:, None], triangles[:, ::-1], triangles).astype(np.int32), turned


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A wavy sheet of n × n vertices."""
    y, x = np.mgrid[:n, :n] / n
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    vertices = np.stack([x.ravel(), y.ravel(), np.sin(9 * x * y).ravel()], axis=1)
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)


@pytest.mark.parametrize("seed", range(5))
def test_the_faces_that_were_turned_are_found(seed: int) -> None:
    for mesh in (sphere(), cube()):  # the cube's sides share no vertices
        triangles, turned = some_turned(mesh.triangles, 0.2, seed)
        np.testing.assert_array_equal(inconsistent_faces(mesh.vertices, triangles), turned)
    vertices, clean = grid(20)
    triangles, turned = some_turned(clean, 0.4, seed)
    order = np.random.default_rng(seed).permutation(len(vertices))  # whatever the numbers are
    found = inconsistent_faces(vertices[order], np.argsort(order)[triangles].astype(np.int32))
    np.testing.assert_array_equal(found, turned)


def test_each_shell_keeps_the_way_that_most_of_it_has() -> None:
    vertices, triangles = grid(5)
    both = np.concatenate([vertices, vertices + [0.0, 0.0, 5.0]])
    triangles = np.concatenate([triangles, triangles[:, ::-1] + len(vertices)])
    assert not inconsistent_faces(both, triangles).any()


def test_edges_of_three_faces_join_none_and_a_mobius_strip_is_left_alone() -> None:
    # Three sheets at one edge, like a book: whichever way each is wound, none is wrong.
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float)
    for last in ([0, 1, 4], [1, 0, 4]):
        assert not inconsistent_faces(vertices, np.array([[0, 1, 2], [0, 1, 3], last], np.int32)).any()
    n, angles = 12, np.arange(12) * (2 * np.pi / 12)
    across = np.stack([np.cos(angles) * np.cos(angles / 2), np.sin(angles) * np.cos(angles / 2), np.sin(angles / 2)], 1)
    middle = 3.0 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    strip = np.concatenate([middle - across, middle + across])
    here, there = np.arange(n), (np.arange(n) + 1) % n
    low, high = np.where(there == 0, n, there), np.where(there == 0, 0, there + n)  # joined with half a turn
    faces = np.concatenate([np.stack([here, low, high], axis=1), np.stack([here, high, here + n], axis=1)])
    assert not inconsistent_faces(strip, faces.astype(np.int32)).any()


def test_faces_without_area_or_length_do_no_harm() -> None:
    triangles = np.array([[0, 0, 0], [0, 1, 1], [0, 1, 2], [2, 1, 3], [3, 3, 3]], np.int32)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)
    assert not inconsistent_faces(vertices, triangles).any()
    assert not inconsistent_faces(np.zeros((4, 3)), triangles).any()


def test_normals_of_a_shell_wound_both_ways_do_not_cancel(tmp_path: Path) -> None:
    # Loaded without normals, with three faces in ten turned round: the same as the clean file, to the last bit.
    mesh = sphere()
    scenes = []
    for name, triangles in (("clean", mesh.triangles), ("mixed", some_turned(mesh.triangles, 0.3)[0])):
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()]
        (tmp_path / f"{name}.obj").write_text("\n".join(lines))
        scenes.append(load_scene(tmp_path / f"{name}.obj", (8, 6)))
    clean, mixed = scenes
    assert sum("wound against a neighbour" in note for note in mixed.notes) == 1  # as the file has it
    np.testing.assert_allclose(mixed.normals, clean.normals, atol=1e-6)
    np.testing.assert_array_equal(mixed.geometric_normals, clean.geometric_normals)
    own = slice(*mixed.vertex_ranges[0])
    outward = mixed.vertices[own] + mixed.origin - mixed.bounds[0].mean(axis=0)
    assert np.einsum("vk,vk->v", mixed.normals[own], outward).min() > 0.0


def test_texture_coordinates_turn_with_their_faces() -> None:
    mesh = sphere()
    assert mesh.uvs is not None
    triangles, turned = some_turned(mesh.triangles, 0.3)
    uvs = np.where(turned[:, None, None], mesh.uvs[:, ::-1], mesh.uvs)
    found = with_normals(Mesh(mesh.vertices, triangles, None, uvs))
    np.testing.assert_array_equal(found.triangles, mesh.triangles)
    np.testing.assert_array_equal(found.uvs, mesh.uvs)


@pytest.mark.sweep
def test_a_million_triangles_take_no_more_than_their_share() -> None:
    spent = []
    for n in (230, 708):
        vertices, clean = grid(n)
        triangles, turned = some_turned(clean, 0.4)
        begun = time.process_time()
        np.testing.assert_array_equal(inconsistent_faces(vertices, triangles), turned)
        spent.append(time.process_time() - begun)
    assert spent[1] < 2.0 * (708 / 230) ** 2 * spent[0] + 1.0


def test_only_vertices_at_the_very_same_position_are_welded() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [-0.0, 0, 0], [np.nextafter(1.0, 2.0), 0, 0], [0, 1e-300, 0]])
    ids = position_ids(vertices)
    assert ids[0] == ids[2]  # −0 is 0
    assert len(set(ids.tolist())) == 4 and ids.min() == 0 and ids.max() == 3
    triangles = np.array([[0, 1, 4], [2, 4, 3]], np.int32)
    welded = weld_equal_vertices(Mesh(vertices, triangles))
    assert len(welded.vertices) == 4
    np.testing.assert_array_equal(welded.vertices[welded.triangles], vertices[triangles])
