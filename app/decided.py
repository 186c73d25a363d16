"""What of a picture is decided: by a person, line by line in the document, else by the knobs of the view or the plan.

Everybody who computes a picture of a document, be it a mode's talk or a command, goes by `decided_view`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from app.document import Document
from app.view_state import ViewState
from engine.plan import NEEDED_LINES, Decisions

# The knobs of the view that a line of the plan stands over.
KNOBS = {
    "lights": "n_lights",
    "patches": "n_patches",
    "bounces": "n_bounces",
    "edges": "n_edge_rays",
    "precision": "precision",
}


def decided_view(view: ViewState, document: Document) -> ViewState:
    """The view with what the document's overruled lines have in the place of its knobs; the same one without any."""
    changes: dict[str, Any] = {KNOBS[line]: value for line, value in document.overrules if line in KNOBS}
    return replace(view, **changes) if changes else view


def decisions_of(view: ViewState, document: Document) -> Decisions:
    """What transport is asked for with; view: as `decided_view` has it."""
    lines = dict(document.overrules)
    keeps_sphere, overruled = bool(lines.get("sphere", True)), NEEDED_LINES & lines.keys()
    n_rays = int(lines.get("rays", 0))
    return Decisions(view.n_lights, view.n_patches, view.n_bounces, keeps_sphere, overruled, n_rays)
