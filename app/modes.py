"""The modes there are. The first is the one that a window opens with."""

from __future__ import annotations

from app.mode import Mode
from app.placement.talk import PlacementTalk

PLACEMENT = Mode(
    "placement",
    "Placement",
    PlacementTalk,
    work="app.jobs.placement:PlacementWork",
    picture="ui.placement_feed:PlacementFeed",
    accuracy="ui.panels.accuracy_placement:draw",
)
MODES = (PLACEMENT,)
