"""A mesh in a pose: a sequence of deformers and a transform, and the axes that its points get [Sloan05, 5].

The Jacobian of the whole sequence, by the chain rule, transforms tangents; its cofactors transform normals and need no
inverse: where space collapses, a point keeps as much of its axes as possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.errors import InsituError
from engine.core.threads import even_parts, on_threads
from engine.light.cones import Cone
from engine.realtime.deformers import KINDS
from engine.scene.transform import Transform

Float64Array = NDArray[np.float64]

MAX_GROWTH = 1000.0
_SIDES = 9  # sample points along each edge of a cube
# Indices of the horizontal axis, the deformer's axis and the depth axis.
AXES = {"x": (1, 0, 2), "y": (0, 1, 2), "z": (0, 2, 1)}


@dataclass(frozen=True)
class Deformation:
    """An applied deformer: its kind's name, the amount, and the axis of the object that it acts along: x, y or z."""

    kind: str
    amount: float
    axis: str = "y"

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"deformer {self.kind!r}, expected one of {', '.join(KINDS)}")
        low, high = KINDS[self.kind].limits
        if not low <= self.amount <= high:
            raise ValueError(f"{self.kind} {self.amount:g}, expected {low:g} to {high:g}")
        if self.axis not in AXES:
            raise ValueError(f"axis {self.axis!r}, expected one of x, y, z")

    @property
    def is_identity(self) -> bool:
        """Whether it deforms nothing."""
        return self.amount == 0.0


@dataclass(frozen=True)
class Moment:
    """A time, in seconds, of an animation from the object's file; beyond its ends it repeats."""

    clip: str
    time: float

    def __post_init__(self) -> None:
        if not isfinite(self.time):
            raise ValueError(f"time {self.time:g}, expected a finite number of seconds")

    @property
    def is_identity(self) -> bool:
        """Never: the pose of the file may be that of no time."""
        return False


# The steps that pose an object, in order: at most one moment comes first, at most one transform last, and before that,
# of a lamp, the cone that it has instead of its file's.
Motion = tuple[Moment | Deformation | Cone | Transform, ...]
Poses = tuple[tuple[str, Motion], ...]  # by object name


def without_identity(poses: Sequence[tuple[str, Motion]]) -> Poses:
    """Remove what moves nothing: deformers of amount 0, identity transforms, and objects without others."""
    rows = ((name, tuple(each for each in row if not each.is_identity)) for name, row in poses)
    return tuple((name, row) for name, row in rows if row)


@dataclass(frozen=True, eq=False)
class Pose:
    """Points (V, 3) and their axes, rows tangent, bitangent, normal (V, 3, 3)."""

    positions: Float64Array
    frames: Float64Array

    @cached_property
    def box(self) -> Float64Array:
        """Bounding box: minimum and maximum (2, 3)."""
        return np.stack([self.positions.min(axis=0), self.positions.max(axis=0)])


def deform(pose: Pose, deformations: Sequence[Deformation], box: Float64Array | None = None) -> Pose:
    """Apply deformers one after another, each in the same box (2, 3): the resting mesh's, or None for the pose's
    own."""
    if not deformations:
        return pose
    from engine.realtime.zonal_harmonics import _pose_kernels as kernels

    low, high = pose.box if box is None else box
    positions, jacobians = np.array(pose.positions, np.float64), np.tile(np.eye(3), (len(pose.positions), 1, 1))

    def part(start: int, stop: int) -> None:
        own = positions[start:stop], jacobians[start:stop]
        for deformation in deformations:
            axes = np.array(AXES[deformation.axis])
            foot, height = (low + high) / 2.0, float(high[axes[1]] - low[axes[1]])
            if not height > 0.0:
                continue  # flat along that axis: nothing can bend
            foot[axes[1]] = low[axes[1]]
            moved, jacobian = KINDS[deformation.kind].move((own[0] - foot)[:, axes] / height, deformation.amount)
            kernels.chain_range(0, stop - start, moved, jacobian, axes, foot, height, *own)

    on_threads(part, *even_parts(len(positions)))
    return Pose(positions, deformed_frames(pose.frames, jacobians))


def transformed(pose: Pose, transform: Transform, pivot: Float64Array) -> Pose:
    """Apply a transform about a pivot (3,)."""
    linear = transform.linear
    positions = (pose.positions - pivot) @ linear.T + (pivot + transform.translation)
    return Pose(positions, deformed_frames(pose.frames, np.broadcast_to(linear, pose.frames.shape)))


def largest_growth(deformations: Sequence[Deformation]) -> float:
    """Largest factor by which deformers, applied one after another, lengthen a unit cube along an axis."""
    places = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, _SIDES)] * 3), axis=-1).reshape(-1, 3)
    moved = deform(Pose(places, np.broadcast_to(np.eye(3), (len(places), 3, 3))), deformations)
    return float(np.ptp(moved.positions, axis=0).max())


def check_extent(name: str, positions: Float64Array, most: float) -> None:
    """Raise InsituError if an object, by name, extends beyond so many metres in a pose."""
    extent = float(np.abs(positions).max(initial=0.0))
    if not extent <= most:
        raise InsituError(f"{name}: reaches {extent:.3g} m in this pose, expected at most {most:g} m")


def deformed_frames(frames: ArrayLike, jacobians: ArrayLike) -> Float64Array:
    """Axes (V, 3, 3), rows tangent, bitangent, normal, after maps with these Jacobians (V, 3, 3).

    The normal stays perpendicular to the surface, on its outer side; the tangent stays as close to its image as
    possible.
    """
    from engine.realtime.zonal_harmonics import _pose_kernels as kernels

    frames, jacobians = (np.require(each, np.float64, ["C", "W"]) for each in (frames, jacobians))
    out = np.empty(frames.shape)
    on_threads(
        lambda start, stop: kernels.deformed_frames_range(start, stop, frames, jacobians, out), *even_parts(len(out))
    )
    return out
