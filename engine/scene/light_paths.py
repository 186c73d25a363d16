"""What becomes of a light that was placed by its highlight or by a shadow (`engine.scene.light_placement`): whether it
reaches the point that it was placed for, found by a few rays.

The light's own surface hides nothing, wherever the traced scene still has it, and neither does what is to throw the
shadow.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.scene.light_placement import mirror_direction, shadow_direction

if TYPE_CHECKING:
    from engine.scene.raycaster import RayCaster
    from engine.scene.scene_loader import Scene

Float64Array = NDArray[np.float64]
Point = tuple[float, float, float]

_LIFT = 1e-4  # of the distance from the camera, which the error of a point in single precision stays well below
_MOST_SURFACES = 64  # that a ray passes on its way
_AROUND = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])


@dataclass(frozen=True)
class LightPath:
    """The way of a placed light. light: its name; point, normal: of the surface at which its highlight is to be seen,
    or on which the shadow is to fall, on the camera's side; eye: the camera; reach: how far the light is from the point
    or the caster, metres, inf in the sky; caster: a point of what throws the shadow, None for a highlight, and the name
    of that."""

    light: str
    point: Point
    normal: Point
    eye: Point
    reach: float = np.inf
    caster: Point | None = None
    caster_object: str = ""

    @property
    def towards(self) -> Float64Array | None:
        """The unit direction (3,) from the point to the light; None where it cannot be placed so."""
        if self.caster is None:
            return mirror_direction(self.point, self.normal, self.eye)
        return shadow_direction(self.caster, self.point)


def describe_unplaced(path: LightPath) -> str:
    """Why a light cannot be placed so, and stays where it is."""
    if path.caster is None:
        return f"{path.light} stays where it is: that surface is seen edge-on, and mirrors nothing to the camera"
    return f"{path.light} stays where it is: drag from what is to throw the shadow to where this is to fall"


def describe_light_path(path: LightPath, scene: Scene, rays: RayCaster) -> str:
    """What keeps the light from doing what it was placed for, in one line; "" where nothing does."""
    towards, light = path.towards, path.light
    if towards is None:
        return describe_unplaced(path)
    between = _Between(scene, rays)
    point, normal, eye = (np.array(each) for each in (path.point, path.normal, path.eye))
    start = point + _LIFT * float(np.linalg.norm(point - eye)) * normal
    if path.caster is None:
        return _describe_hidden(between, path, start, towards, path.reach, "that point")
    if towards @ normal <= 0.0:
        return f"{light} is placed, but the surface faces away from it there: no shadow falls on that point"
    caster = np.array(path.caster)
    way = float(np.linalg.norm(caster - point))
    nearer, _ = between.first(start, towards, way, (light, path.caster_object))
    if nearer:
        return f"{light} is placed, but {nearer} catches the shadow before that point"
    return _describe_hidden(between, path, caster, towards, path.reach, "what is to throw the shadow")


def _describe_hidden(
    between: _Between, path: LightPath, start: Float64Array, towards: Float64Array, reach: float, what: str
) -> str:
    """What is between a start and the light, so far away in a direction."""
    passed = (path.light, path.caster_object)
    hidden_by, _ = between.first(start, towards, reach, passed)
    if not hidden_by:
        return ""
    if np.isfinite(reach) and between.surrounds(start + reach * towards, -towards, hidden_by, passed):
        return f"{path.light} is placed, but inside {hidden_by}, which hides it from {what}"
    return f"{path.light} is placed, but {hidden_by} hides it from {what}"


@dataclass(frozen=True, eq=False)
class _Between:
    """What rays meet in a scene; points are those of the world."""

    scene: Scene
    rays: RayCaster

    def first(
        self, start: Float64Array, direction: Float64Array, reach: float, passed: Iterable[str]
    ) -> tuple[str, bool]:
        """The first object that a ray meets nearer than `reach`, of others than those it passes; "" for none. And
        whether it meets that from behind."""
        names, origin, way = self.scene.object_names, start - self.scene.origin, 0.0
        for _ in range(_MOST_SURFACES):
            found = self.rays.intersect(
                (origin + way * direction)[None].astype(np.float32), direction[None].astype(np.float32)
            )
            triangle, way = int(found.triangle[0]), way + float(found.distance[0])
            if triangle < 0 or way >= reach:
                break
            name = names[self.scene.object_of_triangle[triangle]]
            if name not in passed:
                return name, bool(self.scene.geometric_normals[triangle] @ direction > 0.0)
            way += max(self.rays.offset, 1e-6 * way)
        return "", False

    def surrounds(self, point: Float64Array, direction: Float64Array, name: str, passed: Iterable[str]) -> bool:
        """Whether a point is inside an object: it is met from behind in this direction, and first in all others."""
        if self.first(point, direction, np.inf, passed) != (name, True):
            return False
        return all(self.first(point, each, np.inf, passed)[0] == name for each in _AROUND)
