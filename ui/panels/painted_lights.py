"""Painted lights in the Light panel: what adds them, and the rows of one in its opened line of the mix."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from imgui_bundle import imgui

from app.document.commands.painted import MAX_PAINTED, AddPainted, RemovePainted, SetPainted, place_of
from app.document.painted_parameters import TITLES, parameters_of
from app.document.targets import PLACE
from engine.light.painted_lights import PAINTED_KINDS, PaintedLight, angles_in_environment
from engine.material.parameters import Parameter
from ui.panels import light_colour, painted_canvas, rows, widgets
from ui.panels.actions import Action, AskFile, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_state import PaintedSelection
from ui.theme import Icon

ADD_HINT = "Paints a light onto the environment: it is seen, mirrored and casts shadows as the environment does."
HINTS = {
    "box": "A rectangle of even light with a soft rim, as a studio's soft box.",
    "disc": "A round light.",
    "gradient": "Light that changes evenly from one colour to another across the sky.",
    "sky": "A clear sky with its sun and the ground below, instead of the environment.",
    "image": "An image as a card at a distance, or all around instead of the environment.",
}
# A new light stands so far to the side of the camera, behind it, where what it lights is seen.
_ASIDE = 130.0


def draw(context: PanelContext) -> list[Action]:
    """The list of what can be painted, and, where there are lights, the picture on which they are moved."""
    actions: list[Action] = []
    widgets.label(context, "Paint")
    choices = [widgets.Choice(TITLES[kind], HINTS[kind], kind) for kind in PAINTED_KINDS]
    choices[-1] = choices[-1]._replace(text="Image…")
    picked = widgets.choose(context, "painted.add", choices, [], ADD_HINT, shown="Add a light…")
    if picked is not None:
        kind = PAINTED_KINDS[picked]
        actions += [AskFile("paint_image")] if kind == "image" else _added(context, _addition(context, kind))
    if context.document.light.painted:
        actions += painted_canvas.draw(context)
    return actions


def _added(context: PanelContext, command: AddPainted) -> list[Action]:
    """Paint a light, and select it."""
    if len(context.document.light.painted) >= MAX_PAINTED:  # its refusal says so
        return [command]
    return [command, selection(context, command.apply(context.document).light.painted[-1])]


def _addition(context: PanelContext, kind: str) -> AddPainted:
    """The command that paints a light where the camera sees what it lights; a gradient and a sky as they are."""
    light = context.document.light
    if kind not in ("box", "disc"):
        return AddPainted(kind)  # type: ignore[arg-type]
    up = PaintedLight("", azimuth=context.heading + _ASIDE, elevation=40.0).frame[2]
    azimuth, elevation = angles_in_environment(up, light.rotation, light.tilt)
    return AddPainted(kind, "", (("azimuth", azimuth), ("elevation", elevation)))  # type: ignore[arg-type]


def selection(context: PanelContext, light: PaintedLight) -> SetPanel:
    """The action that selects a painted light."""
    return SetPanel({"painted": PaintedSelection(light.name, (context.view.selected, context.view.sun))})


def draw_rows(context: PanelContext, light: PaintedLight) -> list[Action]:
    """The rows of a painted light: its order, its name and file, and its parameters."""
    at = f"light.painted.{light.name}"
    actions = _order(context, light, at) + _name(context, light, at)
    if light.kind == "image":
        widgets.label(context, "Image")
        if imgui.button(f"{widgets.fitting(Path(light.file).name, imgui.calc_item_width())}###{at}.file"):
            actions.append(AskFile("paint_image", light.name))
        context.handles.note_item(f"{at}.file")
        widgets.tooltip(f"{light.file}. Click for another file.")
    for parameter in parameters_of(light.kind, light.placement).values():
        actions += _row(context, light, parameter, at)
    return actions


def _row(context: PanelContext, light: PaintedLight, parameter: Parameter, at: str) -> list[Action]:
    value, make = getattr(light, parameter.name), partial(SetPainted.of, light.name, parameter.name)
    own = parameter.default
    if parameter.kind == "rgb" and parameter.maximum > 1.0:
        stepped = replace(parameter, step=max(*value, 0.01) / 200.0)
        return light_colour.draw(
            context, rows.Row(stepped, value, make, f"{at}.{parameter.name}", own), parameter.label
        )
    origin = 0.0 if parameter.minimum < 0.0 else None
    return rows.draw(context, rows.Row(parameter, value, make, f"{at}.{parameter.name}", own, origin=origin))


def _order(context: PanelContext, light: PaintedLight, at: str) -> list[Action]:
    """Buttons that paint it later or earlier, and one that deletes it."""
    place, last = place_of(context.document, light.name), len(context.document.light.painted) - 1
    actions: list[Action] = []
    widgets.label(context, "Order")
    hint = "Paint it over the next one: what covers hides what is below."
    if widgets.icon_button(context, f"{at}.up", Icon.UP, hint, enabled=place < last):
        actions.append(SetPainted.of(light.name, PLACE, place + 1))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"{at}.down", Icon.DOWN, "Paint it below the one before.", enabled=place > 0):
        actions.append(SetPainted.of(light.name, PLACE, place - 1))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"{at}.delete", Icon.DELETE, "Delete this light."):
        actions.append(RemovePainted(light.name))
    return actions


def _name(context: PanelContext, light: PaintedLight, at: str) -> list[Action]:
    widgets.label(context, "Name")
    _, typed = imgui.input_text(f"##{at}.name", light.name, imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item(f"{at}.name")
    widgets.tooltip("Another name, then Enter.")
    is_renamed = imgui.is_item_deactivated_after_edit() and typed.strip() not in ("", light.name)
    if not is_renamed:
        return []
    return [SetPainted.of(light.name, "name", typed), selection(context, replace(light, name=typed.strip()))]
