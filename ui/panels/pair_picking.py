"""The picking of pairs of points: what it shows, and that what was shown before comes back however it ends.

nothing ── begin ──► the photograph is read ──► a point of the picture ◄──► its place in the photograph
   ▲                                                       │
   └── leave: Esc, the panel closed or set to the scene's camera, a match begun, another photograph, scene,
       mode or tool, another comparison, the photograph removed
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from app.document.view_state import SetView
from ui.panels.actions import Action, CompareFile, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_state import PairPicking, Place3

# Other tools that take clicks on the picture.
TOOLS = ("picks_lobe", "draws_crop", "paints", "paints_highlight")


def begin(context: PanelContext, file: Path) -> list[Action]:
    """Begin to pick pairs on the photograph of a file."""
    reads = [] if context.stored_names_of(file) else [CompareFile(file, compares=False)]
    return [*reads, SetPanel({"picking": PairPicking(file, context.view), **dict.fromkeys(TOOLS, False)})]


def go_on(picking: PairPicking, point: Place3 | None) -> list[Action]:
    """Ask for a point's place in the photograph; None: for the next point of the picture."""
    shown = SetView.of(difference="present" if point is None else "stored")
    return [SetPanel({"picking": replace(picking, point=point)}), shown]


def step_back(context: PanelContext) -> list[Action]:
    """Give up the first half of a pair, or the picking where there is none."""
    picking = context.state.picking
    return leave(context) if picking is None or picking.point is None else go_on(picking, None)


def leave(context: PanelContext) -> list[Action]:
    """End the picking, if there is one, and show what was shown before."""
    picking = context.state.picking
    return [] if picking is None else [SetPanel({"picking": None}), *_shown_before(context, picking)]


def follow(context: PanelContext) -> list[Action]:
    """Once a frame: show the photograph when it has been read; leave where something else has taken its place."""
    picking = context.state.picking
    if picking is None:
        return []
    if _has_ended(context, picking):
        return leave(context)
    names = context.stored_names_of(picking.file)
    if picking.photo or not names:
        return []
    shown = SetView.of(stored=names[-1], compare=None, difference="present")
    return [SetPanel({"picking": replace(picking, photo=names[-1])}), shown]


def _has_ended(context: PanelContext, picking: PairPicking) -> bool:
    state, view = context.state, context.view
    if state.match is None or (state.match.file, state.match.scene) != (picking.file, context.document.source):
        return True
    if view.mode != picking.before.mode or any(getattr(state, name) for name in TOOLS):
        return True
    if not picking.photo:
        return not context.reads_stored and not context.stored_names_of(picking.file)
    return not _is_compared(context, picking)


def _is_compared(context: PanelContext, picking: PairPicking) -> bool:
    """Whether the picture is compared with the photograph still."""
    return context.view.stored == picking.photo and picking.photo in context.stored_names_of(picking.file)


def _shown_before(context: PanelContext, picking: PairPicking) -> list[Action]:
    view, before = context.view, picking.before
    if not picking.photo:
        return []
    if not _is_compared(context, picking):  # another comparison was chosen, or none
        return [SetView.of(difference=before.difference)]
    stored = before.stored if before.stored in context.stored_names else ""
    document, compare = context.document, before.compare
    is_there = compare is not None and (compare.source, compare.composition) == (document.source, document.composition)
    compare = compare if is_there and view.viewpoint == before.viewpoint else None
    return [SetView.of(stored=stored, compare=compare, difference=before.difference)]
