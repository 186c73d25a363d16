"""The normal or bump map of the selected object, a part of the material panel."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.document.commands.surfaces import SetBumps
from app.document.document import ObjectState
from engine.material.bumps import MAX_HEIGHT, MAX_STRENGTH
from engine.material.layer_maps import MAX_REPEATS
from ui import theme as look
from ui.panels import number_fields, widgets
from ui.panels.actions import Action, AskFile, BeginDrag, EndDrag
from ui.panels.context import PanelContext
from ui.panels.maps import image_label, short_label
from ui.theme import Icon

HINTS = {
    "normal_map": "An image of directions that turns the object's normals, under all of its layers (tangent space, as "
    "glTF has it: red to the right, green up): PNG, JPEG or OpenEXR.",
    "bump_map": "A grey image of heights that turns the object's normals, under all of its layers: PNG, JPEG or "
    "OpenEXR.",
}
_FINEST = 1e-3  # metres: smaller heights are dragged at the speed of this one


def draw(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    """The rows of an object's bumps: the image, and where there is one its strength and repeats."""
    bumps = state.bumps
    widgets.label(context, "Bumps", width)
    if not bumps.file:
        room = 0.5 * (imgui.get_content_region_avail().x - context.px(4))
        actions = _file_button(context, state.name, "normal_map", "Normal map…", "", room)
        imgui.same_line(0.0, context.px(4))
        return actions + _file_button(context, state.name, "bump_map", "Heights…", "", room)
    right = imgui.get_frame_height() + context.px(4)
    room = imgui.get_content_region_avail().x - right
    actions = _file_button(context, state.name, bumps.kind, image_label(bumps.file), bumps.file, room)
    imgui.same_line(0.0, context.px(4))
    if widgets.icon_button(context, "clear_bumps", Icon.CLOSE, "Remove the image; Ctrl+Z brings it back."):
        actions.append(SetBumps(state.name, bumps.kind, ""))
    actions += _strength(context, state, width)
    return actions + _repeats(context, state, width)


def _file_button(context: PanelContext, name: str, kind: str, words: str, file: str, room: float) -> list[Action]:
    inside = room - 2.0 * imgui.get_style().frame_padding.x
    fits = imgui.calc_text_size(words).x <= inside
    text = words if fits else widgets.fitting(short_label(words), inside)
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT if file else look.TEXT_SOFT))
    imgui.push_style_var(imgui.StyleVar_.button_text_align, ImVec2(0.0, 0.5))
    pressed = imgui.button(f"{text}##{kind}", ImVec2(max(room, 1.0), 0.0))
    imgui.pop_style_var()
    imgui.pop_style_color()
    context.handles.note_item(f"material.{kind}")
    widgets.tooltip(f"{file}\n\n{HINTS[kind]}" if file else HINTS[kind])
    return [AskFile(f"open_{kind}", name)] if pressed else []


def _strength(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    """The strength of the image; for heights also their scale."""
    widgets.label(context, "Bump strength", width)
    bumps = state.bumps
    touch, moved = number_fields.slider(
        context, "bump_strength", bumps.bump_strength, 0.0, MAX_STRENGTH, handle="material.bump_strength"
    )
    widgets.tooltip("Strength of the bumps: 1 as in the image, 0 flat. Shown when idle.")
    actions = _edits(touch, state.name, "bump_strength", moved)
    if not bumps.bump_map:
        return actions
    widgets.label(context, "Height", width)
    imgui.set_next_item_width(imgui.get_content_region_avail().x)
    touch, moved = number_fields.number(
        context, "bump_height", bumps.bump_height, "%.4g m", "material.bump_height", -MAX_HEIGHT, MAX_HEIGHT,
        0.01 * max(abs(bumps.bump_height), _FINEST),
    )  # fmt: skip
    hint = "Metres between black and white; below 0 the image is pressed in."
    widgets.tooltip(f"{hint} Drag sideways, or double-click to type.")
    return actions + _edits(touch, state.name, "bump_height", moved)


def _repeats(context: PanelContext, state: ObjectState, width: float) -> list[Action]:
    """The repeats of the image across and upwards."""
    widgets.label(context, "Repeats", width)
    gap, repeats = context.px(4), state.bumps.bump_repeats
    room = imgui.get_content_region_avail().x - gap
    actions: list[Action] = []
    for index, (axis, across) in enumerate((("u", "across"), ("v", "upwards"))):
        imgui.set_next_item_width(0.5 * room)
        touch, moved = number_fields.number(
            context, f"bump repeats {axis}", repeats[index], f"{axis} × %.3g", f"material.bump_repeats.{axis}",
            -MAX_REPEATS, MAX_REPEATS,
        )  # fmt: skip
        widgets.tooltip(f"How often the image repeats {across}; below 0 it is mirrored. Drag, or double-click to type.")
        pair = (moved, repeats[1]) if index == 0 else (repeats[0], moved)
        touch = replace(touch, changed=touch.changed and abs(moved) >= 1e-3)
        actions += _edits(touch, state.name, "bump_repeats", pair)
        if index == 0:
            imgui.same_line(0.0, gap)
    return actions


def _edits(touch: number_fields.Touch, name: str, field: str, value: object) -> list[Action]:
    """One drag of a control as one step of the history."""
    actions: list[Action] = []
    if touch.began:
        actions.append(BeginDrag(f"{name} {field.replace('_', ' ')}"))
    if touch.changed:
        actions.append(SetBumps(name, field, value))
    if touch.ended:
        actions.append(EndDrag())
    return actions
