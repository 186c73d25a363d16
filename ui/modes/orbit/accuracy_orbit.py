"""Orbit's part of the Accuracy panel: how its pictures are drawn, and Placement's part while that shows the view."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.messages.editor_status import duration
from app.modes.orbit.orbit_status import OrbitStatus
from ui.modes.placement import accuracy_placement
from ui.panels import widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext


def draw(context: PanelContext) -> list[Action]:
    """The measured figures of the picture."""
    status = context.status
    if not isinstance(status, OrbitStatus):
        return accuracy_placement.draw(context)
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(imgui.get_style().item_spacing.x, context.px(1)))
    for name, value, hint in figures(status):
        widgets.figure(name, value, hint)
    imgui.pop_style_var()
    return []


def figures(status: OrbitStatus) -> list[tuple[str, str, str]]:
    """(name, value, explanation) of every measured figure."""
    width, height = status.drawn_resolution
    seconds = status.drawn_seconds
    took = duration(seconds) if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"
    drawn = f"{width} × {height}, {took}" if width else "–"
    return [
        (
            "Drawn",
            drawn,
            "Pixels of the last picture, and the time it took. Fewer are drawn while something moves.",
        ),
        (
            "Memory",
            f"{status.memory_mb:.0f} MB, light {status.precomputed_mb:.0f} MB",
            "Main memory of the window and the worker; light of the scene that Orbit stores.",
        ),
    ]
