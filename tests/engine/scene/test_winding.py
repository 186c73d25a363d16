import time
from pathlib import Path

import numpy as np
import pytest

from engine.scene.mesh import Mesh, with_normals
from engine.scene.primitives import cube, sphere
from engine.scene.scene_loader import load_scene
from engine.scene.winding import inconsistent_faces


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
