"""The viewport's header: what moves snap to, and what several objects are rotated and scaled about.

It is in the upper left corner of the picture's panel while an object is selected: what it shows counts for the keys and
the handles alike.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.operators.registry import OPERATORS, keys_of
from ui.panels import camera, stored_pictures, widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.window_operators import PIVOTS, SNAP_TARGETS, perform
from ui.panels.window_state import GrabGrip
from ui.theme import Icon

HEIGHT = 44.0  # with its margin
MARGIN, GAP, LEAST = 10.0, 4.0, 270.0
SNAP_WIDTH, PIVOT_WIDTH = 104.0, 98.0
SNAP_WORDS = {"increments": "Increments", "ground": "Ground", "surfaces": "Surfaces"}
PIVOT_WORDS = {"middle": "Median", "own": "Individual", "active": "Active"}


def is_shown(context: PanelContext, room: ImVec2) -> bool:
    """Whether the picture's panel, of this room, has the header; with only the picture shown, while objects are moved
    or have handles."""
    state = context.state
    if room.x < context.px(LEAST + (camera.WIDTH + 2 * MARGIN if state.shows_camera else 0.0)):
        return False
    if context.view.selected is None or state.paints or state.paints_highlight or state.draws_crop:
        return False
    return not state.single_panel or bool(state.gizmo) or isinstance(state.grip, GrabGrip)


def draw(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The header, from the corner of the picture's panel."""
    if not is_shown(context, room):
        return []
    actions: list[Action] = []
    below = MARGIN + (stored_pictures.HEIGHT if context.view.stored else 0.0)
    at = ImVec2(corner.x + context.px(MARGIN), corner.y + context.px(below))
    with widgets.strip(context, "Arranging###header", at, ImVec2(0.0, 0.0), ImVec2(4, 3)) as is_seen:
        if is_seen:
            actions += _snapping(context)
            imgui.same_line(0.0, context.px(3 * GAP))
            actions += _pivot(context)
    return actions


def _snapping(context: PanelContext) -> list[Action]:
    state = context.state
    hint = f"{'Snaps' if state.snaps else 'Snap'} what is moved, rotated or scaled. ({keys_of('snaps')})"
    pressed = widgets.icon_button(context, "snaps", Icon.MAGNET, hint, lit=state.snaps)
    imgui.same_line(0.0, context.px(GAP))
    choices = [widgets.Choice(SNAP_WORDS[each], OPERATORS[f"snap_{each}"].help, each) for each in SNAP_TARGETS]
    imgui.set_next_item_width(context.px(SNAP_WIDTH))
    hint = "What moves snap to, once the magnet is on. Ctrl snaps to increments for a moment, or not to."
    picked = widgets.choose(context, "header.snap", choices, [SNAP_TARGETS.index(state.snap_to)], hint)
    if picked is not None:
        return perform(context, f"snap_{SNAP_TARGETS[picked]}")
    return perform(context, "snaps") if pressed else []


def _pivot(context: PanelContext) -> list[Action]:
    choices = [widgets.Choice(PIVOT_WORDS[each], OPERATORS[f"pivot_{each}"].help, each) for each in PIVOTS]
    imgui.set_next_item_width(context.px(PIVOT_WIDTH))
    hint = "Pivot: what several objects are rotated and scaled about."
    picked = widgets.choose(context, "header.pivot", choices, [PIVOTS.index(context.state.pivot)], hint)
    return [] if picked is None else perform(context, f"pivot_{PIVOTS[picked]}")
