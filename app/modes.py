"""The modes there are. The first is the one that a window opens with."""

from __future__ import annotations

from app.mode import Mode
from app.placement.talk import PlacementTalk

PLACEMENT = Mode("placement", "Placement", PlacementTalk, "app.jobs.placement:PlacementWork")
MODES = (PLACEMENT,)
