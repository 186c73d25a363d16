"""Visibility of targets from surface points: one bit per target, packed [BenArtzi07, ch. 8].

Targets are directions (triangles of the geodesic sphere, and finer ones) or points (on patches of an area light).
Visibility depends on geometry alone, so edits of material and light do not invalidate it. Points are primary hits of a
camera, vertices of a mesh or texels: anything with a position, a normal and an offset position. Here every target above
their horizon is traced: the oracle, and the reference for speed. Most points of a picture need no ray:
`engine.visibility.coherent_grid`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from engine.scene.raycaster import RayCaster, SurfacePoints
from engine.sphere.geodesic import geodesic
from engine.visibility import _kernels as kernels

VISIBILITY_LEVEL = 4
WEAK_STEP, WEAKEST_STEP, DOUBT_STEP = 64, 16, 4
BLOCK = 1024
SHARE_POINTS = 4096

Guess = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


@dataclass(frozen=True)
class Targets:
    """Targets of visibility: D directions, or D points with a front side.

    positions (D, 3) float32 unit directions or world points; normals (D, 3) float32 of points (zero for directions);
    neighbours (D, N) int32, -1 padded: the targets that flooding continues to; parents (D,) int32: the triangle of the
    visibility level that contains a finer direction. sentinel_step: every such target is traced whatever the prediction
    (0: none), because a light patch is small, and the points around a thin shadow can agree on all of it. weak_step,
    weakest_step: the same for a point with three informers, and with two. doubt_step: in the last step of the picture,
    among targets that three of four points see, only every such one is traced (0: all). rotating: different points
    trace different sentinels, so that every target is some point's. bright (D,) bool: targets that every point traces,
    because each is so bright that no error is small; None: none.
    """

    positions: np.ndarray
    normals: np.ndarray
    neighbours: np.ndarray
    finite: bool = False
    parents: np.ndarray | None = None
    sentinel_step: int = 0
    weak_step: int = 0
    weakest_step: int = 0
    doubt_step: int = 0
    rotating: bool = False
    bright: np.ndarray | None = None

    def __post_init__(self) -> None:
        # Read-only, as the sphere's neighbours are: kernels would be compiled anew for writable ones.
        neighbours = self.neighbours.view()
        neighbours.flags.writeable = False
        object.__setattr__(self, "neighbours", neighbours)

    @property
    def n_words(self) -> int:
        return (len(self.positions) + 63) // 64

    @cached_property
    def cones(self) -> np.ndarray:
        """Axis and sine of the radius, with room for rounding, of each sixteen consecutive directions: (G, 4) float32.

        Points have none.
        """
        if self.finite:
            return np.zeros((0, 4), np.float32)
        starts = np.arange(0, len(self.positions), kernels.GROUP)
        axes = np.add.reduceat(self.positions, starts, axis=0, dtype=np.float64)
        axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-6)
        along = np.einsum("dc,dc->d", self.positions, np.repeat(axes, kernels.GROUP, axis=0)[: len(self.positions)])
        cosine = np.minimum.reduceat(along, starts)
        sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0)) + 1e-4
        return np.column_stack([axes, np.where(cosine > 0.0, sine, 2.0)]).astype(np.float32)

    @cached_property
    def bright_words(self) -> np.ndarray:
        """Packed bits (words,) of the bright targets."""
        marked = np.zeros(64 * self.n_words, np.uint8)
        if self.bright is not None:
            marked[: len(self.bright)] = self.bright
        return np.packbits(marked, bitorder="little").view(np.uint64)

    def sentinels(self, step: int) -> np.ndarray:
        """Packed bits (S, words) of every step-th target: on a sphere, for a power of four, the centre children.

        If they rotate, one row for each of the S = step offsets; empty for step = 0.
        """
        marked = np.zeros((step if self.rotating and step else 1, 64 * self.n_words), np.uint8)
        for turn in range(len(marked) if step else 0):
            marked[turn, (step - 1 + turn) % step : len(self.positions) : step] = 1
        return np.packbits(marked, axis=1, bitorder="little").view(np.uint64)


def sphere_targets(level: int) -> Targets:
    """The triangle centres of one geodesic level, with flooding across edges."""
    sphere = geodesic(level)
    centres = np.ascontiguousarray(sphere.centres, np.float32)
    return Targets(
        centres, np.zeros_like(centres), sphere.neighbours,
        weak_step=WEAK_STEP, weakest_step=WEAKEST_STEP, doubt_step=DOUBT_STEP,
    )  # fmt: skip


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


def see_all(visibility: Visibility) -> None:
    """Let every point see every target, in place."""
    marked = np.zeros(64 * visibility.targets.n_words, np.uint8)
    marked[: len(visibility.targets.positions)] = 1
    visibility.bits[:] = np.packbits(marked, bitorder="little").view(np.uint64)
    visibility.done[:] = True


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
        blocked = trace_targets(points, caster, targets, rows, block, target)
        room = n_rays * targets.neighbours.shape[1]
        next_block, next_target = np.empty(room, np.int32), np.empty(room, np.int32)
        n_rays = kernels.apply_answers(
            rows, block, target, blocked, doubt, bits, horizon, targets.neighbours, requested, next_block, next_target
        )
        block, target = next_block[:n_rays], next_target[:n_rays]
    return n_traced, int(kernels.count_bits(horizon))


def trace_targets(
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


def guess_nothing(visibility: Visibility) -> Guess:
    """The guess after which every target above the horizon is traced."""

    def guess(rows: np.ndarray, horizon: np.ndarray, todo: np.ndarray, doubt: np.ndarray) -> None:
        visibility.bits[rows] = 0
        todo[:] = horizon

    return guess


def evaluate_rows(points: SurfacePoints, caster: RayCaster, visibility: Visibility, rows: np.ndarray) -> None:
    """Traces every target above the horizon of the rows that are not done yet."""
    rows = np.asarray(rows[~visibility.done[rows]], np.int32)  # kernels are compiled for int32
    everything = guess_nothing(visibility)
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
