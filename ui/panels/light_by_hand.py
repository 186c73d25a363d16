"""Lights placed in the picture by what they do there (`engine.scene.light_placement`).

With H held, a click on a surface puts the selected light where the camera sees its highlight there, and a drag slides
it. With J held, a drag begins at a point that is to cast a shadow, and goes on to where this is to fall.
"""

from __future__ import annotations

from imgui_bundle import imgui

from app.document.commands.poses import SetTransform
from engine.scene.description import Camera
from engine.scene.light_placement import PlacedLight
from ui.panels.actions import Action, BeginDrag, HoldGrip
from ui.panels.context import PanelContext
from ui.panels.window_state import LightGrip
from ui.scene_view import SurfaceSpot

HIGHLIGHT, SHADOW = imgui.Key.h, imgui.Key.j


def is_placing(context: PanelContext) -> bool:
    """Whether one of the keys is held, and a light is selected."""
    is_held = imgui.is_key_down(HIGHLIGHT) or imgui.is_key_down(SHADOW)
    return is_held and not context.keys_taken and _selected_light(context) is not None


def begin(context: PanelContext, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse was pressed at a pixel of the picture."""
    name, spot = _selected_light(context), None if pixel is None else context.spot_at(*pixel)
    if name is None or spot is None:
        return []
    start = context.document.object(name).transform
    if imgui.is_key_down(HIGHLIGHT):
        grip = LightGrip("light", (0.0, 0.0), name, start)
        return [BeginDrag(f"place {name} by its highlight"), HoldGrip(grip), *go_on(context, grip, pixel)]
    x, y, z = spot.place.tolist()
    return [BeginDrag(f"place {name} by a shadow"), HoldGrip(LightGrip("light", (0.0, 0.0), name, start, (x, y, z)))]


def go_on(context: PanelContext, grip: LightGrip, pixel: tuple[int, int] | None) -> list[Action]:
    """The mouse is at a pixel now; nothing where no surface is seen there."""
    spot, box = None if pixel is None else context.spot_at(*pixel), context.resting_box_of(grip.light)
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


def _selected_light(context: PanelContext) -> str | None:
    """The name of the selected object, where it shines."""
    selected = context.view.selected
    return selected.object if selected is not None and context.document.object(selected.object).emits else None
