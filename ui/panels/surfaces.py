"""Settings of the selected object's surface that only Deform draws: a part of the Material panel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from imgui_bundle import ImVec2, imgui

from app.document.commands import SetSurface
from app.document.document import ObjectState
from engine.material.parameters import Parameter
from engine.scene.surface_kinds import SURFACES
from ui.panels import number_fields, widgets
from ui.panels.actions import Action, AskFile, BeginDrag, EndDrag
from ui.panels.context import PanelContext
from ui.panels.material import number_format
from ui.theme import Icon

PLAIN = "As its material"
PLAIN_HINT = "An opaque surface, shaded by its layers."
# By the parameter that it replaces: which of `SURFACE_IMAGES` it is, and its effect.
IMAGES = {
    "translucency": (
        "translucency", "A grey image of translucency by texture coordinates: black lets no light through, white all.",
    ),
    "kind": ("heights", "A grey image of heights that repeats in the place of a pattern; white is the highest."),
}  # fmt: skip


def draw(context: PanelContext, state: ObjectState) -> list[Action]:
    """The kind of the surface, and the parameters of that kind."""
    imgui.separator_text(f"Surface of {state.name}")
    imgui.begin_disabled(state.frozen or not state.editable)
    actions, surface = _kind(context, state), state.surface
    if surface.kind:
        for parameter in SURFACES[surface.kind].parameters:
            actions += _row(context, state, parameter, surface.values.get(parameter.name))
    imgui.end_disabled()
    return actions


def _kind(context: PanelContext, state: ObjectState) -> list[Action]:
    kind, actions = state.surface.kind, list[Action]()
    widgets.label(context, "Kind")
    if widgets.begin_combo("##surface", SURFACES[kind].title if kind else PLAIN):
        choices = [("", PLAIN, PLAIN_HINT), *((name, each.title, each.tooltip) for name, each in SURFACES.items())]
        for name, title, hint in choices:
            pressed, _ = imgui.selectable(title, name == kind)
            context.handles.note_item(f"surface.kind.{name or 'none'}")
            widgets.tooltip(hint)
            if pressed and name != kind:
                actions.append(SetSurface(state.name, name))
        imgui.end_combo()
    context.handles.note_item("surface.kind")
    widgets.tooltip(f"{SURFACES[kind].tooltip if kind else PLAIN_HINT} Deform alone shows it.")
    return actions


def _row(context: PanelContext, state: ObjectState, parameter: Parameter, value: Any) -> list[Action]:
    """A label and its control: a choice, one slider or two; where an image replaces it, the image's name."""
    file = value if parameter.kind == "scalar" else state.surface.values.get("file")
    widgets.label(context, parameter.label)
    if isinstance(value, tuple):
        return _pair(context, state, parameter, value)
    if isinstance(file, str) and (value is None or parameter.kind == "scalar"):
        return _file(context, state, parameter, file)
    if parameter.name in IMAGES:
        imgui.set_next_item_width(imgui.get_content_region_avail().x - imgui.get_frame_height() - context.px(4))
    control = _choice if parameter.kind == "choice" else _slider
    actions = control(context, state, parameter, value)
    if parameter.name in IMAGES:
        imgui.same_line(0.0, context.px(4))
        what, hint = IMAGES[parameter.name]
        if widgets.icon_button(context, f"surface.{parameter.name}.image", Icon.IMAGE, hint):
            actions.append(AskFile(f"open_{what}", state.name))
    return actions


def _choice(context: PanelContext, state: ObjectState, parameter: Parameter, value: str) -> list[Action]:
    actions: list[Action] = []
    if widgets.begin_combo(f"##{parameter.name}", value.capitalize()):
        for choice in parameter.choices:
            pressed, _ = imgui.selectable(choice.capitalize(), choice == value)
            context.handles.note_item(f"surface.{parameter.name}.{choice}")
            if pressed and choice != value:
                actions.append(_set(state, parameter, choice))
        imgui.end_combo()
    context.handles.note_item(f"surface.{parameter.name}")
    widgets.tooltip(parameter.tooltip)
    return actions


def _slider(context: PanelContext, state: ObjectState, parameter: Parameter, value: float) -> list[Action]:
    touch, moved = number_fields.slider(
        context, parameter.name, value, parameter.minimum, parameter.maximum, number_format(parameter),
        parameter.logarithmic, handle=f"surface.{parameter.name}", title=parameter.label,
        pixels_to_double=number_fields.PIXELS_TO_DOUBLE if parameter.logarithmic else None,
    )  # fmt: skip
    widgets.tooltip(parameter.tooltip)
    return _edits(touch, state, parameter, moved)


def _pair(context: PanelContext, state: ObjectState, parameter: Parameter, value: tuple[float, float]) -> list[Action]:
    """One number for each direction."""
    gap, actions = context.px(4), list[Action]()
    room = imgui.get_content_region_avail().x - gap
    for index, axis in enumerate("uv"):
        imgui.set_next_item_width(0.5 * room)
        touch, moved = number_fields.number(
            context, f"{parameter.name} {axis}", value[index], f"{axis} × %.3g", f"surface.{parameter.name}.{axis}",
            parameter.minimum, parameter.maximum, title=parameter.label,
        )  # fmt: skip
        widgets.tooltip(f"{parameter.tooltip} Drag sideways, or double-click to type.")
        actions += _edits(touch, state, parameter, (moved, value[1]) if index == 0 else (value[0], moved))
        if index == 0:
            imgui.same_line(0.0, gap)
    return actions


def _file(context: PanelContext, state: ObjectState, parameter: Parameter, file: str) -> list[Action]:
    """An image's name, which opens the file dialog, and a button to remove it."""
    what, hint = IMAGES[parameter.name]
    side, gap, actions = imgui.get_frame_height(), context.px(4), list[Action]()
    room = imgui.get_content_region_avail().x - side - gap
    words = widgets.fitting(Path(file).name, room - 2.0 * imgui.get_style().frame_padding.x)
    imgui.push_style_var(imgui.StyleVar_.button_text_align, ImVec2(0.0, 0.5))
    if imgui.button(f"{words}##{parameter.name}", ImVec2(max(room, 1.0), 0.0)):
        actions.append(AskFile(f"open_{what}", state.name))
    imgui.pop_style_var()
    context.handles.note_item(f"surface.{parameter.name}.file")
    widgets.tooltip(f"{file}\n\n{hint}")
    imgui.same_line(0.0, gap)
    hint = "Remove the image; Ctrl+Z brings it back."
    if widgets.icon_button(context, f"surface.{parameter.name}.clear", Icon.CLOSE, hint):
        actions.append(_set(state, parameter, parameter.default))
    return actions


def _edits(touch: number_fields.Touch, state: ObjectState, parameter: Parameter, value: object) -> list[Action]:
    """One drag of a control as one step of the history."""
    actions: list[Action] = []
    if touch.began:
        actions.append(BeginDrag(f"{state.name} {parameter.label.lower()}"))
    if touch.changed:
        actions.append(_set(state, parameter, value))
    if touch.ended:
        actions.append(EndDrag())
    return actions


def _set(state: ObjectState, parameter: Parameter, value: object) -> SetSurface:
    return SetSurface(state.name, state.surface.kind, ((parameter.name, value),))
