"""Visibility of targets from surface points: one bit per target, packed [BenArtzi07, ch. 8].

Targets are directions (triangles of the geodesic sphere) or points (patches of an area light). Visibility depends on
geometry alone, so edits of material and light do not invalidate it. Points are primary hits of a camera, vertices of a
mesh or texels: anything with a position, a normal and an offset position. Here every target above their horizon is
traced: the oracle, and the reference for speed. Most points of a picture need no ray:
`engine.visibility.coherent_grid`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from engine.scene.raycaster import RayCaster
from engine.scene.surface_points import SurfacePoints
from engine.visibility import _kernels as kernels
from engine.visibility.targets import Targets

BLOCK = 1024
SHARE_POINTS = 4096

Guess = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


@dataclass
class RayCount:
    """The number of shadow rays that Embree traced, and the number that brute force would trace."""

    traced: int = 0
    possible: int = 0


@dataclass
class Visibility:
    """Packed bits of P points: bits (P, words) uint64; done (P,): the evaluated rows."""

    targets: Targets
    bits: np.ndarray
    done: np.ndarray
    rays: RayCount = field(default_factory=RayCount)

    def unpacked(self, rows: np.ndarray) -> np.ndarray:
        """(len(rows), D) bool."""
        octets = np.ascontiguousarray(self.bits[rows]).view(np.uint8)
        return np.unpackbits(octets, axis=1, bitorder="little")[:, : len(self.targets.positions)].astype(bool)


def visible_shares(visibility: Visibility, rows: np.ndarray) -> np.ndarray:
    """The share (D,) of some evaluated points that see each target, estimated from about 4,096 of them."""
    chosen = rows[:: max(1, len(rows) // SHARE_POINTS)]
    return visibility.unpacked(chosen).mean(axis=0) if len(chosen) else np.ones(len(visibility.targets.positions))


def empty_visibility(points: SurfacePoints, targets: Targets) -> Visibility:
    n_points = len(points.position)
    return Visibility(targets, np.zeros((n_points, targets.n_words), np.uint64), np.zeros(n_points, bool))


def horizons(points: SurfacePoints, targets: Targets, rows: np.ndarray) -> np.ndarray:
    """Packed bits (B, words): the targets that points would see without occlusion."""
    horizon = np.empty((len(rows), targets.n_words), np.uint64)
    kernels.horizon_bits(
        rows, points.position, points.horizon, targets.positions, targets.normals, targets.finite, targets.cones,
        horizon,
    )  # fmt: skip
    return horizon


def evaluate_block(
    points: SurfacePoints, caster: RayCaster, visibility: Visibility, rows: np.ndarray, guess: Guess
) -> tuple[int, int]:
    """Evaluates one block of points; returns (rays traced, rays brute force would trace).

    guess(rows, horizon, todo, doubt) fills the bits of the rows and marks in todo the targets to trace.
    """
    targets, bits = visibility.targets, visibility.bits
    horizon = horizons(points, targets, rows)
    requested, doubt = np.zeros_like(horizon), np.zeros_like(horizon)
    guess(rows, horizon, requested, doubt)
    n_rays = kernels.count_bits(requested)
    block, target = np.empty(n_rays, np.int32), np.empty(n_rays, np.int32)
    kernels.list_bits(requested, block, target)
    n_traced = 0
    while n_rays:
        n_traced += n_rays
        blocked = _trace(points, caster, targets, rows, block, target)
        room = n_rays * targets.neighbours.shape[1]
        next_block, next_target = np.empty(room, np.int32), np.empty(room, np.int32)
        n_rays = kernels.apply_answers(
            rows, block, target, blocked, doubt, bits, horizon, targets.neighbours, requested, next_block, next_target
        )
        block, target = next_block[:n_rays], next_target[:n_rays]
    return n_traced, int(kernels.count_bits(horizon))


def _trace(
    points: SurfacePoints, caster: RayCaster, targets: Targets, rows: np.ndarray, block: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """Whether the targets (R,) are occluded from the points rows[block] (R,)."""
    n_rays = len(block)
    origin, direction = np.empty((n_rays, 3), np.float32), np.empty((n_rays, 3), np.float32)
    distance = np.empty(n_rays if targets.finite else 0, np.float32)
    kernels.write_rays(
        rows, block, target, points.position, points.offset_position, targets.positions, targets.finite,
        origin, direction, distance,
    )  # fmt: skip
    return caster.occluded(origin, direction, distance if targets.finite else None)


def evaluate_rows(points: SurfacePoints, caster: RayCaster, visibility: Visibility, rows: np.ndarray) -> None:
    """Traces every target above the horizon of the rows that are not done yet."""
    rows = np.asarray(rows[~visibility.done[rows]], np.int32)  # kernels are compiled for int32

    def everything(block: np.ndarray, horizon: np.ndarray, todo: np.ndarray, doubt: np.ndarray) -> None:
        visibility.bits[block] = 0
        todo[:] = horizon

    for i in range(0, len(rows), BLOCK):
        traced, possible = evaluate_block(points, caster, visibility, rows[i : i + BLOCK], everything)
        visibility.rays.traced += traced
        visibility.rays.possible += possible
    visibility.done[rows] = True


def brute_force_visibility(points: SurfacePoints, caster: RayCaster, targets: Targets, rows: np.ndarray) -> Visibility:
    """Traces every target above the horizon of the given rows (the others remain unevaluated)."""
    visibility = empty_visibility(points, targets)
    evaluate_rows(points, caster, visibility, rows)
    return visibility
