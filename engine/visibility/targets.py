"""Targets of visibility: the directions of the geodesic sphere, finer directions, and points on emitters."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine.sphere.geodesic import geodesic
from engine.visibility import _kernels as kernels

VISIBILITY_LEVEL = 4
WEAK_STEP, WEAKEST_STEP, DOUBT_STEP = 64, 16, 4


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
