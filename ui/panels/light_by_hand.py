"""Lights placed in the picture by what they do there (`engine.scene.light_placement`).

With H held, a click on a surface puts the selected light where the camera sees its highlight there, and a drag slides
it. With J held, a drag begins at a point that is to cast a shadow, and goes on to where this is to fall. Painted lights
are placed in the same way: their middle goes to the direction in which the light is seen, or comes from.
"""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.light_placing import LightAim, Placing, place_lamp, place_painted, place_sun
from app.document.selection import selected_sun
from engine.scene.light_placement import PlacedLight
from engine.scene.transform import Transform
from ui.panels.actions import Action, BeginDrag, HoldGrip, TracePath
from ui.panels.context import PanelContext
from ui.panels.window_state import LightGrip, PaintedGrip

HIGHLIGHT, SHADOW = imgui.Key.h, imgui.Key.j


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
    thrower = "" if caster is None or pixel is None else context.object_at(*pixel) or ""
    grip: LightGrip | PaintedGrip
    if context.painted is not None:
        grip = PaintedGrip("light", (0.0, 0.0), name, caster=caster, caster_object=thrower)
    else:
        start = context.document.object(name).transform if sun is None else Transform()
        grip = LightGrip("light", (0.0, 0.0), name, start, caster, thrower)
    if caster is None:
        return [BeginDrag(f"place {name} by its highlight"), HoldGrip(grip), *go_on(context, grip, pixel)]
    return [BeginDrag(f"place {name} by a shadow"), HoldGrip(grip)]


def go_on(context: PanelContext, grip: LightGrip | PaintedGrip, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse is at a pixel now; nothing where no surface is seen there."""
    placing = _placing(context, grip, pixel)
    if placing is None:
        return []
    command, path = placing
    if command is None or command.apply(context.document) == context.document:
        return []
    return [command, TracePath(path)]


def end(context: PanelContext, grip: LightGrip | PaintedGrip, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse was released at a pixel: what keeps the light from doing what it is placed for is shown."""
    placing = _placing(context, grip, pixel)
    return [] if placing is None else [TracePath(placing[1])]


def _placing(context: PanelContext, grip: LightGrip | PaintedGrip, pixel: tuple[int, int] | None) -> Placing | None:
    spot, sun = None if pixel is None else context.spot_at(*pixel), selected_sun(context.document, context.view)
    if spot is None:
        return None
    aim, light = LightAim(spot, context.camera, grip.caster, grip.caster_object), context.document.light
    if isinstance(grip, PaintedGrip):
        return place_painted(light, grip.light, aim)
    if sun is not None:
        return place_sun(sun, light, aim)
    box = context.resting_box_of(grip.light)
    if box is None:
        return None
    return place_lamp(grip.light, PlacedLight(box.mean(axis=0), context.facing_of(grip.light), grip.start), aim)


def _selected_light(context: PanelContext) -> str | None:
    """The name of the selected object, where it shines."""
    selected = context.view.selected
    return selected.object if selected is not None and context.document.object(selected.object).emits else None
