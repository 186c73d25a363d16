"""Polygons with any outline become triangles of the same area."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.polygons import repeated_polygons, triangulate
from tests.engine.scene.conftest import read_mesh

L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4)]
WITH_HOLE = [*SQUARE, (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]  # to the hole, around it, and back
OUTLINES = {  # and their areas
    "an L": (L, 3.0),
    "an arrow": ([(0, 0), (2, 2), (0, 4), (1, 2)], 2.0),
    "corners on edges": ([(0, 0), (2, 0), (4, 0), (4, 2), (4, 4), (2, 4), (0, 4), (0, 2)], 16.0),
    "an L with corners on edges": ([(0, 0), (1, 0), *L[1:4], (1, 1.5), *L[4:], (0, 1)], 3.0),
    "doubled corners": ([(0, 0), (0, 0), *L[1:], (0, 2)], 3.0),
    "a spike": ([*L[:2], (5, 0), *L[1:]], 3.0),
    "a hole": (WITH_HOLE, 12.0),
    "two holes": (
        [(0, 0), (8, 0), (8, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1), (5, 1), (5, 3), (7, 3), (7, 1),
         (5, 1), (1, 1)],
        24.0,
    ),
    "touching itself": ([(0, 0), (2, 0), (4, 0), (4, 4), (2, 0), (0, 4)], 8.0),
    "a comb": ([(0, 0), (9, 0), *[(x, 5 - 4 * (x % 2)) for x in range(9, -1, -1)]], 27.0),
}  # fmt: skip


def area(corners: np.ndarray) -> np.ndarray:
    """Vectors of triangles (T, 3, 3), as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0


def outline_area(outline: np.ndarray) -> float:
    x, y = np.asarray(outline, float).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def cut(outline: np.ndarray) -> np.ndarray:
    places = np.column_stack([outline, np.zeros(len(outline))]) if np.shape(outline)[1] == 2 else np.asarray(outline)
    return places[triangulate(places, np.array([len(places)]), 10_000)]


@pytest.mark.parametrize("name", OUTLINES)
def test_an_outline_keeps_its_area_from_any_first_corner(name: str) -> None:
    outline, expected = OUTLINES[name]
    assert outline_area(np.array(outline)) == pytest.approx(expected)
    for turned in (outline, outline[::-1]):
        sign = 1.0 if turned is outline else -1.0
        for first in range(len(outline)):
            areas = area(cut(np.array([*turned[first:], *turned[:first]], float)))
            assert (sign * areas[:, 2] > 0.0).all()  # none is turned round, none is empty
            assert np.abs(areas[:, 2]).sum() == pytest.approx(expected)


def simple_outline(rng: np.random.Generator, n: int) -> np.ndarray:
    """n corners about a point that sees them all, at any distance: no edges cross, since no gap has half a turn."""
    while True:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
        if np.diff(angles, append=angles[0] + 2.0 * np.pi).max() < np.pi:
            radii = rng.uniform(0.02, 1.0, n)
            return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def walked_outline(rng: np.random.Generator, n: int) -> np.ndarray:
    """The outline of a random walk's cells on a grid, corners on its edges and all: L, U and worse; no holes."""
    cells, at = {(0, 0)}, np.zeros(2, int)
    for _ in range(n):
        at = at + [(1, 0), (-1, 0), (0, 1), (0, -1)][rng.integers(4)]
        cells.add(tuple(at.tolist()))
    edges = {}
    for x, y in cells:
        for beside, start, end in (
            ((x, y - 1), (x, y), (x + 1, y)), ((x + 1, y), (x + 1, y), (x + 1, y + 1)),
            ((x, y + 1), (x + 1, y + 1), (x, y + 1)), ((x - 1, y), (x, y + 1), (x, y)),
        ):  # fmt: skip
            if beside not in cells:
                edges.setdefault(start, []).append(end)
    if any(len(ends) > 1 for ends in edges.values()):
        return walked_outline(rng, n)  # it touches itself
    start = min(edges)  # of the lowest at the left: no hole has it
    outline = [start]
    while (after := edges[outline[-1]][0]) != start:
        outline.append(after)
    return np.array(outline, float)


@pytest.mark.parametrize("make", [simple_outline, walked_outline])
def test_random_outlines_keep_their_area_in_any_plane_and_far_off(make) -> None:
    rng = np.random.default_rng(7)
    for _ in range(150):
        outline = make(rng, int(rng.integers(4, 60)))
        expected = outline_area(outline)
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
        for offset, tolerance in ((0.0, 1e-9), (1e6 * rng.normal(size=3), 1e-6)):
            areas = area(cut(np.roll(outline, rng.integers(len(outline)), axis=0) @ frame + offset))
            lengths = np.linalg.norm(areas, axis=1)
            assert lengths.sum() == pytest.approx(expected, rel=tolerance, abs=tolerance)
            assert np.linalg.norm(areas.sum(axis=0)) == pytest.approx(expected, rel=tolerance, abs=tolerance)
            assert len(areas) <= len(outline) - 2


def test_polygons_stay_in_their_order_and_fans_where_they_do() -> None:
    places = np.array([*SQUARE, *L, *SQUARE[:3]], float)
    places = np.column_stack([places, np.zeros(len(places))])
    triangles = triangulate(places, np.array([4, 6, 3]), 1000)
    assert triangles[:2].tolist() == [[0, 1, 2], [0, 2, 3]] and triangles[-1].tolist() == [10, 11, 12]
    assert ((triangles[2:-1] >= 4) & (triangles[2:-1] < 10)).all() and len(triangles) == 7


@pytest.mark.parametrize(
    "outline", [np.zeros((5, 3)), np.outer(np.arange(5.0), [1.0, 2.0, 3.0]), np.full((5, 3), np.nan)]
)
def test_outlines_without_area_are_left_to_others(outline: np.ndarray) -> None:
    assert triangulate(outline, np.array([5]), 100).tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


def test_outlines_that_cross_themselves_end(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    for n in (4, 5, 6, 9, 40, 300):
        for _ in range(20):
            assert np.isfinite(cut(np.round(rng.normal(size=(n, 2)) * 4))).all()
    monkeypatch.setattr("engine.scene.polygons._FEWEST_STEPS", 0)
    places = np.column_stack([rng.normal(size=(2000, 2)), np.zeros(2000)])
    notes = list[str]()
    found = triangulate(np.concatenate([places[:3], places]), np.array([3, 2000]), 1, notes.append)
    fan = [[3, k, k + 1] for k in range(4, 2002)]
    assert found.tolist() == [[0, 1, 2], *fan]  # what is not cut stays a fan
    assert notes == ["faces of 2000 corners and more: 1 not cut exactly, which would take too long"]


def test_files_with_an_L_in_them_have_its_area(mesh_file, shared_data) -> None:
    """It was 4, and is 3; texture coordinates go with their corners."""
    obj = "".join(f"v {x} {y} 0\nvt {x} {y}\n" for x, y in L) + "f 2/2 3/3 4/4 5/5 6/6 1/1\n"
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        + "".join(f"{x} {y} 0\n" for x, y in L) + "6 1 2 3 4 5 0\n"
    )  # fmt: skip
    cases = shared_data / "cases" / "26-obj-concave"
    for path in (mesh_file("own.obj", obj), mesh_file("own.ply", ply), cases / "L.obj", cases / "L.ply"):
        mesh = read_mesh(path)
        areas = area(mesh.vertices[mesh.triangles])
        assert (areas[:, 2] > 0.0).all() and areas[:, 2].sum() == pytest.approx(3.0)
        if mesh.uvs is not None:
            assert np.array_equal(mesh.uvs, mesh.vertices[mesh.triangles][..., :2])


def test_polygons_repeat_from_any_corner_and_where_asked_in_any_winding() -> None:
    polygons = [[0, 1, 2, 3], [2, 3, 0, 1], [3, 2, 1, 0], [0, 1, 2], [2, 1, 0], [0, 1, 2, 4], [0, 2, 1, 3]]
    vertices, lengths = np.concatenate(polygons), np.array([len(each) for each in polygons])
    one_way = repeated_polygons(vertices, lengths, either_way=False)
    assert one_way.tolist() == [False, True, False, False, False, False, False]
    either = repeated_polygons(vertices, lengths, either_way=True)
    assert either.tolist() == [False, True, True, False, True, False, True]
    assert repeated_polygons(np.zeros(0, np.int64), np.zeros(0, np.int64), either_way=True).tolist() == []
