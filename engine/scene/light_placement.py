"""Lights placed by what they do in the picture: by their highlight, or by a shadow.

A light at c is seen by the eye e as mirrored in a surface at p, with unit normal n, where c lies on the ray

    p + s r ,   r = d - 2 (d . n) n ,   d = (p - e) / |p - e| ,

and the shadow of a point a falls on b where c lies on the ray from b through a, beyond a. Either way the light stays as
far from p, or from a, as it was, and shines towards it. A sun is at no distance: it stands in the sky where r, or the
direction from b to a, points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.scene.description import ObjectDescription
from engine.scene.transform import Transform, rotation_degrees, rotation_matrix

Float64Array = NDArray[np.float64]

_NEAREST = 1e-6  # metres
_FLAT = ("quad", "disc")


@dataclass(frozen=True, eq=False)
class PlacedLight:
    """A light as it stands. pivot (3,): the centre of its box where its file has it; facing (3,): the direction that it
    shines to there, None where it shines alike to all sides; transform: by which it was moved from there."""

    pivot: Float64Array
    facing: Float64Array | None
    transform: Transform

    @property
    def centre(self) -> Float64Array:
        """Where it is now (3,)."""
        return self.pivot + self.transform.translation

    def by_highlight(self, point: ArrayLike, normal: ArrayLike, eye: ArrayLike) -> Transform:
        """The transform with which the eye sees it mirrored at a point of a surface; the present one where the surface
        is seen from behind."""
        direction = mirror_direction(point, normal, eye)
        return self.transform if direction is None else self._towards(np.asarray(point, np.float64), direction)

    def by_shadow(self, caster: ArrayLike, receiver: ArrayLike) -> Transform:
        """The transform with which the shadow of one point falls on another; the present one where they are one."""
        direction = shadow_direction(caster, receiver)
        return self.transform if direction is None else self._towards(np.asarray(caster, np.float64), direction)

    def aimed_at(self, point: ArrayLike) -> Transform:
        """The transform with which it shines towards a point from where it is: turned no further than that takes; the
        present one where it shines to all sides, or the point is where it is."""
        direction = _unit(np.asarray(point, np.float64) - self.centre)
        if self.facing is None or direction is None:
            return self.transform
        turned = rotation_matrix(self.transform.rotation)
        turned = rotation_between(turned @ self.facing, direction) @ turned
        return replace(self.transform, rotation=rotation_degrees(turned))

    def _towards(self, point: Float64Array, direction: Float64Array) -> Transform:
        """As far from a point as now, in a unit direction from it, shining towards it."""
        distance = max(float(np.linalg.norm(self.centre - point)), _NEAREST)
        x, y, z = (point + distance * direction - self.pivot).tolist()
        moved = replace(self.transform, translation=(x, y, z))
        if self.facing is None:
            return moved
        turned = rotation_matrix(self.transform.rotation)
        turned = rotation_between(turned @ self.facing, -direction) @ turned
        return replace(moved, rotation=rotation_degrees(turned))


def mirror_direction(point: ArrayLike, normal: ArrayLike, eye: ArrayLike) -> Float64Array | None:
    """The unit direction (3,) that an eye sees mirrored at a point of a surface with this unit normal; None where the
    surface is seen from behind."""
    normal = np.asarray(normal, np.float64)
    seen = _unit(np.asarray(point, np.float64) - np.asarray(eye, np.float64))
    return None if seen is None or seen @ normal >= 0.0 else seen - 2.0 * (seen @ normal) * normal


def shadow_direction(caster: ArrayLike, receiver: ArrayLike) -> Float64Array | None:
    """The unit direction (3,) from which light throws the shadow of one point on another; None where they are one."""
    return _unit(np.asarray(caster, np.float64) - np.asarray(receiver, np.float64))


def facing_of(described: ObjectDescription) -> Float64Array | None:
    """The direction (3,) that a lamp shines to where its file has it: that of a flat one, or the axis of its cone; None
    for one that shines to all sides, and for what does not shine."""
    if not described.emits:
        return None
    return front_of(described.primitive, described.cone is not None, np.reshape(described.transform, (4, 4))[:3, :3])


def front_of(primitive: str | None, has_cone: bool, linear: NDArray[np.floating]) -> Float64Array | None:
    """The direction (3,) of the front of a lamp, its +Z, under the linear part (3, 3) of its matrix: of a flat one or a
    spot; None for one that shines to all sides."""
    return _unit(linear[:, 2].astype(np.float64)) if primitive in _FLAT or has_cone else None


def rotation_between(start: Float64Array, end: Float64Array) -> Float64Array:
    """The least rotation (3, 3) that turns one unit vector into another; half a turn about some axis where they are
    opposite."""
    axis, cosine = np.cross(start, end), float(start @ end)
    if cosine < -1.0 + 1e-12:
        across = np.cross(start, np.eye(3)[int(np.abs(start).argmin())])
        across /= np.linalg.norm(across)
        return 2.0 * np.outer(across, across) - np.eye(3)
    # R = I + [a]x + [a]x² / (1 + cos) with the axis a of length sin.
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + cosine))


def _unit(vector: Float64Array) -> Float64Array | None:
    """The direction of a vector; None where it has none."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > _NEAREST else None
