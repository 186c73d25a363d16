"""Rays against brute force over all triangles; invalid geometry and rays are rejected."""

import numpy as np
import pytest

from engine.scene.mesh import face_normals
from engine.scene.primitives import cube, quad, sphere
from engine.scene.raycaster import RayCaster
from tests.engine.scene.conftest import read_mesh
from tests.naive.first_hits import first_hits


def soup(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """n random triangles in the unit cube."""
    rng = np.random.default_rng(seed)
    vertices = (rng.random((n, 1, 3)) + 0.9 * rng.random((n, 3, 3))).reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(3 * n, dtype=np.int32).reshape(-1, 3)


def rays(n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return (rng.random((n, 3)) * 2 - 0.5).astype(np.float32), rng.normal(size=(n, 3)).astype(np.float32)


def test_agrees_with_the_obvious_twin():
    vertices, triangles = soup(60)
    origins, directions = rays(2000)
    caster = RayCaster(vertices, triangles)
    hits = caster.intersect(origins, directions)
    nearest, distance = first_hits(vertices, triangles, origins, directions)
    assert (hits.triangle != nearest).sum() == 0  # seeded so that no ray grazes an edge
    seen = nearest >= 0
    assert 0.1 < seen.mean() < 0.9
    assert np.allclose(hits.distance[seen], distance[seen], rtol=1e-4, atol=1e-5)
    assert np.isinf(hits.distance[~seen]).all()
    assert np.array_equal(caster.occluded(origins, directions), seen)


def test_barycentrics_name_the_point():
    vertices, triangles = soup(60)
    origins, directions = rays(500)
    hits = RayCaster(vertices, triangles).intersect(origins, directions)
    seen = hits.triangle >= 0
    corners = vertices[triangles[hits.triangle[seen]]]
    u, v = hits.u[seen, None], hits.v[seen, None]
    points = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    assert np.allclose(points, origins[seen] + hits.distance[seen, None] * directions[seen], atol=1e-4)


def test_distances_limit_occlusion_in_lengths_of_the_direction_and_stay_untouched():
    caster = RayCaster(quad().vertices, quad().triangles)
    origins = np.tile(np.float32([[0.1, 0.1, 2.0]]), (4, 1))
    directions = np.tile(np.float32([[0, 0, -2]]), (4, 1))  # the card is 1 such length away
    limits = np.float32([0.5, 0.999, 1.001, np.inf])
    assert caster.occluded(origins, directions, limits).tolist() == [False, False, True, True]
    assert limits.tolist() == np.float32([0.5, 0.999, 1.001, np.inf]).tolist()  # the library writes into its copy


@pytest.mark.parametrize("scale", [1e-6, 1e-2, 1.0, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("shift", [0.0, 3.0, 1000.0])
def test_answers_do_not_depend_on_scale_or_place(scale, shift):
    place = np.array([shift, -shift, 2 * shift])
    caster = RayCaster((quad().vertices + place) * scale, quad().triangles)
    origins = (np.array([[0.1, 0.1, 2.0], [0.1, 0.1, -2.0], [0.7, 0.1, 2.0]]) + place) * scale
    directions = np.float32([[0, 0, -1]] * 3)
    hits = caster.intersect(origins, directions)
    assert hits.triangle.tolist() in ([0, -1, -1], [1, -1, -1])  # in front, behind, beside
    assert hits.distance[0] == pytest.approx(2 * scale, rel=1e-3)
    near, far = np.full(3, 1.9 * scale), np.full(3, 2.1 * scale)
    assert caster.occluded(origins, directions, near).tolist() == [False, False, False]
    assert caster.occluded(origins, directions, far).tolist() == [True, False, False]


def surface_points(vertices, triangles, n, rng):
    """n random surface points in float32, their triangles and unit normals."""
    normals, _ = face_normals(vertices, triangles)
    chosen = rng.integers(0, len(triangles), n)
    u, v = rng.random((2, n, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = vertices[triangles[chosen]].astype(np.float64).transpose(1, 0, 2)
    return ((1 - u - v) * a + u * b + v * c).astype(np.float32), chosen, normals[chosen]


@pytest.mark.parametrize("grazing", [1.0, 1e-3])
@pytest.mark.parametrize("shift", [0.0, 10.0])
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2, 1e4, 1e6])
def test_lifted_points_never_hit_their_own_surface(scale, shift, grazing):
    rng = np.random.default_rng(5)
    n = 100_000
    for mesh in (sphere(), cube()):
        vertices = ((mesh.vertices + shift) * scale).astype(np.float32)
        caster = RayCaster(vertices, mesh.triangles)
        points, chosen, normals = surface_points(vertices, mesh.triangles, n, rng)
        directions = rng.normal(size=(n, 3))
        upward = np.einsum("ni,ni->n", directions, normals)[:, None]
        directions += (np.abs(upward) * grazing - upward) * normals  # above the surface, some by a hair
        origins = caster.offset_origins(points, normals)
        # both are convex: a ray that leaves upward meets nothing; whatever it hits is its own surface
        hits = caster.intersect(origins, directions.astype(np.float32)).triangle
        assert (hits == chosen).sum() == 0
        if grazing == 1.0 and shift == 0.0:
            assert (hits >= 0).sum() == 0


def test_the_bunny_does_not_shade_itself(shared_reference):
    mesh = read_mesh(shared_reference / "meshes" / "bunny.ply")
    caster = RayCaster(mesh.vertices, mesh.triangles)
    rng = np.random.default_rng(6)
    points, chosen, normals = surface_points(mesh.vertices, mesh.triangles, 100_000, rng)
    directions = rng.normal(size=points.shape)
    directions *= np.sign(np.einsum("ni,ni->n", directions, normals))[:, None]
    hits = caster.intersect(caster.offset_origins(points, normals), directions.astype(np.float32))
    assert (hits.triangle == chosen).sum() == 0  # EXTREMES: none of 10⁵


def test_a_closed_room_has_no_leaks():
    caster = RayCaster(sphere().vertices, sphere().triangles)
    rng = np.random.default_rng(7)
    directions = rng.normal(size=(200_000, 3)).astype(np.float32)
    assert caster.occluded(np.zeros_like(directions), directions).all()


def test_large_batches_over_threads_equal_small_ones():
    vertices, triangles = soup(300)
    origins, directions = rays(200_001)
    limits = np.random.default_rng(3).random(200_001).astype(np.float32)
    one, many = RayCaster(vertices, triangles, threads=1), RayCaster(vertices, triangles, threads=3)
    assert np.array_equal(one.occluded(origins, directions, limits), many.occluded(origins, directions, limits))
    assert np.array_equal(one.intersect(origins, directions).triangle, many.intersect(origins, directions).triangle)


def test_read_only_strided_and_double_arrays_serve_as_well():
    vertices, triangles = soup(50)
    origins, directions = rays(1000)
    caster = RayCaster(vertices, triangles)
    expected = caster.occluded(origins, directions)
    frozen = origins.copy()
    frozen.flags.writeable = False
    assert np.array_equal(caster.occluded(frozen, directions), expected)
    assert np.array_equal(caster.occluded(origins[::-1], directions[::-1])[::-1], expected)
    assert np.array_equal(caster.occluded(origins.astype(np.float64), directions), expected)
    assert np.array_equal(caster.occluded(np.asfortranarray(origins), directions), expected)


def test_empty_batches_are_answered():
    caster = RayCaster(quad().vertices, quad().triangles)
    assert caster.occluded(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
    assert caster.intersect(np.zeros((0, 3)), np.zeros((0, 3))).triangle.shape == (0,)


def test_a_zero_direction_meets_nothing():
    caster = RayCaster(quad().vertices, quad().triangles)
    assert not caster.occluded(np.zeros((3, 3)), np.zeros((3, 3))).any()


@pytest.mark.parametrize(
    ("origins", "directions", "distance", "message"),
    [
        (np.zeros((1000, 3)), np.ones((3, 3)), None, "expected two of"),
        (np.zeros((5, 2)), np.ones((5, 2)), None, "expected two of"),
        (np.zeros(3), np.ones(3), None, "expected two of"),
        (np.full((5, 3), np.nan), np.ones((5, 3)), None, "expected finite"),
        (np.zeros((5, 3)), np.full((5, 3), np.inf), None, "expected finite"),
        (np.zeros((5, 3)), np.ones((5, 3)), np.ones(4), r"distance \(4,\): expected \(5,\)"),
        (np.zeros((5, 3)), np.ones((5, 3)), np.zeros(5), "expected numbers > 0"),
        (np.zeros((5, 3)), np.ones((5, 3)), np.full(5, -1.0), "expected numbers > 0"),
        (np.zeros((5, 3)), np.ones((5, 3)), np.full(5, np.nan), "expected numbers > 0"),
    ],
)
def test_what_would_corrupt_memory_is_refused(origins, directions, distance, message):
    caster = RayCaster(quad().vertices, quad().triangles)
    with pytest.raises(ValueError, match=message):
        caster.occluded(origins, directions, distance)


def test_sums_that_overflow_are_not_taken_for_infinite_rays():
    caster = RayCaster(quad().vertices, quad().triangles)
    origins = np.full((1000, 3), 3e38, np.float32)  # finite, though their sum is not
    assert not caster.occluded(origins, np.ones((1000, 3), np.float32)).any()


def test_rays_meet_nothing_where_nothing_is() -> None:
    caster, rays = RayCaster(np.zeros((0, 3)), np.zeros((0, 3), np.int32)), (np.zeros((5, 3)), np.ones((5, 3)))
    assert not caster.occluded(*rays).any()
    assert (caster.intersect(*rays).triangle == -1).all() and 0.0 <= caster.offset < np.inf


@pytest.mark.parametrize(
    ("vertices", "triangles"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]]),
        (np.full((3, 3), np.nan), [[0, 1, 2]]),
        (np.eye(3), [[0, 1, 3]]),
        (np.eye(3), [[0, 1, -1]]),
        (np.eye(3), [[0.0, 1.0, 2.0]]),
        (np.eye(3), [[0, 1]]),
    ],
)
def test_triangles_that_are_none_are_refused(vertices, triangles):
    with pytest.raises(ValueError, match="expected"):
        RayCaster(vertices, triangles)
