"""The transform by which an object is placed by hand: scale, rotation and translation about its pivot.

The pivot is the centre of the object's bounding box as the scene's file has it. A point p goes to

    p' = R S (p - pivot) + pivot + t ,   R = R_z R_y R_x

with the scale S along the axes of the world, the rotation first about X, then about Y, then about Z ("XYZ" in Blender),
and the translation t. Rejected: an object's own axes, which meshes that were modelled in place do not have. A rectangle
that shines has its own: of one that its file has askew S = A diag(s) A^T goes along the axes A of its sides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]
Triple = tuple[float, float, float]

# Metres, degrees, and factors that make no object vanish.
MOST_METRES, MOST_DEGREES, LEAST_SCALE, MOST_SCALE = 1e6, 36_000.0, 1e-3, 1e3
_NOWHERE = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
_POLE = 1e-9  # cosine of the angle about Y, below which X and Z are the same axis


@dataclass(frozen=True)
class Transform:
    """A placement by hand: translation in metres, rotation in degrees about X, then Y, then Z, and scale; axes: the
    rotation of the axes that the scale goes along, from those of the world. Raises ValueError outside their ranges."""

    translation: Triple = (0.0, 0.0, 0.0)
    rotation: Triple = (0.0, 0.0, 0.0)
    scale: Triple = (1.0, 1.0, 1.0)
    axes: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        ranges = ("translation", -MOST_METRES, MOST_METRES), ("rotation", -MOST_DEGREES, MOST_DEGREES), (
            "scale", LEAST_SCALE, MOST_SCALE
        ), ("axes", -MOST_DEGREES, MOST_DEGREES)  # fmt: skip
        for name, low, high in ranges:
            values = getattr(self, name)
            if len(values) != 3 or not all(low <= each <= high for each in values):
                found = ", ".join(f"{each:g}" for each in values)
                raise ValueError(f"{name} [{found}], expected three numbers from {low:g} to {high:g}")

    @property
    def is_identity(self) -> bool:
        """Whether it leaves an object where it is."""
        return (self.translation, self.rotation, self.scale) == _NOWHERE

    @property
    def linear(self) -> Float64Array:
        """R S, (3, 3)."""
        if not any(self.axes):
            return rotation_matrix(self.rotation) * np.array(self.scale)
        return self.own_axes * np.array(self.scale) @ rotation_matrix(self.axes).T

    @property
    def own_axes(self) -> Float64Array:
        """The directions that the scale goes along, as they are turned: the columns of (3, 3)."""
        turned = rotation_matrix(self.rotation)
        return turned @ rotation_matrix(self.axes) if any(self.axes) else turned

    def matrix(self, pivot: ArrayLike) -> Float64Array:
        """The affine transform (4, 4) about a pivot (3,)."""
        found, pivot = np.eye(4), np.asarray(pivot, np.float64)
        found[:3, :3] = self.linear
        found[:3, 3] = pivot + self.translation - self.linear @ pivot
        return found

    def moved_box(self, box: Float64Array) -> Float64Array:
        """The bounding box (2, 3) of a box (2, 3) that is moved about its centre."""
        if self.is_identity:
            return box
        centre, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
        extent = np.abs(self.linear) @ half
        return np.stack([centre + self.translation - extent, centre + self.translation + extent])

    def rotated(self, degrees: Sequence[float]) -> Transform:
        """The same, rotated further about the axes of the world, about X, then Y, then Z."""
        turned = rotation_matrix(degrees) @ rotation_matrix(self.rotation)
        return replace(self, rotation=rotation_degrees(turned))


def rotation_matrix(degrees: Sequence[float]) -> Float64Array:
    """R_z R_y R_x (3, 3) of angles (3,) in degrees."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ])  # fmt: skip


def rotation_degrees(matrix: ArrayLike) -> Triple:
    """The angles, in degrees, of a rotation (3, 3): about Y from -90 to 90; about Z 0 where X and Z are one axis."""
    m = np.asarray(matrix, np.float64)
    cosine = math.hypot(m[0, 0], m[1, 0])
    about_y = math.atan2(-m[2, 0], cosine)
    if cosine < _POLE:
        about_x, about_z = math.atan2(-m[1, 2], m[1, 1]), 0.0
    else:
        about_x, about_z = math.atan2(m[2, 1], m[2, 2]), math.atan2(m[1, 0], m[0, 0])
    x, y, z = (math.degrees(each) for each in (about_x, about_y, about_z))
    return x, y, z
