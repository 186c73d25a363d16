"""Transfer vectors of points: against what a cosine, a corner and its own reflections give in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.core.frames import local_frames
from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.transfer import (
    TransferPoints,
    cosine_directions,
    rotate_transfer,
    simulate,
    unshadowed,
)
from engine.scene.raycaster import RayCaster, surface_points
from engine.sphere.harmonics import basis, clamped_cosine, rotate

FAR = 1000.0
CONSTANT = math.sqrt(4.0 * math.pi)  # light of radiance 1, in the constant band


def corner() -> tuple[TransferPoints, RayCaster, np.ndarray]:
    """A floor (z = 0) and a wall (x = 0) that meet along y, far larger than the points' distance to it; which points
    are 1 to 10 off it."""
    along = np.linspace(-50 * FAR, 50 * FAR, 5)
    away = np.concatenate([[0.0], np.geomspace(0.1, FAR, 25)])
    grid = np.stack(np.meshgrid(away, along, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(grid)).reshape(len(away), len(along))
    a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    floor = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    none = np.zeros(len(grid))
    vertices = np.concatenate(
        [np.stack([grid[:, 0], grid[:, 1], none], 1), np.stack([none, grid[:, 1], grid[:, 0]], 1)]
    )
    triangles = np.concatenate([floor, floor[:, ::-1] + len(grid)]).astype(np.int32)
    normals = np.repeat([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], len(grid), axis=0)
    frames = local_frames(np.tile([0.0, 1.0, 0.0], (len(vertices), 1)), normals)
    caster = RayCaster(vertices, triangles)
    near = (vertices[:, 1] == 0.0) & (vertices.max(axis=1) > 1.0) & (vertices.max(axis=1) < 10.0)
    return TransferPoints(surface_points(caster, vertices, normals), frames, triangles), caster, near


def test_nothing_in_the_way_is_a_cosine() -> None:
    expected = np.zeros(36)
    expected[[l * l + l for l in range(6)]] = 1.0  # noqa: E741
    expected *= basis([0.0, 0.0, 1.0], 6) * (clamped_cosine(6) / math.pi)[np.repeat(np.arange(6), 2 * np.arange(6) + 1)]
    assert unshadowed(2, 6) == pytest.approx(np.stack([expected, expected]), abs=3e-4)


@pytest.mark.parametrize(
    ("albedo", "n_bounces", "radiance"),
    [(0.0, 0, 0.5), (0.5, 0, 0.5), (0.5, 1, 0.625), (0.5, 12, 2 / 3), (0.9, 1, 0.725)],
)
def test_a_corner_sees_half_and_reflects_half_of_itself(albedo: float, n_bounces: int, radiance: float) -> None:
    """Either plane fills half of what the other sees, so B = 1/2 + rho B / 2 under light of radiance 1."""
    mesh, caster, near = corner()
    vectors = run_to_end(simulate(mesh, caster, 3, albedo, n_bounces, n_rays=2000))
    assert CONSTANT * vectors[near, 0] == pytest.approx(radiance, rel=0.02)


def test_a_wall_takes_the_light_from_its_own_side() -> None:
    mesh, caster, near = corner()
    vectors = run_to_end(simulate(mesh, caster, 3, n_rays=2000))
    directions, values = cosine_directions(2000, 3)
    floor = np.flatnonzero(near)[0]
    open_half = (directions @ mesh.frames[floor])[:, 0] > 0.0
    assert vectors[floor] == pytest.approx((values * open_half[:, None]).mean(axis=0), abs=2e-3)


def test_vectors_turn_with_their_frames() -> None:
    vectors = np.random.default_rng(5).normal(size=(3, 36))
    turns = [Rotation.from_euler("zyx", angles) for angles in ([0.0, 0.0, 0.0], [1.0, 0.2, -2.0], [0.0, math.pi, 0.0])]
    frames = np.stack([turn.as_matrix().T for turn in turns])  # rows: the turned axes
    expected = [rotate(vector, turn.as_matrix().T) for vector, turn in zip(vectors, turns, strict=True)]
    assert rotate_transfer(vectors, frames) == pytest.approx(np.stack(expected), abs=1e-12)
