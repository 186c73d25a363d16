"""Lights placed by what they do in the picture: lamps, suns and painted lights, by a highlight or by a shadow.

Each function returns the command that places the light, None where it stays where it is, and the way that its light
takes then (`engine.scene.light_paths`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.document.commands.painted import SetPainted, painted_towards, place_of
from app.document.commands.poses import SetTransform
from app.document.commands.suns import SetSun, in_environment
from app.document.document import Document
from app.document.light_state import LightState, sun_key
from app.document.targets import PAINTED
from engine.core.errors import InsituError
from engine.light.suns import Sun
from engine.scene.description import Camera
from engine.scene.light_paths import LightPath, Point
from engine.scene.light_placement import PlacedLight
from engine.scene.surface_spot import SurfaceSpot

Placing = tuple[SetTransform | SetPainted | SetSun | None, LightPath]


@dataclass(frozen=True, eq=False)
class LightAim:
    """What a light is placed for: the spot at which the camera is to see its highlight, or on which the shadow of
    `caster`, a point of the object `caster_object`, is to fall."""

    spot: SurfaceSpot
    camera: Camera
    caster: Point | None = None
    caster_object: str = ""

    def path(self, light: str, reach: float = np.inf) -> LightPath:
        """The way of a light so far away."""
        point, normal, eye = map(_point, (self.spot.place, self.spot.normal, self.camera.position))
        return LightPath(light, point, normal, eye, reach, self.caster, self.caster_object)


def place_lamp(name: str, light: PlacedLight, aim: LightAim) -> Placing:
    """Of a lamp as it stands."""
    if aim.caster is None:
        after = light.by_highlight(aim.spot.place, aim.spot.normal, aim.camera.position)
    else:
        after = light.by_shadow(aim.caster, aim.spot.place)
    end = aim.spot.place if aim.caster is None else np.array(aim.caster)
    command = SetTransform(name, after.translation, after.rotation)
    return command, aim.path(name, float(np.linalg.norm(light.centre - end)))


def place_sun(sun: Sun, light: LightState, aim: LightAim) -> Placing:
    """Of a sun, of which only the direction follows."""
    path = aim.path(sun.name)
    if path.towards is None:
        return None, path
    direction = in_environment(_point(path.towards), light)
    return None if direction == sun.direction else SetSun(sun.name, "direction", direction), path


def place_painted(light: LightState, name: str, aim: LightAim) -> Placing:
    """Of a painted light, or of a sky's sun."""
    path = aim.path(name)
    return None if path.towards is None else painted_towards(light, name, path.towards), path


def place_named(
    document: Document, name: str, lamp_of: Callable[[str], PlacedLight | None], aim: LightAim
) -> Placing:  # fmt: skip
    """Of the light that a script names: an object, a sun, also as `light.Noon`, or `painted.Key`. lamp_of: an object as
    a light, None where it has no place. Raises InsituError."""
    if name.startswith(f"{PAINTED}."):
        painted = name.removeprefix(f"{PAINTED}.")
        place_of(document, painted)  # says which there are
        return place_painted(document.light, painted, aim)
    is_object = any(state.name == name for state in document.objects)
    sun = next((each for each in document.light.suns if name in (each.name, sun_key(each.name))), None)
    if sun is not None and not is_object:
        return place_sun(sun, document.light, aim)
    lamp = lamp_of(name) if document.object(name).emits else None
    if lamp is None:
        raise InsituError(f"place_light: {name} is no light that has a place")
    return place_lamp(name, lamp, aim)


def _point(values: object) -> Point:
    x, y, z = np.asarray(values, np.float64).tolist()
    return x, y, z
