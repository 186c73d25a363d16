"""The geodesic sphere: areas, containment, point location, and moments of triangles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import chdtrc

from engine.sphere.geodesic import (
    MAX_LEVEL,
    geodesic,
    locate,
    triangle_first_moments,
    triangle_solid_angles,
)
from tests.naive.sphere import holds

LEVELS = range(MAX_LEVEL + 1)


def uniform_directions(n: int, seed: int = 7) -> np.ndarray:
    directions = np.random.default_rng(seed).normal(size=(n, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("level", LEVELS)
def test_counts_follow_euler(level: int) -> None:
    sphere = geodesic(level)
    n = 20 * 4**level
    # A closed triangle mesh has E = 3T/2 edges and, on a sphere, V = 2 + T/2 vertices.
    assert sphere.triangles.shape == (n, 3)
    assert sphere.edges.shape == (3 * n // 2, 2)
    assert sphere.vertices.shape == (2 + n // 2, 3)


@pytest.mark.parametrize("level", LEVELS)
def test_solid_angles_tile_the_sphere(level: int) -> None:
    sphere = geodesic(level)
    # The triangles tile the sphere, so their solid angles are positive and sum to 4 pi.
    assert sphere.solid_angles.min() > 0.0
    assert sphere.solid_angles.sum() == pytest.approx(4.0 * np.pi, rel=1e-13)
    np.testing.assert_allclose(np.linalg.norm(sphere.vertices, axis=1), 1.0, rtol=0, atol=1e-15)


def test_closed_forms_of_the_icosahedron() -> None:
    sphere = geodesic(0)
    # Twenty equal faces: pi / 5 each. Neighbouring vertices are atan(2) apart.
    np.testing.assert_allclose(sphere.solid_angles, np.pi / 5.0, rtol=1e-14)
    ends = sphere.vertices[sphere.edges]
    np.testing.assert_allclose(np.arccos((ends[:, 0] * ends[:, 1]).sum(axis=1)), np.arctan(2.0), rtol=1e-14)
    # It stands on a vertex.
    np.testing.assert_array_equal(sphere.vertices[[0, 11]], [[0, 1, 0], [0, -1, 0]])


def test_solid_angle_and_moment_of_an_octant() -> None:
    octant = np.eye(3)[None]
    # An eighth of the sphere is pi / 2; its first moment is pi / 4 along each axis, a quarter of a disc's projection.
    np.testing.assert_allclose(triangle_solid_angles(octant), [np.pi / 2.0], rtol=1e-15)
    np.testing.assert_allclose(triangle_first_moments(octant), [[np.pi / 4.0] * 3], rtol=1e-15)
    # Turned inside out it is negative.
    np.testing.assert_allclose(triangle_solid_angles(octant[:, ::-1]), [-np.pi / 2.0], rtol=1e-15)


@pytest.mark.parametrize("level", [1, 2, 3, 4, 5])
def test_no_triangle_straddles_the_horizon(level: int) -> None:
    heights = geodesic(level).vertices[geodesic(level).triangles][..., 1]
    # The icosahedron stands on a vertex, so the midpoints of its belt edges lie on y = 0.
    assert not ((heights.min(axis=1) < -1e-12) & (heights.max(axis=1) > 1e-12)).any()


@pytest.mark.parametrize("level", [0, 3, 6])
def test_children_are_contiguous_and_in_place(level: int) -> None:
    parent, child = geodesic(level), geodesic(level + 1)
    # The first three children hold their parent's corners, in order; the fourth touches none of them.
    for k in range(3):
        np.testing.assert_array_equal(child.triangles[k::4, k], parent.triangles[:, k])
    assert (child.triangles[3::4] >= len(parent.vertices)).all()
    # Together they cover the parent: same solid angle, same first moment.
    np.testing.assert_allclose(child.solid_angles.reshape(-1, 4).sum(axis=1), parent.solid_angles, rtol=1e-10)
    moments = triangle_first_moments(child.vertices[child.triangles]).reshape(-1, 4, 3).sum(axis=1)
    np.testing.assert_allclose(moments, triangle_first_moments(parent.vertices[parent.triangles]), rtol=0, atol=1e-14)


def test_vertices_keep_their_numbers() -> None:
    for level in range(4):
        coarse = geodesic(level).vertices
        np.testing.assert_array_equal(geodesic(level + 1).vertices[: len(coarse)], coarse)


@pytest.mark.parametrize("level", [0, 1, 2, 5])
def test_neighbours_are_symmetric_and_share_the_edge(level: int) -> None:
    sphere = geodesic(level)
    for k in range(3):
        other = sphere.neighbours[:, k]
        # Each of my neighbours has me as one of its own, across the same edge.
        back = sphere.neighbours[other] == np.arange(sphere.n_triangles)[:, None]
        assert (back.sum(axis=1) == 1).all()
        np.testing.assert_array_equal(sphere.triangle_edges[other][back], sphere.triangle_edges[:, k])


@pytest.mark.parametrize("level", LEVELS)
def test_locate_finds_the_triangle_of_its_own_centre(level: int) -> None:
    # A centre lies inside its triangle, so looking it up gives the triangle back.
    np.testing.assert_array_equal(locate(geodesic(level).centres, level), np.arange(20 * 4**level))


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_locate_agrees_with_testing_every_triangle(level: int) -> None:
    directions = uniform_directions(3000)
    inside = holds(directions, geodesic(level).vertices[geodesic(level).triangles])
    assert (inside.sum(axis=1) == 1).all()
    np.testing.assert_array_equal(locate(directions, level), inside.argmax(axis=1))


def test_locate_counts_are_proportional_to_solid_angles() -> None:
    level, n = 3, 400_000
    counts = np.bincount(locate(uniform_directions(n), level), minlength=20 * 4**level)
    expected = n * geodesic(level).solid_angles / (4.0 * np.pi)
    statistic = ((counts - expected) ** 2 / expected).sum()
    # Uniform directions fall into triangles in proportion to solid angle: chi-square with T - 1 degrees of freedom.
    assert 1e-3 < chdtrc(len(counts) - 1, statistic) < 1.0 - 1e-3


@pytest.mark.parametrize("level", [0, 1, 4, 7])
def test_locate_on_vertices_edges_and_poles(level: int) -> None:
    sphere = geodesic(level)
    rows = np.random.default_rng(5).choice(len(sphere.edges), min(2000, len(sphere.edges)), replace=False)
    ends = sphere.vertices[sphere.edges[rows]]
    share = np.random.default_rng(6).random((len(rows), 1))
    on_edges = ends[:, 0] * share + ends[:, 1] * (1.0 - share)
    poles = np.array([[0.0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]])
    for directions in (ends.reshape(-1, 3), on_edges, poles, -poles):
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        found = sphere.vertices[sphere.triangles[locate(directions, level)]]
        # Any of the triangles around is right, as long as the direction is in it but for rounding.
        for k in range(3):
            normals = np.cross(found[:, k], found[:, (k + 1) % 3])
            assert (np.einsum("ni,ni->n", unit, normals) > -1e-15).all()


def test_locate_ignores_length_and_keeps_ancestors() -> None:
    directions = uniform_directions(50_000)
    fine = locate(directions, 7)
    np.testing.assert_array_equal(locate(directions * 1e-150, 7), fine)
    np.testing.assert_array_equal(locate(directions * 1e150, 7), fine)
    # Ancestors are quotients by powers of four.
    np.testing.assert_array_equal(locate(directions, 3), fine // 4**4)


@settings(deadline=None)  # the first example may compile
@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3).filter(lambda d: any(abs(c) > 1e-100 for c in d)))
def test_locate_answers_for_any_direction(direction: list[float]) -> None:
    t = locate(np.array([direction]), 5)
    unit = np.array([direction]) / np.abs(direction).max()
    unit /= np.linalg.norm(unit)
    assert holds(unit, geodesic(5).vertices[geodesic(5).triangles[t]], slack=1e-15).all()


def test_locate_of_nothing() -> None:
    assert locate(np.empty((0, 3)), 4).shape == (0,)


@pytest.mark.parametrize("bad", [[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.inf, 0.0, 0.0]])
def test_locate_refuses_bad_directions(bad: list[float]) -> None:
    with pytest.raises(ValueError, match="direction 1 is"):
        locate(np.array([[0.0, 1.0, 0.0], bad]), 2)


@pytest.mark.parametrize("shape", [(3,), (4, 2), (2, 3, 1)])
def test_locate_refuses_other_shapes(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"expected \(N, 3\)"):
        locate(np.ones(shape), 2)


@pytest.mark.parametrize("level", [-1, 8])
def test_levels_outside_the_range_are_refused(level: int) -> None:
    with pytest.raises(ValueError, match="expected 0 to 7"):
        geodesic(level)


def test_levels_are_built_once_and_cannot_be_written() -> None:
    assert geodesic(3) is geodesic(3)
    for array in (geodesic(2).vertices, geodesic(2).triangles, geodesic(2).solid_angles, geodesic(2).neighbours):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
