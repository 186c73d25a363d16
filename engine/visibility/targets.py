"""What visibility is asked of: the directions of the geodesic sphere, finer ones, and points that shine."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine.sphere.geodesic import geodesic
from engine.visibility import _kernels as kernels

VISIBILITY_LEVEL = 4
WEAK_STEP, WEAKEST_STEP, DOUBT_STEP = 64, 16, 4


@dataclass(frozen=True)
class Targets:
    """What visibility is asked of: D directions, or D points with a front side.

    positions (D, 3) float32 unit directions or world points; normals (D, 3) float32 of points (zero for directions);
    neighbours (D, N) int32, -1 padded: where flooding goes; parents (D,) int32: the triangle of the visibility level
    that a finer direction lies in. Every `sentinel_step`-th target is traced whatever the guess says (0: none): a patch
    of light is small, and the points around a thin shadow can agree on all of it. For a point with three informers it
    is every `weak_step`-th, with two every `weakest_step`-th. doubt_step: in the last step of the picture only every so
    many of those targets are traced that three of four points see (0: all). rotating: other points trace other targets
    than every such, and all of them are somebody's. bright (D,) bool: targets that every point traces, whatever others
    guess: so much light comes from each that no mistake is small; None: none.
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
        # Read alone, as the sphere's are: kernels would be compiled anew for those that may be written.
        neighbours = self.neighbours.view()
        neighbours.flags.writeable = False
        object.__setattr__(self, "neighbours", neighbours)

    @property
    def n_words(self) -> int:
        return (len(self.positions) + 63) // 64

    @cached_property
    def cones(self) -> np.ndarray:
        """Axis and sine of the radius, with room for rounding, of each sixteen directions in a row: (G, 4) float32.

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
        """Packed bits (words,) of the bright ones."""
        marked = np.zeros(64 * self.n_words, np.uint8)
        if self.bright is not None:
            marked[: len(self.bright)] = self.bright
        return np.packbits(marked, bitorder="little").view(np.uint64)

    def sentinels(self, step: int) -> np.ndarray:
        """Packed bits (S, words) of every step-th target: of a sphere, for a power of four, the middle ones.

        Where they rotate, the S = step ways of choosing them, or none for step = 0.
        """
        marked = np.zeros((step if self.rotating and step else 1, 64 * self.n_words), np.uint8)
        for turn in range(len(marked) if step else 0):
            marked[turn, (step - 1 + turn) % step : len(self.positions) : step] = 1
        return np.packbits(marked, axis=1, bitorder="little").view(np.uint64)


def sphere_targets(level: int) -> Targets:
    """The triangle centres of one geodesic level, flooding across edges."""
    sphere = geodesic(level)
    centres = np.ascontiguousarray(sphere.centres, np.float32)
    return Targets(
        centres, np.zeros_like(centres), sphere.neighbours,
        weak_step=WEAK_STEP, weakest_step=WEAKEST_STEP, doubt_step=DOUBT_STEP,
    )  # fmt: skip
