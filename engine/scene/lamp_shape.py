"""The shape of a lamp by numbers: the sides of a rectangle, the radius of a disc or a sphere, the cone of a spot, and
the point that it shines at.

A lamp stands where its file has it (a matrix about its centre), moved from there by a transform. Its sizes are those of
both, so that what scales the transform is seen here, and what is set here is a scale. The radiance stays: a lamp twice
as large gives more light.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.light.cones import Cone
from engine.scene.description import ObjectDescription, Primitive
from engine.scene.light_placement import PlacedLight, front_of
from engine.scene.transform import LEAST_SCALE, MOST_SCALE, Transform, rotation_degrees

Float64Array = NDArray[np.float64]

WIDTH, HEIGHT, RADIUS = "width", "height", "radius"
# The primitives that lamps have by numbers, which are 1 m large, and what of them can be set.
SIZES: Mapping[Primitive, tuple[str, ...]] = MappingProxyType(
    {"quad": (WIDTH, HEIGHT), "disc": (RADIUS,), "sphere": (RADIUS,)}
)
_ASKEW = 1e-6  # of a unit: the sine of angles that count as none
_LEVEL = 0.02  # the sine of the angle at which an axis meets the ground too far away


@dataclass(frozen=True)
class LampShape:
    """A lamp where its file has it: the primitive that it is, its matrix (4, 4) in rows, and the cone of a spot."""

    primitive: Primitive
    matrix: tuple[float, ...]
    cone: Cone | None = None

    @property
    def linear(self) -> Float64Array:
        """The linear part of its matrix (3, 3)."""
        return np.reshape(self.matrix, (4, 4))[:3, :3]

    @property
    def pivot(self) -> Float64Array:
        """Its centre where its file has it (3,)."""
        return np.reshape(self.matrix, (4, 4))[:3, 3]

    @property
    def facing(self) -> Float64Array | None:
        """The direction (3,) that it shines to there, None where it shines alike to all sides."""
        return front_of(self.primitive, self.cone is not None, self.linear)

    @property
    def sizes(self) -> tuple[str, ...]:
        """The names of the sizes that can be set: none of a rectangle that its file has sheared."""
        sides = _unit_columns(self.linear)
        is_sheared = self.primitive == "quad" and abs(float(sides[:, 0] @ sides[:, 1])) > 1e-3
        return () if is_sheared else SIZES[self.primitive]

    def size(self, name: str, transform: Transform) -> float:
        """One of its sizes in metres under a transform. A radius is that of the circle or the ball of the same area or
        volume."""
        lengths = np.linalg.norm(transform.linear @ self.linear, axis=0)
        if name in (WIDTH, HEIGHT):
            return float(lengths[(WIDTH, HEIGHT).index(name)])
        n = 2 if self.primitive == "disc" else 3
        return 0.5 * float(np.prod(lengths[:n]) ** (1.0 / n))

    def range_of(self, name: str, transform: Transform) -> tuple[float, float]:
        """The least and the largest size, metres, that the range of transforms allows."""
        if name in (WIDTH, HEIGHT):
            own = self.size(name, Transform())
            return LEAST_SCALE * own, MOST_SCALE * own
        now, scale = self.size(name, transform), transform.scale
        return LEAST_SCALE / min(scale) * now, MOST_SCALE / max(scale) * now

    def resized(self, name: str, metres: float, transform: Transform) -> Transform:
        """The transform with another size; its proportions stay where one number says how large it is. Raises
        ValueError outside the range."""
        low, high = self.range_of(name, transform)
        if not low * (1.0 - 1e-9) <= metres <= high * (1.0 + 1e-9):
            raise ValueError(f"{name} {metres:g} m, expected {low:.4g} m to {high:.4g} m")
        if name == RADIUS:
            factor = metres / self.size(name, transform)
            return replace(transform, scale=_triple(_clipped(factor * np.array(transform.scale))))
        k = (WIDTH, HEIGHT).index(name)
        sides, length = _frame(self.linear), float(np.linalg.norm(self.linear[:, k]))
        scale = np.array(transform.scale)
        along = np.abs(sides) > 1.0 - _ASKEW  # the world's axis (rows) that a side goes along (columns)
        if not any(transform.axes) and along.any(axis=0).all():
            scale[int(np.flatnonzero(along[:, k])[0])] = metres / length
            return replace(transform, scale=_triple(_clipped(scale)))
        # S goes along the sides from now on; so far it has made them as long as this.
        scale = np.linalg.norm(transform.linear @ sides, axis=0)
        scale[k] = metres / length
        return replace(transform, scale=_triple(_clipped(scale)), axes=rotation_degrees(sides))

    # ------------------------------------------------------------------------------------------------ what it shines at

    def axis(self, transform: Transform) -> Float64Array | None:
        """The unit direction (3,) that it shines to under a transform; None where it shines to all sides."""
        if self.facing is None:
            return None
        # A rotation keeps lengths; only it turns a light.
        return np.asarray(replace(transform, scale=(1.0, 1.0, 1.0)).linear @ self.facing)

    def target(self, transform: Transform, distance: float | None) -> Float64Array | None:
        """The point (3,) that it shines at, so many metres away; None: where its axis meets the ground at height 0, or
        1 m away where it does not. None for a light that shines to all sides."""
        axis, centre = self.axis(transform), self.pivot + transform.translation
        if axis is None:
            return None
        if distance is None:
            meets = axis[1] < -_LEVEL and centre[1] > 0.0
            distance = -float(centre[1] / axis[1]) if meets else 1.0
        return np.asarray(centre + distance * axis)

    def aimed_at(self, point: ArrayLike, transform: Transform) -> Transform:
        """The transform with which it shines at a point, see `PlacedLight`."""
        return PlacedLight(self.pivot, self.facing, transform).aimed_at(point)


def lamp_shape_of(described: ObjectDescription) -> LampShape | None:
    """The shape of an emitter that has one by numbers; None of any other object."""
    primitive = described.primitive
    if primitive is None or primitive not in SIZES or not described.emits:
        return None
    cone = None if described.cone is None else Cone(described.cone.inner, described.cone.outer)
    return LampShape(primitive, tuple(map(float, described.transform)), cone)


def _unit_columns(matrix: Float64Array) -> Float64Array:
    return matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)


def _frame(linear: Float64Array) -> Float64Array:
    """The rotation (3, 3) whose first two columns are the sides of a rectangle."""
    sides = _unit_columns(linear)
    return np.stack([sides[:, 0], sides[:, 1], np.cross(sides[:, 0], sides[:, 1])], axis=1)


def _clipped(scale: Float64Array) -> Float64Array:
    return np.clip(scale, LEAST_SCALE, MOST_SCALE)


def _triple(values: Float64Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
