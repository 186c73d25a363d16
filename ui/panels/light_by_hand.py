"""Lights placed in the picture by what they do there (`engine.scene.light_placement`).

With H held, a click on a surface puts the selected light where the camera sees its highlight there, and a drag slides
it. With J held, a drag begins at a point that is to cast a shadow, and goes on to where this is to fall. Painted lights
are placed in the same way: their middle goes to the direction in which the light is seen, or comes from.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from app.document.commands.painted import SetPainted, painted_towards
from app.document.commands.poses import SetTransform
from app.document.commands.suns import SetSun, in_environment
from app.document.light_state import LightState
from app.document.selection import selected_sun
from engine.light.suns import Sun
from engine.scene.description import Camera
from engine.scene.light_placement import PlacedLight, mirror_direction, shadow_direction
from engine.scene.transform import Transform
from ui.panels.actions import Action, BeginDrag, HoldGrip
from ui.panels.context import PanelContext
from ui.panels.window_state import LightGrip, PaintedGrip
from ui.scene_view import SurfaceSpot

HIGHLIGHT, SHADOW = imgui.Key.h, imgui.Key.j
Point = tuple[float, float, float]


def is_placing(context: PanelContext) -> bool:
    """Whether one of the keys is held, and a light is selected."""
    is_held = imgui.is_key_down(HIGHLIGHT) or imgui.is_key_down(SHADOW)
    lights = context.painted, selected_sun(context.document, context.view), _selected_light(context)
    has_light = any(light is not None for light in lights)
    return is_held and not context.keys_taken and has_light


def begin(context: PanelContext, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse was pressed at a pixel of the picture."""
    sun, spot = selected_sun(context.document, context.view), None if pixel is None else context.spot_at(*pixel)
    chosen = context.painted or sun
    name = _selected_light(context) if chosen is None else chosen.name
    if name is None or spot is None:
        return []
    x, y, z = spot.place.tolist()
    caster = None if imgui.is_key_down(HIGHLIGHT) else (x, y, z)
    grip: LightGrip | PaintedGrip
    if context.painted is not None:
        grip = PaintedGrip("light", (0.0, 0.0), name, caster=caster)
    else:
        start = context.document.object(name).transform if sun is None else Transform()
        grip = LightGrip("light", (0.0, 0.0), name, start, caster)
    if caster is None:
        return [BeginDrag(f"place {name} by its highlight"), HoldGrip(grip), *go_on(context, grip, pixel)]
    return [BeginDrag(f"place {name} by a shadow"), HoldGrip(grip)]


def go_on(context: PanelContext, grip: LightGrip | PaintedGrip, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse is at a pixel now; nothing where no surface is seen there."""
    spot, sun = None if pixel is None else context.spot_at(*pixel), selected_sun(context.document, context.view)
    if spot is None:
        return []
    command: SetTransform | SetPainted | SetSun | None
    if isinstance(grip, PaintedGrip):
        command = painted_placement(context.document.light, grip.light, spot, context.camera, grip.caster)
    elif sun is not None:
        command = sun_placement(sun, context.document.light, spot, context.camera, grip.caster)
    else:
        box = context.resting_box_of(grip.light)
        light = None if box is None else PlacedLight(box.mean(axis=0), context.facing_of(grip.light), grip.start)
        command = None if light is None else placement(grip.light, light, spot, context.camera, grip.caster)
    is_there = command is None or command.apply(context.document) == context.document
    return [] if command is None or is_there else [command]


def placement(name: str, light: PlacedLight, spot: SurfaceSpot, camera: Camera, caster: Point | None) -> SetTransform:
    """The command that places a light by its highlight at a surface, or by the shadow of `caster` that falls there."""
    if caster is None:
        after = light.by_highlight(spot.place, spot.normal, camera.position)
    else:
        after = light.by_shadow(caster, spot.place)
    return SetTransform(name, after.translation, after.rotation)


def sun_placement(
    sun: Sun, light: LightState, spot: SurfaceSpot, camera: Camera, caster: Point | None
) -> SetSun | None:
    """The same of a sun, of which only the direction follows; None where there is none, or it stands there already."""
    towards = _direction(spot, camera, caster)
    if towards is None:
        return None
    x, y, z = towards.tolist()
    direction = in_environment((x, y, z), light)
    return None if direction == sun.direction else SetSun(sun.name, "direction", direction)


def painted_placement(
    light: LightState, name: str, spot: SurfaceSpot, camera: Camera, caster: Point | None
) -> SetPainted | None:
    """The same of a painted light; None where a surface is seen from behind, or nothing lies between two points."""
    direction = _direction(spot, camera, caster)
    return None if direction is None else painted_towards(light, name, direction)


def _direction(spot: SurfaceSpot, camera: Camera, caster: Point | None) -> NDArray[np.float64] | None:
    if caster is None:
        return mirror_direction(spot.place, spot.normal, camera.position)
    return shadow_direction(caster, spot.place)


def _selected_light(context: PanelContext) -> str | None:
    """The name of the selected object, where it shines."""
    selected = context.view.selected
    return selected.object if selected is not None and context.document.object(selected.object).emits else None
