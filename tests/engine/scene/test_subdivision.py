"""Subdivision surfaces against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.subdivision import ControlMesh, subdivide, subdivide_values

CUBE = np.array([[-1, -1, 1], [1, -1, 1], [-1, 1, 1], [1, 1, 1], [-1, 1, -1], [1, 1, -1], [-1, -1, -1], [1, -1, -1]])
FACES = np.array([0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4])
NO_EDGES = np.zeros((0, 2), np.int64)


def control(points: np.ndarray, lengths: list[int], corners: np.ndarray, **more: np.ndarray) -> ControlMesh:
    own = {"edges": NO_EDGES, "sharpness": np.zeros(0), "point_sharpness": np.zeros(len(points))} | more
    return ControlMesh(points.astype(np.float64), np.array(lengths), corners, **own)


def test_a_cube_after_one_step() -> None:
    found = subdivide(control(CUBE, [4] * 6, FACES))
    assert len(found.points) == 8 + 12 + 6 and found.lengths.tolist() == [4] * 24
    # Vertices (F + 2 R + 0 P) / 3 = (1/3 + 4/3) / 3 = 5/9; edges (2 middle + 2 faces) / 4 = 3/4; faces as they are.
    assert np.allclose(np.abs(found.points[:8]), 5.0 / 9.0)
    assert np.allclose(np.sort(np.abs(found.points[8:20]), axis=1), [0.0, 0.75, 0.75])
    assert np.allclose(np.sort(np.abs(found.points[20:]), axis=1), [0.0, 0.0, 1.0])


def test_the_limit_of_a_cube_is_reached() -> None:
    mesh = control(CUBE, [4] * 6, FACES)
    for _ in range(6):
        mesh = subdivide(mesh)
    # The limit of a vertex with n quads is (n² P + 4 Σ E + Σ F) / (n (n + 5)), E the other ends of its edges and F the
    # far corners of its quads: along each axis (9 + 4 · 1 - 1) / 24.
    assert np.allclose(np.abs(mesh.points[:8]), 0.5, atol=1e-3)


def test_endless_creases_keep_the_cube() -> None:
    edges = np.array([[a, b] for a in range(8) for b in range(a) if np.abs(CUBE[a] - CUBE[b]).sum() == 2])
    mesh = control(CUBE, [4] * 6, FACES, edges=edges, sharpness=np.full(12, 10.0))
    for _ in range(2):
        mesh = subdivide(mesh)
    assert np.allclose(np.abs(mesh.points).max(axis=1), 1.0)  # all points stay on the faces
    assert np.allclose(np.abs(mesh.points[:8]), 1.0)  # corners of three creases stay
    half = subdivide(control(CUBE, [4] * 6, FACES, edges=edges, sharpness=np.full(12, 0.5)))
    assert np.allclose(np.abs(half.points[:8]), 0.5 * (1.0 + 5.0 / 9.0))


def test_boundaries_are_creases_and_corners_stay_where_they_are_sharp() -> None:
    square, corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.arange(4)
    sharp = subdivide(control(square, [4], corners, point_sharpness=np.full(4, np.inf)))
    assert np.allclose(sharp.points[:4], square) and np.allclose(sharp.points[8], [0.5, 0.5, 0.0])
    smooth = subdivide(control(square, [4], corners))
    assert np.allclose(smooth.points[0], [0.125, 0.125, 0.0])  # 3/4 P and 1/8 of both neighbours


def test_the_result_is_closed_and_outward() -> None:
    found = subdivide(subdivide(control(CUBE, [4] * 6, FACES)))
    quads = found.corners.reshape(-1, 4)
    directed = {(a, b) for quad in quads.tolist() for a, b in zip(quad, quad[1:] + quad[:1], strict=True)}
    assert len(directed) == quads.size and all((b, a) in directed for a, b in directed)
    a, b, c, d = found.points[quads].transpose(1, 0, 2)
    assert float((a * np.cross(b, c)).sum() + (a * np.cross(c, d)).sum()) > 0.0


def test_values_at_corners_are_linear() -> None:
    lengths = np.array([4, 3])
    places = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [3, 0], [2, 1]])
    found = subdivide_values(lengths, places)
    assert found[:4].tolist() == [[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5]]
    assert found[16].tolist() == [2.0, 0.0] and found[18] == pytest.approx([7.0 / 3.0, 1.0 / 3.0])
