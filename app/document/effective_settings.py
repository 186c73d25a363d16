"""The effective settings of a picture: the document's overrides of the plan, else the settings of the view.

All that computes a picture of a document, a mode's controller or a command, uses `effective_view`.
"""

from __future__ import annotations

from dataclasses import replace

from app.document.commands.plan import OverrideLine
from app.document.document import Document
from app.document.view_state import SetView, ViewState
from engine.settings import FIELD_OF_LINE, SETTINGS


def effective_view(view: ViewState, document: Document) -> ViewState:
    """The view with the document's overrides in place of its own settings, and simple lighting where Placement shows
    that; the same one without either."""
    if document.overrides:
        view = replace(view, settings=view.settings.with_lines(dict(document.overrides)))
    if view.lighting != "scene" and view.mode == "placement":
        view = replace(view, settings=replace(view.settings, lighting=view.lighting, n_bounces=1))
    return view


def override_lines_of(command: SetView, document: Document) -> tuple[OverrideLine | SetView, ...]:
    """The commands that set these settings of the view: where a line of the plan overrides one, that line is set,
    because the picture depends on it."""
    lines = {FIELD_OF_LINE[line]: line for line, _ in document.overrides if line in FIELD_OF_LINE}
    by_line = [
        OverrideLine(lines[name], None if value in SETTINGS[name].as_required else value)
        for name, value in command.changes
        if name in lines
    ]
    rest = tuple((name, value) for name, value in command.changes if name not in lines)
    return (*by_line, *([SetView(rest)] if rest else []))
