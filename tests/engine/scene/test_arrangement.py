"""Objects that are moved together: their corners go as by one matrix, where that is no shear."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.arrangement import PlacedObject, box_of, middle_of, moved, rotated, scaled
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
