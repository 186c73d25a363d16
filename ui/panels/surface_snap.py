"""Surfaces under the mouse: what is moved stands on them, and lights are aimed at them.

A pixel's surface is that of the picture that was traced last. Where this shows what is being moved, or nothing, a level
plane goes on from what it stands on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.document.arranging import dropped_in
from app.document.commands.lamps import SetTarget
from engine.scene.arrangement import PlacedObject, box_of, middle_of, moved, stood_on
from engine.scene.light_placement import PlacedLight
from engine.scene.surface_spot import SurfaceSpot
from engine.scene.transform import rotation_matrix
from ui.panels.actions import Action
from ui.panels.arranging import Arranged, snaps_to
from ui.panels.context import PanelContext
from ui.panels.picture_handles import Place
from ui.panels.picture_overlays import has_moved

Float64Array = NDArray[np.float64]
UP = np.array([0.0, 1.0, 0.0])
_LEVEL = 0.02
_AT_ONE_PLACE = 1e-4  # metres: a light cannot be aimed at itself


def surface_under(arranged: Arranged, place: Place) -> SurfaceSpot | None:
    """The surface at a place on screen, of an object that is not being moved."""
    context, picture = arranged.context, arranged.context.picture
    pixel = None if picture is None or has_moved(context) else arranged.placed.pixel(*place, picture)
    if pixel is None or context.object_at(*pixel) in [each.name for each in arranged.objects]:
        return None
    return context.spot_at(*pixel)


def stand_under(arranged: Arranged, place: Place, moved_by: Place) -> list[Action]:
    """Let the objects stand on what is at a place on screen, that of the mouse; where they snap to the ground, on what
    is below them after a move by so many pixels of the screen."""
    if snaps_to(arranged.context, "ground"):
        return _stand_on_ground(arranged, moved_by)
    spot = surface_under(arranged, place)
    if spot is not None:
        point, normal = spot.place, spot.normal
    else:
        foot = middle_of(arranged.objects) * (1.0, 0.0, 1.0) + box_of(arranged.objects)[0] * UP
        met = arranged.on_plane(place, foot, UP)
        if met is None:
            return []
        point, normal = met, UP
    try:
        return arranged.to(stood_on(arranged.start, point, normal, arranged.context.state.aligns), "move")
    except ValueError:
        return []


def _stand_on_ground(arranged: Arranged, by: Place) -> list[Action]:
    """Move what they stood on by pixels of the screen in its level plane, and them down to, or up to, what is below
    them there."""
    context, foot = arranged.context, middle_of(arranged.start) * (1.0, 0.0, 1.0) + box_of(arranged.start)[0] * UP
    first = arranged.place_of(foot)
    met = None if first is None else arranged.on_plane((first[0] + by[0], first[1] + by[1]), foot, UP)
    if met is None:
        return []
    try:
        there = moved(arranged.start, (met - foot) * (1.0, 0.0, 1.0))
        return arranged.to(dropped_in(context.document, there, context.resting_box_of), "move")
    except ValueError:
        return []


def can_aim(arranged: Arranged) -> bool:
    """Whether the active object is a light that shines in a direction."""
    return arranged.context.facing_of(arranged.active.name) is not None


def target_of(context: PanelContext, light: PlacedObject) -> Float64Array | None:
    """The point (3,) that a light is aimed at: the one that was chosen, or where its axis meets the ground, or else as
    far away as the scene's middle; None for a light that shines to all sides."""
    state, facing, box = context.document.object(light.name), context.facing_of(light.name), context.box_of(None)
    if state.lamp is not None and state.target_distance is not None:
        return state.lamp.target(light.transform, state.target_distance)
    if facing is None:
        return None
    axis, centre = rotation_matrix(light.transform.rotation) @ facing, light.centre
    if box is None:
        return np.asarray(centre + axis)
    height = float(centre[1] - box[0][1])
    if axis[1] < -_LEVEL and height > 0.0:
        return np.asarray(centre - axis * (height / axis[1]))
    return np.asarray(centre + axis * max(float(np.linalg.norm(box.mean(axis=0) - centre)), 1e-3))


def aim_under(arranged: Arranged, place: Place) -> list[Action]:
    """Aim the active light at what is under the mouse."""
    context, light = arranged.context, arranged.start[-1]
    spot, target = surface_under(arranged, place), target_of(context, arranged.active)
    if target is None:
        return []
    if spot is not None:
        point = spot.place
    elif (met := arranged.on_plane(place, target, UP)) is not None:
        point = met
    else:
        eye = np.array(context.camera.position)
        point = eye + arranged.ray_to(place) * float(np.linalg.norm(target - eye))
    if context.document.object(light.name).lamp is not None:
        x, y, z = point.tolist()
        command = SetTarget(light.name, (x, y, z), light.transform)
        return [] if np.linalg.norm(point - light.centre) < _AT_ONE_PLACE else [command]
    aimed = PlacedLight(light.pivot, context.facing_of(light.name), light.transform).aimed_at(point)
    return arranged.to((*arranged.start[:-1], replace(light, transform=aimed)), "aim")
