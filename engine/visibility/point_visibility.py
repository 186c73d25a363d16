"""Which targets each point of a surface sees: one bit a target, packed [BenArtzi07, ch. 8].

Targets are directions (triangles of the geodesic sphere) or points (patches of an area light). Geometry alone decides,
so the answer outlives every edit of material and of light. Points are those that a camera sees, vertices of a mesh or
texels: whatever has a place, a normal and a place lifted off the surface. Here every target above their horizon is
traced: the oracle, and the yardstick for speed. Of the points of a picture most need no ray:
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
    """How many shadow rays were asked of Embree, and how many brute force would ask."""

    traced: int = 0
    possible: int = 0


@dataclass
class Visibility:
    """Packed bits of P points: bits (P, words) uint64; `done` (P,) says which rows are evaluated."""

    targets: Targets
    bits: np.ndarray
    done: np.ndarray
    rays: RayCount = field(default_factory=RayCount)

    def unpacked(self, rows: np.ndarray) -> np.ndarray:
        """(len(rows), D) bool."""
        octets = np.ascontiguousarray(self.bits[rows]).view(np.uint8)
        return np.unpackbits(octets, axis=1, bitorder="little")[:, : len(self.targets.positions)].astype(bool)


def visible_shares(visibility: Visibility, rows: np.ndarray) -> np.ndarray:
    """The share (D,) of some evaluated points that sees each target, by 4,096 of them at most."""
    chosen = rows[:: max(1, len(rows) // SHARE_POINTS)]
    return visibility.unpacked(chosen).mean(axis=0) if len(chosen) else np.ones(len(visibility.targets.positions))


def empty_visibility(points: SurfacePoints, targets: Targets) -> Visibility:
    n_points = len(points.position)
    return Visibility(targets, np.zeros((n_points, targets.n_words), np.uint64), np.zeros(n_points, bool))


def horizons(points: SurfacePoints, targets: Targets, rows: np.ndarray) -> np.ndarray:
    """Packed bits (B, words): which of the targets some points could see if nothing stood between."""
    horizon = np.empty((len(rows), targets.n_words), np.uint64)
    kernels.horizon_bits(
        rows, points.position, points.horizon, targets.positions, targets.normals, targets.finite, targets.cones,
        horizon,
    )  # fmt: skip
    return horizon


def evaluate_block(
    points: SurfacePoints, caster: RayCaster, visibility: Visibility, rows: np.ndarray, guess: Guess
) -> tuple[int, int]:
    """Evaluate one block of points; returns (rays traced, rays brute force would trace).

    guess(rows, horizon, todo, doubt) fills the bits of the rows and marks in todo what must be traced.
    """
    targets, bits = visibility.targets, visibility.bits
    horizon = horizons(points, targets, rows)
    asked, doubt = np.zeros_like(horizon), np.zeros_like(horizon)
    guess(rows, horizon, asked, doubt)
    n_rays = kernels.count_bits(asked)
    block, target = np.empty(n_rays, np.int32), np.empty(n_rays, np.int32)
    kernels.list_bits(asked, block, target)
    n_traced = 0
    while n_rays:
        n_traced += n_rays
        blocked = _trace(points, caster, targets, rows, block, target)
        room = n_rays * targets.neighbours.shape[1]
        next_block, next_target = np.empty(room, np.int32), np.empty(room, np.int32)
        n_rays = kernels.apply_answers(
            rows, block, target, blocked, doubt, bits, horizon, targets.neighbours, asked, next_block, next_target
        )
        block, target = next_block[:n_rays], next_target[:n_rays]
    return n_traced, int(kernels.count_bits(horizon))


def _trace(
    points: SurfacePoints, caster: RayCaster, targets: Targets, rows: np.ndarray, block: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """Whether something hides the targets (R,) from the points rows[block] (R,)."""
    n_rays = len(block)
    origin, direction = np.empty((n_rays, 3), np.float32), np.empty((n_rays, 3), np.float32)
    distance = np.empty(n_rays if targets.finite else 0, np.float32)
    kernels.write_rays(
        rows, block, target, points.position, points.offset_position, targets.positions, targets.finite,
        origin, direction, distance,
    )  # fmt: skip
    return caster.occluded(origin, direction, distance if targets.finite else None)


def evaluate_rows(points: SurfacePoints, caster: RayCaster, visibility: Visibility, rows: np.ndarray) -> None:
    """Trace every target above the horizon of those rows that are not done yet."""
    rows = np.asarray(rows[~visibility.done[rows]], np.int32)  # kernels are compiled for these

    def everything(block: np.ndarray, horizon: np.ndarray, todo: np.ndarray, doubt: np.ndarray) -> None:
        visibility.bits[block] = 0
        todo[:] = horizon

    for i in range(0, len(rows), BLOCK):
        traced, possible = evaluate_block(points, caster, visibility, rows[i : i + BLOCK], everything)
        visibility.rays.traced += traced
        visibility.rays.possible += possible
    visibility.done[rows] = True


def brute_force_visibility(points: SurfacePoints, caster: RayCaster, targets: Targets, rows: np.ndarray) -> Visibility:
    """Trace every target above the horizon of the given rows (the others stay unevaluated)."""
    visibility = empty_visibility(points, targets)
    evaluate_rows(points, caster, visibility, rows)
    return visibility
