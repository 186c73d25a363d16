"""Where shading points stand, and what they see."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from engine.core.generators import run_to_end
from engine.realtime.core.shading_points import _joined_at_edges, _nearness, _SampleTree, shading_points, with_backs
from engine.realtime.triple_product.visibility import N_UPPER, trace_patches, upper_triangles
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic
from tests.engine.precompute.direct.by_hand import square

FLOOR, BALL = 0, 1


def counts(bits: np.ndarray) -> np.ndarray:
    """(S, 2560): how many children of each triangle are free."""
    halves = np.stack([bits & 15, bits >> 4], axis=2).reshape(len(bits), N_UPPER)
    return np.bitwise_count(halves)


def test_parts_cover_the_surfaces_and_points_stand_at_their_corners(ball_scene, ball) -> None:
    points, _, _ = ball
    area = np.linalg.norm(np.cross(*(points.corners[:, k] - points.corners[:, 0] for k in (1, 2))), axis=1) / 2
    for i_object, expected in ((FLOOR, 36.0), (BALL, trimesh.creation.icosphere(3, radius=0.5).area)):
        of_object = ball_scene.object_of_triangle[points.source] == i_object
        assert area[of_object].sum() == pytest.approx(expected, rel=2e-3)
    front = points.triangles[:, 0]
    np.testing.assert_allclose(points.position[front], points.corners, atol=1e-5)
    assert (points.triangles[:, 1] == -1).all()
    # A point each, however many triangles meet there.
    keys = np.concatenate([points.position, points.normal, points.i_object[:, None]], axis=1).round(4)
    assert len(np.unique(keys, axis=0)) == len(points)


def test_the_floor_is_cut_where_the_ball_stands(ball) -> None:
    points, _, _ = ball
    floor = points.position[points.i_object == FLOOR]
    distance = np.linalg.norm(floor[:, [0, 2]], axis=1)
    near, far = (distance < 0.5).sum() / 0.25, (distance > 2.0).sum() / (36 / np.pi - 4.0)
    assert near > 4 * far
    assert 1000 < len(floor) < 2500


def test_no_more_points_than_asked_for_and_none_where_nothing_is_near(ball_scene) -> None:
    caster = RayCaster(ball_scene.vertices, ball_scene.triangles)
    plain = shading_points(ball_scene, caster, 0)
    # The floor's four corners; of the ball the vertices it has, joined where its seam doubles them.
    assert (plain.i_object == FLOOR).sum() == 4
    assert (plain.i_object == BALL).sum() <= len(ball_scene.vertices) - 4
    with pytest.raises(ValueError, match="n_points = -1"):
        shading_points(ball_scene, caster, -1)


@pytest.mark.parametrize("count", [1, 7, 3000])
def test_the_nearest_occluder_is_that_of_balls_tried_one_by_one(count: int) -> None:
    """Balls of 1, 2, 4, ... 32 lengths that touch the surface from above, against every sample."""
    chance = np.random.default_rng(3)
    samples, places = chance.random((count, 3)), chance.random((400, 3))
    normals, lengths = chance.normal(size=(400, 3)), chance.uniform(1e-3, 0.1, 400)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places[:count] = samples[:400]  # some stand where a sample is
    expected = np.zeros(400)
    for k in reversed(range(6)):
        radius = lengths * 2.0**k
        middles = places + radius[:, None] * normals
        distance = np.linalg.norm(middles[:, None] - samples, axis=2).min(axis=1)
        expected[distance < radius - 1e-3 * lengths] = 2.0**-k
    found = run_to_end(_nearness(_SampleTree(samples), places, normals, lengths))
    np.testing.assert_array_equal(found, expected)
    assert count < 3000 or len(set(expected)) == 7


def test_objects_that_stay_even_are_cut_as_a_whole_or_not(ball_scene) -> None:
    caster = RayCaster(ball_scene.vertices, ball_scene.triangles)
    n_ball = int((ball_scene.object_of_triangle == BALL).sum())
    points = shading_points(ball_scene, caster, 600, np.array([True, True]))
    assert np.bincount(ball_scene.object_of_triangle[points.source]).tolist() == [2 * 4**4, n_ball]


def test_backs_have_points_of_their_own(ball_scene) -> None:
    caster = RayCaster(ball_scene.vertices, ball_scene.triangles)
    front = shading_points(ball_scene, caster, 100)
    both = with_backs(front, np.array([True, False]))
    assert len(both) == len(front) + (front.i_object == FLOOR).sum()
    floor = both.i_object == FLOOR
    assert set(both.normal[floor, 1].round(6)) == {-1.0, 1.0}
    of_floor = ball_scene.object_of_triangle[both.source] == FLOOR
    behind = both.triangles[of_floor, 1]
    np.testing.assert_allclose(both.normal[behind][..., 1], -1.0, atol=1e-6)
    np.testing.assert_array_equal(both.position[behind], both.position[both.triangles[of_floor, 0]])
    assert (both.lifted[behind][..., 1] < 0).all() and (both.triangles[~of_floor, 1] == -1).all()
    assert len(with_backs(both, np.array([True, False]))) == len(both)


def test_frames_are_right_handed_with_the_normal_for_y(ball) -> None:
    points, _, _ = ball
    np.testing.assert_allclose(np.linalg.det(points.frames), 1.0, atol=1e-4)
    np.testing.assert_allclose(points.frames[:, 1], points.normal)


def test_the_share_that_a_floor_sees_beside_a_ball_is_the_closed_form(ball) -> None:
    # A ball of radius r at angle θ from the normal, wholly above the floor, hides (1 − √(1 − (r/d)²)) / 2 of 4π and
    # r²/d² cos θ of the irradiance.
    points, _, bits = ball
    floor = np.flatnonzero((points.i_object == FLOOR) & (np.linalg.norm(points.position, axis=1) > 0.3))
    solid_angle = geodesic(4).solid_angles[upper_triangles()]
    hidden = ((4 - counts(bits[floor])) * solid_angle / 4).sum(axis=1)
    distance = np.linalg.norm(points.position[floor] - [0.0, 0.5, 0.0], axis=1)
    expected = 2 * np.pi * (1 - np.sqrt(1 - (0.5 / distance) ** 2))
    # The mesh lies inside its sphere, and an edge is found to 1.4 degrees.
    assert np.abs(hidden - expected).max() < 0.03
    assert hidden.mean() == pytest.approx(expected.mean(), rel=0.01)


def test_a_ball_sees_all_of_its_upper_side(ball) -> None:
    points, _, bits = ball
    top = (points.i_object == BALL) & (points.position[:, 1] > 0.999)
    assert (counts(bits[top]) == 4).all()


def test_a_lamp_is_seen_where_no_ball_is_before_it(ball) -> None:
    from engine.light.emitters import emitter_patches

    points, caster, _ = ball
    lamp = emitter_patches(square((0.0, 2.0, 0.0), (0.2, 0, 0), (0, 0, 0.2)), np.ones((2, 3)), 8)
    bits = np.empty((len(points), 1), np.uint8)
    trace_patches(points, caster, lamp, np.arange(len(points)), bits)
    seen = np.unpackbits(bits, axis=1, bitorder="little")[:, : len(lamp)].mean(axis=1)
    floor = points.i_object == FLOOR
    distance = np.linalg.norm(points.position[floor][:, [0, 2]], axis=1)
    # Light from 2 m over a ball that reaches to 1 m: shadow to 0.5 · 2 / √(1.5² − 0.5²) = 0.707 m, and its penumbra.
    assert (seen[floor][distance < 0.5] == 0).all()
    assert (seen[floor][distance > 1.2] == 1).all()


def test_triangles_are_halved_where_others_have_corners_and_none_without_length_is() -> None:
    """A whole triangle beside one that is cut in four: it is halved; a point and a line stay."""
    a, b, c, d = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
    corners = np.array([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca), (b, d, c), (a, a, a), (d, d, c)])
    n = len(corners)
    halved, *_, source = _joined_at_edges((corners, np.ones((n, 3, 3)), np.zeros((n, 3, 2)), np.arange(n)))
    assert sorted(source) == [0, 1, 2, 3, 4, 4, 5, 6]
    assert (halved[source == 4] == bc).all(axis=2).any(axis=1).all()
