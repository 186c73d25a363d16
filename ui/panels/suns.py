"""The suns of the Light panel: for each a line with its name, below which it is aimed, dimmed, tinted and sized."""

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
    SetSun,
    angles_of,
    direction_of,
)
from engine.light.suns import Sun
from ui.panels import light_colour, rows, widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext


def draw(context: PanelContext) -> list[Action]:
    """All suns; of a single one the rows are open at first."""
    actions: list[Action] = []
    suns = context.document.light.suns
    own = {each.name: each for each in context.scene_document.light.suns}
    for sun in suns:
        imgui.set_next_item_open(len(suns) == 1, imgui.Cond_.once)
        is_open = imgui.tree_node_ex(sun.name, imgui.TreeNodeFlags_.span_avail_width)
        context.handles.note_item(f"light.{sun.name}")
        widgets.tooltip("A directional light: a distant disc that lights all objects alike.")
        if is_open:
            actions += _rows(context, sun, own.get(sun.name, sun))
            imgui.tree_pop()
    return actions


def _rows(context: PanelContext, sun: Sun, own: Sun) -> list[Action]:
    """The controls of a sun; own: as the scene has it."""
    at, set_sun = f"light.{sun.name}", partial(SetSun, sun.name)
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
