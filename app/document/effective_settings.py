"""What of a picture is decided: by a person, line by line in the document, else by the knobs of the view or the plan.

Everybody who computes a picture of a document, be it a mode's talk or a command, goes by `effective_view`.
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

# The knobs of the view that a line of the plan stands over.
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
    """The view with what the document's overruled lines have in the place of its knobs; the same one without any."""
    changes: dict[str, Any] = {KNOBS[line]: value for line, value in document.overrides if line in KNOBS}
    return replace(view, **changes) if changes else view


def mode_knobs(mode: str, lines: Mapping[str, LineValue]) -> dict[str, int]:
    """The knobs of Orbit's or Deform's own light that are set by lines of the plan, by their names in the view."""
    return {KNOBS[line]: int(lines[line]) for line in MODE_LINES.get(mode, ()) if line in lines}


def effective_settings(view: ViewState, document: Document) -> RenderSettings:
    """What transport is asked for with; view: as `effective_view` has it."""
    lines = dict(document.overrides)
    keeps_sphere, overridden = bool(lines.get("sphere", True)), NEEDED_LINES & lines.keys()
    return RenderSettings(
        view.n_lights, view.n_patches, view.n_bounces, keeps_sphere, overridden, view.n_hemisphere_rays
    )


def override_lines_of(command: SetView, document: Document) -> tuple[OverrideLine | SetView, ...]:
    """What sets some knobs of the view: of those that a line of the plan stands over that line, by which the picture
    goes."""
    lines = {KNOBS[line]: line for line, _ in document.overrides if line in KNOBS}
    set_to = [(lines[name], value) for name, value in command.changes if name in lines and value is not None]
    by_line = [OverrideLine(line, None if value == 0 and line in ZERO_IS_PLANNED else value) for line, value in set_to]
    rest = tuple((name, value) for name, value in command.changes if name not in lines)
    return (*by_line, *([SetView(rest)] if rest else []))
