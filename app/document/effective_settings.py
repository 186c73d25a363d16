"""The effective settings of a picture: the document's overrides, else the settings of the view or the plan.

All that computes a picture of a document, a mode's controller or a command, uses `effective_view`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.document.commands.plan import OverrideLine
from app.document.document import Document
from app.document.view_state import SetView, ViewState
from engine.plan_lines import MODE_LINES, LineValue
from engine.planner import NEEDED_LINES, RenderSettings

# The settings of the view that a line of the plan overrides.
KNOBS = {
    "lights": "n_lights",
    "patches": "n_patches",
    "bounces": "n_bounces",
    "rays": "n_hemisphere_rays",
    "edges": "n_edge_rays",
    "precision": "precision",
    "points": "n_points",
    "coefficients": "n_coefficients",
    "transfer_rays": "n_rays",
    "lobes": "n_lobes",
}

ZERO_IS_PLANNED = frozenset({"bounces", "rays"})


def effective_view(view: ViewState, document: Document) -> ViewState:
    """The view with the document's overrides in place of its own settings; the same one without any."""
    changes: dict[str, Any] = {KNOBS[line]: value for line, value in document.overrides if line in KNOBS}
    return replace(view, **changes) if changes else view


def mode_knobs(mode: str, lines: Mapping[str, LineValue]) -> dict[str, int]:
    """The settings of Orbit's or Deform's own light that lines of the plan set, by their names in the view."""
    return {KNOBS[line]: int(lines[line]) for line in MODE_LINES.get(mode, ()) if line in lines}


def effective_settings(view: ViewState, document: Document) -> RenderSettings:
    """The settings that transport is requested with; view: the result of `effective_view`."""
    lines = dict(document.overrides)
    keeps_sphere, overridden = bool(lines.get("sphere", True)), NEEDED_LINES & lines.keys()
    return RenderSettings(
        view.n_lights, view.n_patches, view.n_bounces, keeps_sphere, overridden, view.n_hemisphere_rays
    )


def override_lines_of(command: SetView, document: Document) -> tuple[OverrideLine | SetView, ...]:
    """The commands that set these settings of the view: where a line of the plan overrides one, that line is set,
    because the picture depends on it."""
    lines = {KNOBS[line]: line for line, _ in document.overrides if line in KNOBS}
    set_to = [(lines[name], value) for name, value in command.changes if name in lines and value is not None]
    by_line = [OverrideLine(line, None if value == 0 and line in ZERO_IS_PLANNED else value) for line, value in set_to]
    rest = tuple((name, value) for name, value in command.changes if name not in lines)
    return (*by_line, *([SetView(rest)] if rest else []))
