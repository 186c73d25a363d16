"""The rows of a sun in the Light panel, by which it is aimed, dimmed, tinted and sized, and the menu of its line."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from imgui_bundle import imgui

from app.document.commands.suns import (
    AZIMUTH,
    DIAMETER,
    ELEVATION,
    IRRADIANCE,
    STRENGTH,
    DeleteSun,
    RenameSun,
    SetSun,
    angles_of,
    direction_of,
)
from app.document.light_state import sun_key
from engine.light.suns import Sun
from ui.panels import light_colour, rows, widgets
from ui.panels.actions import Action, RunOperator
from ui.panels.context import PanelContext


def selection(sun: Sun) -> list[Action]:
    """A click on the item drawn last selects the sun."""
    return [RunOperator("select", sun_key(sun.name))] if imgui.is_item_clicked() else []


def menu(context: PanelContext, sun: Sun) -> list[Action]:
    """The context menu of a sun, on the item drawn last."""
    actions: list[Action] = []
    if not imgui.begin_popup_context_item(f"menu.{sun.name}"):
        return actions
    imgui.set_next_item_width(context.px(160))
    _, typed = imgui.input_text("##name", sun.name, imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item(f"light.{sun.name}.name")
    widgets.tooltip("Another name, then Enter.")
    if imgui.is_item_deactivated_after_edit() and typed.strip() != sun.name:
        imgui.close_current_popup()
        actions.append(RenameSun(sun.name, typed.strip()))
    if imgui.menu_item_simple("Duplicate"):
        actions += [RunOperator("select", sun_key(sun.name)), RunOperator("duplicate")]
    context.handles.note_item(f"light.{sun.name}.duplicate")
    if imgui.menu_item_simple("Delete"):
        actions.append(DeleteSun(sun.name))
    context.handles.note_item(f"light.{sun.name}.delete")
    imgui.end_popup()
    return actions


def draw(context: PanelContext, sun: Sun, panel: str = "light") -> list[Action]:
    """The rows of a sun. panel: where they are, as their handles' names begin."""
    own = next((each for each in context.scene_document.light.suns if each.name == sun.name), sun)
    at, set_sun = f"{panel}.{sun.name}", partial(SetSun, sun.name)
    (azimuth, elevation), (own_azimuth, own_elevation) = angles_of(sun.direction), angles_of(own.direction)
    colour = replace(IRRADIANCE, step=max(max(sun.irradiance), STRENGTH.minimum) / 200.0)
    actions: list[Action] = []
    for row in (
        rows.Row(
            AZIMUTH, azimuth, lambda to: set_sun("direction", direction_of(to, elevation)), f"{at}.azimuth",
            own_azimuth, origin=0.0,
        ),
        rows.Row(
            ELEVATION, elevation, lambda to: set_sun("direction", direction_of(azimuth, to)), f"{at}.elevation",
            own_elevation, origin=0.0,
        ),
        rows.Row(
            STRENGTH, max(sun.irradiance),
            lambda to: set_sun("irradiance", light_colour.scaled(sun.irradiance, to)), f"{at}.irradiance",
            max(own.irradiance),
        ),
    ):  # fmt: skip
        actions += rows.draw(context, row)
    actions += light_colour.draw(
        context, rows.Row(colour, sun.irradiance, partial(set_sun, "irradiance"), f"{at}.colour")
    )
    size = rows.Row(DIAMETER, sun.diameter, partial(set_sun, "diameter"), f"{at}.diameter", own.diameter)
    return actions + rows.draw(context, size)
