"""The colour of a light: what it sends in each channel, and a swatch whose wheel keeps the strength."""

from __future__ import annotations

from imgui_bundle import imgui

from ui.panels import rows, widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.rows import RGB

SWATCH_HINT = "The colour at full brightness. Click for a colour wheel; the strength stays."


def draw(context: PanelContext, row: rows.Row, label: str = "Colour") -> list[Action]:
    """Label, three numbers and swatch of a parameter of a light."""
    actions: list[Action] = []
    widgets.label(context, label)
    imgui.push_id(row.handle)
    for touch, moved in rows.triple(context, row, has_swatch=True):
        actions += rows.one_step(touch, [row.make(moved)])
    touch, picked = rows.swatch(context, row.handle, scaled(row.value, 1.0), SWATCH_HINT)
    imgui.pop_id()
    return actions + rows.one_step(touch, [row.make(scaled(picked, max(row.value)))])


def scaled(colour: RGB, strength: float) -> RGB:
    """The colour with this as its brightest channel; black becomes white."""
    largest = max(colour)
    red, green, blue = (strength * value / largest if largest > 0.0 else strength for value in colour)
    return red, green, blue
