"""The rows of a sun in the Light panel, by which it is aimed, dimmed, tinted and sized."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

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
from ui.panels import light_colour, rows
from ui.panels.actions import Action
from ui.panels.context import PanelContext


def draw(context: PanelContext, sun: Sun) -> list[Action]:
    """The rows of a sun."""
    own = next((each for each in context.scene_document.light.suns if each.name == sun.name), sun)
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
