"""Deform's part of the Accuracy panel: how its pictures are drawn, and what of the scene they leave out."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.view_state import SetView
from app.modes.deform.deform_status import DeformStatus
from ui.modes.orbit import accuracy_orbit
from ui.panels import picture_overlays, widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext

LEFT_OUT = (
    "Shadows of deformed or animated objects are coarse; those by lamps on themselves are soft over some 30 degrees. "
    "Light between objects is that of their rest. Sharp shadows come back when idle, as Placement takes over."
)
SPLIT_HINT = (
    "Splits the picture: path traced, refined while idle; transfer that does not rotate with the surface; and Deform. "
    "Drag the dividers."
)
FIT_HINT = (
    "Shows the error of the fitted lobes in false colours, point by point, on patches and wrinkles pixel by pixel. "
    "Yellow: creases too deep for a few lobes. A membrane is exact."
)
EVENLY = (1.0 / 3.0, 2.0 / 3.0)
LEFT_OUT_AND_STAYS = (
    "Shadows of deformed or animated objects on others are coarse, and light between objects is that of their rest. "
    "Only Deform shows the surface of {}, so Placement does not take over when idle: switch to it (G) for all shadows."
)


def draw(context: PanelContext) -> list[Action]:
    """The measured figures of the picture, the loss at sharp curves, and what Placement adds at rest."""
    status = context.status
    actions = accuracy_orbit.draw(context)
    if not isinstance(status, DeformStatus):
        return actions
    is_split = context.view.split is not None
    if widgets.text_button(context, "deform.split", "End comparison" if is_split else "Compare with paths", SPLIT_HINT):
        actions.append(SetView.of(split=None if is_split else EVENLY, fit_error=False))
    imgui.same_line()
    shows_error = context.view.fit_error
    if widgets.text_button(context, "deform.fit_error", "Light" if shows_error else "Fit error", FIT_HINT):
        actions.append(SetView.of(fit_error=not shows_error, split=None))
    if shows_error:
        corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        imgui.dummy(ImVec2(room, picture_overlays.legend_height(context)))
        picture_overlays.draw_legend(context, imgui.get_window_draw_list(), corner, room)
    for name, share in sorted(status.lost, key=lambda each: -each[1])[:4]:
        hint = (
            "The share of this material's reflection, by energy, that is too sharp for the bands of light of a bending "
            "mesh. The rest is a soft highlight; Placement shows all of it."
        )
        widgets.figure(f"Lost from {name}", f"{share:.0%}", hint)
    widgets.caption(LEFT_OUT_AND_STAYS.format(", ".join(status.deform_only)) if status.deform_only else LEFT_OUT)
    return actions
