"""Deformers and the axes of bent points: Jacobians by differences, closed forms, and what collapses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.realtime.deformers import KINDS
from engine.realtime.zonal_harmonics.pose import Deformation, Pose, deform, deformed_frames

AMOUNTS = [(name, share) for name in KINDS for share in (-1.0, -0.3, 0.4, 1.0)]
ARCS = {"bend", "twist"}


def points(count: int = 30) -> np.ndarray:
    places = np.random.default_rng(4).uniform(-0.4, 0.4, (count, 3))
    places[:, 1] += 0.5
    return places


def amount_of(name: str, share: float) -> float:
    low, high = KINDS[name].limits
    return share * (high if share > 0 else -low)


def upright(vertices: np.ndarray) -> Pose:
    return Pose(vertices, np.asarray(Rotation.random(len(vertices), random_state=1).as_matrix()))


@pytest.mark.parametrize(("name", "share"), AMOUNTS)
def test_jacobians_are_those_of_the_map(name: str, share: float) -> None:
    move, amount, h = KINDS[name].move, amount_of(name, share), 1e-6
    jacobians = move(points(), amount)[1]
    columns = [(move(points() + h * e, amount)[0] - move(points() - h * e, amount)[0]) / (2 * h) for e in np.eye(3)]
    assert jacobians == pytest.approx(np.stack(columns, axis=2), abs=1e-7)


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("amount", [0.0, 1e-300, 1e-9])
def test_nothing_moves_by_nothing(name: str, amount: float) -> None:
    moved, jacobians = KINDS[name].move(points(), amount)
    assert moved == pytest.approx(points(), abs=2e-8) and jacobians == pytest.approx(
        np.broadcast_to(np.eye(3), jacobians.shape), abs=2e-8
    )


def test_a_whole_turn_of_bending_closes_a_ring() -> None:
    ends = np.array([[0.0, 0.0, 0.2], [0.0, 1.0, 0.2], [0.0, 0.5, 0.2]])
    for turns in (1, 2):
        moved = KINDS["bend"].move(ends, 360.0 * turns)[0]
        assert moved[1] == pytest.approx(moved[0], abs=1e-12)
    assert KINDS["bend"].move(ends, 360.0)[0][2] == pytest.approx([1 / math.pi, 0.0, 0.2], abs=1e-12)


def test_bending_keeps_the_axis_as_long_as_it_was() -> None:
    axis = np.zeros((2001, 3))
    axis[:, 1] = np.linspace(0.0, 1.0, 2001)
    moved = KINDS["bend"].move(axis, 250.0)[0]
    assert np.linalg.norm(np.diff(moved, axis=0), axis=1).sum() == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("axis", "xyz")
def test_axes_follow_a_row_of_deformers(axis: str) -> None:
    """A patch's tangents by differences, bent: its normal stays across them."""
    rest = upright(3.0 * points() + 7.0)
    row = [Deformation("twist", 130.0, axis), Deformation("bend", 70.0, axis), Deformation("taper", -0.4, axis)]
    pose = deform(rest, row)
    assert np.abs(pose.frames @ pose.frames.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    assert np.linalg.det(pose.frames) == pytest.approx(1.0)
    h = 1e-5
    corners = np.concatenate([rest.positions + h * rest.frames[:, 0], rest.positions + h * rest.frames[:, 1]])
    n = len(rest.positions)
    whole = deform(upright(np.concatenate([rest.positions, corners, *_box(rest.positions)])), row).positions
    u, v = whole[n : 2 * n] - whole[:n], whole[2 * n : 3 * n] - whole[:n]
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v), axis=1)[:, None]
    assert normal == pytest.approx(pose.frames[:, 2], abs=1e-3)


def _box(vertices: np.ndarray) -> list[np.ndarray]:
    """Corners, so that a larger set of points has the same box but for the step's own size."""
    return [vertices.min(axis=0)[None], vertices.max(axis=0)[None]]


def test_a_turn_of_space_turns_the_axes() -> None:
    frames, turn = upright(points()).frames, Rotation.from_euler("zyx", [0.3, 1.1, -2.0]).as_matrix()
    assert deformed_frames(frames, np.broadcast_to(turn, frames.shape)) == pytest.approx(frames @ turn.T, abs=1e-12)


@pytest.mark.parametrize(
    "map_",
    [
        np.zeros((3, 3)),
        np.diag([1.0, 0.0, 0.0]),
        np.diag([1.0, 1.0, 0.0]),
        np.diag([-1.0, 1.0, 1.0]),
        1e-200 * np.eye(3),
    ],
)
def test_where_space_collapses_or_is_mirrored_axes_stay_axes(map_: np.ndarray) -> None:
    frames = np.concatenate([upright(points()).frames, np.eye(3)[None]])
    there = deformed_frames(frames, np.broadcast_to(map_, frames.shape))
    assert np.abs(there @ there.transpose(0, 2, 1) - np.eye(3)).max() < 1e-9 and np.linalg.det(there) == pytest.approx(
        1.0
    )


def test_a_top_drawn_into_a_point_and_a_flat_mesh_stay_finite() -> None:
    cone = deform(upright(points()), [Deformation("taper", -1.0), Deformation("bend", 720.0)])
    flat = upright(points() * (1.0, 0.0, 1.0))
    assert np.isfinite(cone.positions).all() and np.isfinite(cone.frames).all()
    assert (deform(flat, [Deformation("bend", 90.0)]).positions == flat.positions).all()


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (("melt", 1.0), "deformer 'melt', expected one of bend, twist, taper, bulge, wave"),
        (("bend", 721.0), "bend 721, expected -720 to 720"),
        (("bend", math.nan), "bend nan, expected -720 to 720"),
        (("bend", 1.0, "w"), "axis 'w', expected one of x, y, z"),
    ],
)
def test_odd_deformations_are_refused(odd: tuple, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Deformation(*odd)
