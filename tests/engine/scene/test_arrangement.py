"""Objects that are moved together: their corners go as by one matrix, where that is no shear."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.arrangement import PlacedObject, box_of, dropped, middle_of, moved, rotated, scaled, stood_on
from engine.scene.transform import MOST_SCALE, Transform, rotation_matrix

LEFT = PlacedObject("left", np.array([[-2.0, 0.0, -1.0], [0.0, 1.0, 1.0]]), Transform((0.0, 0.5, 0.0)))
RIGHT = PlacedObject("right", np.array([[1.0, 0.0, 0.0], [2.0, 3.0, 1.0]]), Transform(rotation=(0.0, 0.0, 90.0)))
BOTH = (LEFT, RIGHT)


def corners(placed: PlacedObject) -> np.ndarray:
    """The eight corners of its box where it stands."""
    low, high = placed.box
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    matrix = placed.transform.matrix(placed.pivot)
    return corners @ matrix[:3, :3].T + matrix[:3, 3]


def test_the_middle_is_the_mean_of_the_centres() -> None:
    # Centres: (-1, 0.5, 0) + (0, 0.5, 0) and (1.5, 1.5, 0.5).
    assert middle_of(BOTH) == pytest.approx([0.25, 1.25, 0.25])
    # The right one lies on its side: 3 m wide, 1 m high.
    assert box_of(BOTH) == pytest.approx(np.array([[-2.0, 0.5, -1.0], [3.0, 2.0, 1.0]]))
    assert LEFT.extent_along((0.0, 1.0, 0.0)) == 0.5
    assert RIGHT.extent_along((1.0, 0.0, 0.0)) == pytest.approx(1.5)


def test_a_rotation_about_a_point_turns_all_corners_about_it() -> None:
    rotation, about = rotation_matrix((20.0, -70.0, 130.0)), np.array([0.3, -1.0, 2.0])
    for before, after in zip(BOTH, rotated(BOTH, rotation, about), strict=True):
        assert corners(after) == pytest.approx(about + (corners(before) - about) @ rotation.T)
    for before, after in zip(BOTH, rotated(BOTH, rotation), strict=True):
        assert corners(after) == pytest.approx(before.centre + (corners(before) - before.centre) @ rotation.T)


@pytest.mark.parametrize("factors", [(2.0, 2.0, 2.0), (0.5, 3.0, 1.5)])
def test_a_scale_along_axes_that_objects_follow_scales_all_corners(factors: tuple[float, ...]) -> None:
    """The right one's own axes are the world's, in another order."""
    about = np.array([0.3, -1.0, 2.0])
    for before, after in zip(BOTH, scaled(BOTH, factors, about), strict=True):
        assert corners(after) == pytest.approx(about + (corners(before) - about) * factors)


def test_each_by_itself_is_scaled_along_its_own_axes() -> None:
    (_, right) = scaled(BOTH, (2.0, 1.0, 1.0))
    assert right.transform.scale == (2.0, 1.0, 1.0) and right.centre == pytest.approx(RIGHT.centre)
    # Its X is the world's Y by now.
    assert np.ptp(right.moved_box, axis=0) == pytest.approx([3.0, 2.0, 1.0])


def test_a_scale_across_an_objects_axes_keeps_their_directions() -> None:
    tilted = PlacedObject("tilted", LEFT.box, Transform(rotation=(0.0, 0.0, 30.0)))
    (found,) = scaled((tilted,), (2.0, 1.0, 1.0), tilted.centre)
    cosine, sine = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    assert found.transform.rotation == tilted.transform.rotation
    assert found.transform.scale == pytest.approx([np.hypot(2.0 * cosine, sine), np.hypot(2.0 * sine, cosine), 1.0])
    assert scaled((tilted,), (1e9, 1.0, 1.0))[0].transform.scale[0] == MOST_SCALE


def test_a_move_moves_all_and_no_farther_than_there_is_room() -> None:
    for before, after in zip(BOTH, moved(BOTH, (0.1, -2.0, 3.0)), strict=True):
        assert corners(after) == pytest.approx(corners(before) + (0.1, -2.0, 3.0))
    with pytest.raises(ValueError, match="translation"):
        moved(BOTH, (1e7, 0.0, 0.0))


FLOOR = np.array([[-9.0, -0.1, -9.0], [9.0, 0.0, 9.0]])
TABLE = np.array([[-1.0, 0.0, -1.0], [1.0, 0.7, 1.0]])
ROOM = np.array([[-5.0, -1.0, -5.0], [5.0, 4.0, 5.0]])


def ball(x: float, y: float) -> PlacedObject:
    """A ball of radius 0.1 with its centre there."""
    return PlacedObject(f"ball {x} {y}", np.array([[-0.1] * 3, [0.1] * 3]), Transform((x, y, 0.0)))


def test_what_is_dropped_stands_on_what_is_below() -> None:
    for x, y, height in (
        (0.0, 2.0, 0.7), (0.0, 0.75, 0.7), (0.0, 0.3, 0.0), (3.0, 2.0, 0.0), (1.05, 2.0, 0.7), (20.0, 1.0, -1.0)
    ):  # fmt: skip
        (found,) = dropped([[ball(x, y)]], np.array([FLOOR, TABLE, ROOM]))
        assert found.centre == pytest.approx([x, height + 0.1, 0.0]), (x, y)
    (found,) = dropped([[ball(0.0, 2.0)]], ROOM[None])  # on its floor, not on its roof
    assert found.centre[1] == pytest.approx(-0.9)
    (found,) = dropped([[ball(0.0, 2.0)]], np.zeros((0, 2, 3)))
    assert found.centre[1] == pytest.approx(0.1)


def test_what_is_dropped_at_once_stands_on_each_other_and_a_group_stays_together() -> None:
    found = dropped([[ball(0.0, 3.0)], [ball(0.05, 1.0)]], FLOOR[None])
    assert sorted(each.centre[1] for each in found) == pytest.approx([0.1, 0.3])
    found = dropped([[ball(0.0, 3.0), ball(0.05, 1.0)]], FLOOR[None])
    assert sorted(each.centre[1] for each in found) == pytest.approx([0.1, 2.1])


@pytest.mark.parametrize("aligns", [False, True])
def test_what_stands_on_a_surface_touches_it_and_is_nowhere_behind_it(aligns: bool) -> None:
    tilted = PlacedObject("tilted", LEFT.box, Transform((3.0, 1.0, 2.0), (20.0, 30.0, 40.0), (1.0, 2.0, 0.5)))
    point, normal = np.array([0.4, 0.2, -0.3]), np.array([0.6, 0.8, 0.0])
    for placed in ((LEFT,), (tilted,), (LEFT, RIGHT), (LEFT, RIGHT, tilted)):
        found = stood_on(placed, point, normal, aligns)
        heights = np.concatenate([(corners(each) - point) @ normal for each in found])
        assert heights.min() == pytest.approx(0.0, abs=1e-12)
        across = middle_of(found) - point
        assert across - (across @ normal) * normal == pytest.approx(np.zeros(3), abs=1e-12)
    turn = rotation_matrix((0.0, 0.0, -np.degrees(np.arctan2(0.6, 0.8)))) if aligns else np.eye(3)
    before, after = (rotation_matrix(each.transform.rotation) for each in (tilted, found[-1]))
    assert after == pytest.approx(turn @ before)
