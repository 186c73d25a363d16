"""The Light panel: the environment's picture with its rotation, a dial that rotates it, its strength, what is painted
on it, the mix, and what is seen behind all.

An environment from a file can be read as a lat-long or as an angular map; the default is guessed from its shape.

The picture is drawn in the world's frame: its middle is -Z, and it scrolls as the environment rotates. The marker shows
the camera's direction, so what is left of it lights the scene from the picture's left.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.document.background import BACKGROUND_KINDS
from app.document.commands.light import (
    BACKGROUND,
    BACKGROUND_COLOUR,
    CLAMP,
    CONTRAST,
    HUE,
    INTENSITY,
    MAPPING,
    ROTATION,
    TILT,
    SetBackground,
    SetBackgroundColour,
    SetEnvironment,
    SetIntensity,
    SetMapChange,
    SetMapping,
    SetRotation,
)
from app.document.light_mix import gains_of
from app.document.light_state import CONSTANT_ENVIRONMENT, SCENE_ENVIRONMENT
from engine.light.probe_mappings import MAPPINGS
from ui import theme as look
from ui.panels import light_mixer, painted_canvas, painted_lights, rows, widgets
from ui.panels.actions import Action, AskFile, BeginDrag, EndDrag, HoldGrip, MergedEdit, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_state import Travel, TurnGrip, WheelTurn

DIAL = 76.0
FULL_TURN = 360.0
DEGREES_A_NOTCH, FINE_DEGREES = 5.0, 0.5
# Turns of the mouse wheel with less than this between them are one step of the history.
PAUSE_SECONDS = 1.0
MAPPING_HINTS = (
    "The file is a panorama, twice as wide as high: azimuth across, elevation upright.",
    "The file is a light probe, a disc in a square: straight ahead in the middle, behind at the rim.",
    "The file is a picture of a mirroring ball that fills a square.",
    "The file is the six faces of a cube: a cross of 4 x 3 or 3 x 4 faces, or a column of six.",
)


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    actions: list[Action] = []
    gap = context.px(12)
    dial = context.px(DIAL)
    room = imgui.get_content_region_avail().x
    width = room - dial - gap
    height = min(0.5 * width, dial)
    start = imgui.get_cursor_pos_y()
    imgui.set_cursor_pos_y(start + 0.5 * (dial - height))
    actions += _thumbnail(context, 2.0 * height if 2.0 * height < width else width, height)
    imgui.same_line(0.0, gap)
    imgui.set_cursor_pos_y(start)
    actions += _dial(context, dial)
    actions += _environment(context)
    if context.document.light.is_file:
        actions += _mapping(context)
    light, own = context.document.light, context.scene_document.light
    for row in (
        rows.Row(ROTATION, light.rotation, SetRotation, "light.rotation", own.rotation),
        rows.Row(TILT, light.tilt, partial(SetMapChange, "tilt"), "light.tilt", own.tilt, origin=0.0),
        rows.Row(INTENSITY, light.intensity, SetIntensity, "light.intensity", own.intensity, origin=1.0),
    ):
        actions += rows.draw(context, row)
    actions += _map_changes(context) + painted_lights.draw(context)
    note = context.status.light_note or "lights"  # what is said during a drag takes the heading's place
    widgets.caption(note[:1].upper() + note[1:])
    actions += light_mixer.draw(context)
    imgui.spacing()
    return actions + _background(context)


def environment_label(environment: str) -> str:
    """An environment's name as it is shown."""
    if environment == SCENE_ENVIRONMENT:
        return "As in the scene"
    if environment == CONSTANT_ENVIRONMENT:
        return "Even white"
    path = Path(environment)
    return path.name if path.suffix else environment.replace("_", " ").replace("-", " ").capitalize()


def _environment(context: PanelContext) -> list[Action]:
    light = context.document.light
    names = [SCENE_ENVIRONMENT, *context.environments, CONSTANT_ENVIRONMENT]
    choices = [widgets.Choice(environment_label(name)) for name in names]
    choices.append(widgets.Choice("Open a file…", apart=True))
    chosen = [names.index(light.environment)] if light.environment in names else []
    hint = "The environment. EXR and HDR files may also be dropped on the window."
    widgets.label(context, "Environment")
    picked = widgets.choose(
        context, "light.environment", choices, chosen, hint, shown=environment_label(light.environment)
    )
    if picked is None:
        return []
    if picked == len(names):
        return [AskFile("open_environment")]
    radiance = (1.0, 1.0, 1.0) if names[picked] == CONSTANT_ENVIRONMENT else None
    return [SetEnvironment(names[picked], radiance=radiance)]


def _map_changes(context: PanelContext) -> list[Action]:
    """What changes the map as a whole, folded away at first."""
    is_open = imgui.tree_node_ex("Map###light.map", imgui.TreeNodeFlags_.frame_padding)
    context.handles.note_item("light.map")
    widgets.tooltip("Colours, contrast and brightest places of the environment's map.")
    if not is_open:
        return []
    actions: list[Action] = []
    for parameter, origin in ((HUE, 0.0), (CONTRAST, 1.0), (CLAMP, None)):
        value, own = (getattr(each.light, parameter.name) for each in (context.document, context.scene_document))
        shown = "none" if parameter is CLAMP and not value else ""
        make, handle = partial(SetMapChange, parameter.name), f"light.{parameter.name}"
        actions += rows.draw(context, rows.Row(parameter, value, make, handle, own, origin=origin, shown=shown))
    imgui.tree_pop()
    return actions


def _background(context: PanelContext) -> list[Action]:
    """What is seen behind all, and its colour where that is one."""
    background, own = context.document.background, context.scene_document.background
    widgets.label(context, BACKGROUND.label)
    choices = [widgets.Choice(title) for title in BACKGROUND.titles]
    chosen = [BACKGROUND_KINDS.index(background.kind)]
    picked = widgets.choose(context, "light.background", choices, chosen, BACKGROUND.tooltip)
    actions: list[Action] = [] if picked is None else [SetBackground(BACKGROUND_KINDS[picked])]
    if background.kind == "colour":
        of = background.colour, SetBackgroundColour, "light.background_colour", own.colour
        actions += rows.draw(context, rows.Row(BACKGROUND_COLOUR, *of))
    return actions


def _mapping(context: PanelContext) -> list[Action]:
    """How the file is read; picked where it cannot be read so, the status bar says why."""
    widgets.label(context, MAPPING.label)
    choices = [widgets.Choice(*each) for each in zip(MAPPING.titles, MAPPING_HINTS, MAPPINGS, strict=True)]
    chosen = MAPPINGS.index(context.document.light.mapping)
    picked = widgets.choose(context, "light.mapping", choices, [chosen], MAPPING.tooltip)
    return [] if picked is None else [SetMapping(MAPPINGS[picked])]


def _thumbnail(context: PanelContext, width: float, height: float) -> list[Action]:
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("thumbnail", ImVec2(width, height))
    context.handles.note_item("light.picture")
    widgets.tooltip("The environment around the scene, -Z in the middle. Drag sideways to turn it. "
                    "The mark shows the camera's direction.")  # fmt: skip
    if imgui.is_item_hovered():
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
    actions = _turned(context, "light.picture", imgui.get_mouse_pos().x, -FULL_TURN / width)
    draw_list = imgui.get_window_draw_list()
    end = ImVec2(corner.x + width, corner.y + height)
    draw_list.add_rect_filled(corner, end, look.pack(look.WELL), context.px(3))
    if context.environment is not None:
        painted_canvas.scrolled(
            draw_list, context.environment, corner, end, context.document.light.rotation / FULL_TURN
        )
        _marker(context, draw_list, corner, width, height)
    else:
        _even(context, draw_list, corner, end)
    return actions


def _turned(context: PanelContext, handle: str, place: float, rate: float) -> list[Action]:
    """Rotate the light by the control drawn last: by `rate` degrees for each unit that the pointer at `place` moves, a
    tenth with Shift."""
    grip, fine = context.state.grip, imgui.get_io().key_shift
    if imgui.is_item_activated():
        travel = Travel((place, 0.0), fine=fine)
        begun = TurnGrip(handle, (place, context.document.light.rotation), travel)
        return [BeginDrag("rotate the environment"), HoldGrip(begun)]
    if not isinstance(grip, TurnGrip) or grip.handle != handle:
        return []
    if imgui.is_item_deactivated():
        return [EndDrag(), HoldGrip(None)]
    travel = grip.travel.with_fine((place, 0.0), fine)
    gone, _ = travel.distance_to((place, 0.0))
    rotation = grip.offset[1]
    return [HoldGrip(replace(grip, offset=(place, rotation), travel=travel)), SetRotation(rotation + rate * gone)]


def _even(context: PanelContext, draw_list: imgui.ImDrawList, corner: ImVec2, end: ImVec2) -> None:
    if not context.document.is_open:  # a scene that is being opened has no light yet
        return
    light = context.document.light
    text = "even light" if light.environment == CONSTANT_ENVIRONMENT else "no environment"
    has_any = light.has_sky(context.has_environment)
    gains = gains_of(context.document)
    if has_any and not any(any(gains[key]) for key in light.environment_keys):
        text = "off in the mix"
    extent = imgui.calc_text_size(text)
    place = ImVec2(0.5 * (corner.x + end.x - extent.x), 0.5 * (corner.y + end.y - extent.y))
    draw_list.add_text(place, look.pack(look.TEXT_FAINT), text)


def _marker(context: PanelContext, draw_list: imgui.ImDrawList, corner: ImVec2, width: float, height: float) -> None:
    """A line at the camera's heading, with a triangle at its foot."""
    x = round(corner.x + ((context.heading / FULL_TURN + 0.5) % 1.0) * width) + 0.5
    size = context.px(5)
    draw_list.add_line(ImVec2(x, corner.y), ImVec2(x, corner.y + height), look.pack(look.grey(0, 0.5)), context.px(3))
    draw_list.add_line(ImVec2(x, corner.y), ImVec2(x, corner.y + height), look.pack(look.ACCENT), context.px(1))
    foot = corner.y + height
    points = (ImVec2(x, foot - size), ImVec2(x + size, foot + 1), ImVec2(x - size, foot + 1))
    draw_list.add_triangle_filled(*points, look.pack(look.ACCENT))


def _dial(context: PanelContext, size: float) -> list[Action]:
    """A compass seen from above; its knob shows the rotation."""
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("dial", ImVec2(size, size))
    widgets.tooltip("Turn the light around the scene, seen from above; up is -Z. With Shift it turns finely. "
                    "The mouse wheel turns it by 5°, with Shift by half a degree.")  # fmt: skip
    imgui.set_item_key_owner(imgui.Key.mouse_wheel_y)  # the panel does not scroll
    centre = ImVec2(corner.x + 0.5 * size, corner.y + 0.5 * size)
    radius = 0.5 * size - context.px(7)
    rotation = context.document.light.rotation
    knob = ImVec2(
        centre.x - radius * math.sin(math.radians(rotation)), centre.y - radius * math.cos(math.radians(rotation))
    )
    context.handles.note("light.wheel", knob.x, knob.y)
    actions = _turn(context, centre) + _wheel(context)
    active = imgui.is_item_active() or imgui.is_item_hovered()
    draw_list = imgui.get_window_draw_list()
    draw_list.add_circle_filled(centre, radius, look.pack(look.WELL), 64)
    draw_list.add_circle(centre, radius, look.pack(look.grey(84)), 64, context.px(2))
    for quarter in range(4):
        angle = 0.5 * math.pi * quarter
        inner, outer = radius - context.px(8), radius - context.px(4)
        draw_list.add_line(ImVec2(centre.x + inner * math.sin(angle), centre.y - inner * math.cos(angle)),
                           ImVec2(centre.x + outer * math.sin(angle), centre.y - outer * math.cos(angle)),
                           look.pack(look.TEXT_FAINT), context.px(1))  # fmt: skip
    _swept(context, draw_list, centre, radius, rotation)
    draw_list.add_circle_filled(knob, context.px(6.5 if active else 5.5), look.pack(look.ACCENT))
    draw_list.add_circle(knob, context.px(6.5 if active else 5.5), look.pack(look.grey(20)), 0, context.px(1.5))
    text = f"{rotation:.0f}°"
    extent = imgui.calc_text_size(text)
    place = ImVec2(round(centre.x - 0.5 * extent.x + context.px(1.5)), round(centre.y - 0.5 * extent.y))
    draw_list.add_text(place, look.pack(look.TEXT), text)
    return actions


def _swept(context: PanelContext, draw_list: imgui.ImDrawList, centre: ImVec2, radius: float, rotation: float) -> None:
    """The arc from up to the knob, counter-clockwise."""
    if rotation < 0.5:
        return
    start = -0.5 * math.pi
    draw_list.path_arc_to(centre, radius, start, start - math.radians(rotation), 64)
    draw_list.path_stroke(look.pack(look.with_alpha(look.ACCENT, 0.6)), context.px(2), 0)


def _turn(context: PanelContext, centre: ImVec2) -> list[Action]:
    """The pointer around the dial."""
    mouse, grip = imgui.get_mouse_pos(), context.state.grip
    angle = math.degrees(math.atan2(centre.x - mouse.x, centre.y - mouse.y))
    if isinstance(grip, TurnGrip):
        angle += FULL_TURN * round((grip.offset[0] - angle) / FULL_TURN)  # the same angle, next to where it was
    return _turned(context, "light.wheel", angle, 1.0)


def _wheel(context: PanelContext) -> list[Action]:
    """The mouse wheel over the dial, forward counter-clockwise."""
    io, turn = imgui.get_io(), context.state.turn
    if not imgui.is_item_hovered() or io.mouse_wheel == 0.0 or context.state.grip is not None:
        return []
    if turn is None or context.now - turn.last > PAUSE_SECONDS:
        turn = WheelTurn(context.now, context.now)
    degrees = io.mouse_wheel * (FINE_DEGREES if io.key_shift else DEGREES_A_NOTCH)
    command = SetRotation(context.document.light.rotation + degrees)
    return [
        MergedEdit(command, f"wheel from {turn.began}"),
        SetPanel({"turn": replace(turn, last=context.now)}),
    ]
