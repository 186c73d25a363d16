"""Lights placed in the picture by what they do there (`engine.scene.light_placement`).

With H held, a click on a surface puts the selected light where the camera sees its highlight there, and a drag slides
it. With J held, a drag begins at a point that is to cast a shadow, and goes on to where this is to fall.
"""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.commands.poses import SetTransform
from app.document.commands.suns import SetSun, turned
from app.document.selection import selected_sun
from engine.light.suns import Sun
from engine.scene.description import Camera
from engine.scene.light_placement import PlacedLight, mirror_direction, shadow_direction
from engine.scene.transform import Transform
from ui.panels.actions import Action, BeginDrag, HoldGrip
from ui.panels.context import PanelContext
from ui.panels.window_state import LightGrip
from ui.scene_view import SurfaceSpot

HIGHLIGHT, SHADOW = imgui.Key.h, imgui.Key.j


def is_placing(context: PanelContext) -> bool:
    """Whether one of the keys is held, and a light is selected."""
    is_held = imgui.is_key_down(HIGHLIGHT) or imgui.is_key_down(SHADOW)
    has_light = _selected_light(context) is not None or selected_sun(context.document, context.view) is not None
    return is_held and not context.keys_taken and has_light


def begin(context: PanelContext, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse was pressed at a pixel of the picture."""
    sun, spot = selected_sun(context.document, context.view), None if pixel is None else context.spot_at(*pixel)
    name = _selected_light(context) if sun is None else sun.name
    if name is None or spot is None:
        return []
    start = context.document.object(name).transform if sun is None else Transform()
    if imgui.is_key_down(HIGHLIGHT):
        grip = LightGrip("light", (0.0, 0.0), name, start)
        return [BeginDrag(f"place {name} by its highlight"), HoldGrip(grip), *go_on(context, grip, pixel)]
    x, y, z = spot.place.tolist()
    return [BeginDrag(f"place {name} by a shadow"), HoldGrip(LightGrip("light", (0.0, 0.0), name, start, (x, y, z)))]


def go_on(context: PanelContext, grip: LightGrip, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse is at a pixel now; nothing where no surface is seen there."""
    spot, sun = None if pixel is None else context.spot_at(*pixel), selected_sun(context.document, context.view)
    if spot is not None and sun is not None:
        aimed = sun_placement(sun, context.document.light.rotation, spot, context.camera, grip.caster)
        return [] if aimed is None else [aimed]
    box = None if sun is not None else context.resting_box_of(grip.light)
    if spot is None or box is None:
        return []
    light = PlacedLight(box.mean(axis=0), context.facing_of(grip.light), grip.start)
    command = placement(grip.light, light, spot, context.camera, grip.caster)
    is_there = command.apply(context.document) == context.document
    return [] if is_there else [command]


def placement(
    name: str, light: PlacedLight, spot: SurfaceSpot, camera: Camera, caster: tuple[float, float, float] | None
) -> SetTransform:
    """The command that places a light by its highlight at a surface, or by the shadow of `caster` that falls there."""
    if caster is None:
        after = light.by_highlight(spot.place, spot.normal, camera.position)
    else:
        after = light.by_shadow(caster, spot.place)
    return SetTransform(name, after.translation, after.rotation)


def sun_placement(
    sun: Sun, rotation: float, spot: SurfaceSpot, camera: Camera, caster: tuple[float, float, float] | None
) -> SetSun | None:
    """The same of a sun, of which only the direction follows; None where there is none, or it stands there already.
    rotation: of the light, degrees."""
    if caster is None:
        towards = mirror_direction(spot.place, spot.normal, camera.position)
    else:
        towards = shadow_direction(caster, spot.place)
    if towards is None:
        return None
    x, y, z = towards.tolist()
    direction = turned((x, y, z), -rotation)
    return None if direction == sun.direction else SetSun(sun.name, "direction", direction)


def _selected_light(context: PanelContext) -> str | None:
    """The name of the selected object, where it shines."""
    selected = context.view.selected
    return selected.object if selected is not None and context.document.object(selected.object).emits else None
