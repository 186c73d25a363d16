"""Transforms by hand, against their closed form written out in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.transform import MOST_SCALE, Transform, rotation_degrees, rotation_matrix


def about(axis: int, degrees: float) -> np.ndarray:
    """The right-handed rotation about one axis: what is 90 degrees from X about Z is Y."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    found = np.eye(3)
    found[one, one] = found[two, two] = cosine
    found[two, one], found[one, two] = sine, -sine
    return found


def test_rotations_are_about_x_then_y_then_z() -> None:
    rng = np.random.default_rng(4)
    for x, y, z in rng.uniform(-400.0, 400.0, (50, 3)):
        assert rotation_matrix((x, y, z)) == pytest.approx(about(2, z) @ about(1, y) @ about(0, x), abs=1e-12)
    # +X goes to +Y by a quarter turn about Z, as in Blender.
    assert rotation_matrix((0.0, 0.0, 90.0)) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


def test_angles_of_a_rotation_give_it_back() -> None:
    rng = np.random.default_rng(5)
    angles = [*rng.uniform(-180.0, 180.0, (100, 3)), *([x, y, z] for x in (0, 40) for y in (90, -90) for z in (0, 75))]
    for each in angles:
        matrix = rotation_matrix(list(each))
        found = rotation_degrees(matrix)
        assert -90.0 <= found[1] <= 90.0
        assert rotation_matrix(found) == pytest.approx(matrix, abs=1e-9)


def test_points_turn_about_the_pivot_and_are_then_moved() -> None:
    rng = np.random.default_rng(6)
    pivot, points = rng.normal(size=3), rng.normal(size=(20, 3))
    transform = Transform((1.0, -2.0, 0.5), (30.0, -70.0, 200.0), (0.5, 2.0, 3.0))
    turned = about(2, 200.0) @ about(1, -70.0) @ about(0, 30.0)
    expected = (points - pivot) * (0.5, 2.0, 3.0) @ turned.T + pivot + (1.0, -2.0, 0.5)
    matrix = transform.matrix(pivot)
    assert points @ matrix[:3, :3].T + matrix[:3, 3] == pytest.approx(expected, abs=1e-12)
    assert matrix @ [*pivot, 1.0] == pytest.approx([*pivot + transform.translation, 1.0], abs=1e-12)


def test_further_rotations_are_about_the_axes_of_the_world() -> None:
    transform = Transform(rotation=(0.0, 0.0, 90.0), scale=(2.0, 1.0, 1.0)).rotated((90.0, 0.0, 0.0))
    # Its long side lies along Y after the first; about the world's X it then stands along Z.
    assert transform.linear @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)


def test_the_box_of_what_moves_is_that_of_its_corners() -> None:
    box = np.array([[0.0, 1.0, -1.0], [2.0, 2.0, 3.0]])
    transform = Transform((0.3, 0.0, -5.0), (20.0, 50.0, -80.0), (1.5, 0.2, 1.0))
    corners = np.array([[x, y, z] for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])
    matrix = transform.matrix(box.mean(axis=0))
    moved = corners @ matrix[:3, :3].T + matrix[:3, 3]
    assert transform.moved_box(box) == pytest.approx(np.stack([moved.min(axis=0), moved.max(axis=0)]), abs=1e-12)
    assert Transform().moved_box(box) is box


@pytest.mark.parametrize(
    ("part", "values", "said"),
    [
        ("scale", (1.0, 0.0, 1.0), r"scale \[1, 0, 1\], expected three numbers from 0.001 to 1000"),
        ("scale", (1.0, 1.0, 2.0 * MOST_SCALE), "scale"),
        ("translation", (float("nan"), 0.0, 0.0), r"translation \[nan, 0, 0\], expected three numbers from -1e\+06 to"),
        ("rotation", (0.0, 0.0, float("inf")), "rotation"),
    ],
)
def test_what_makes_no_sense_is_refused(part: str, values: tuple[float, float, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Transform(**{part: values})
