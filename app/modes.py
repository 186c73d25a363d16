"""The modes there are. The first is the one that a window opens with."""

from __future__ import annotations

from app.deform.deform_controller import DeformController
from app.mode import Mode
from app.orbit.orbit_controller import OrbitController
from app.placement.placement_controller import PlacementController

PLACEMENT = Mode(
    "placement",
    "Placement",
    PlacementController,
    worker="app.jobs.placement_worker:PlacementWorker",
    picture="ui.placement_feed:PlacementFeed",
    tooltip="Exact light and shadows from this camera; edits follow the hand.",
    accuracy="ui.panels.accuracy_placement:draw",
)
ORBIT = Mode(
    "orbit",
    "Orbit",
    OrbitController,
    worker="app.jobs.orbit_worker:OrbitWorker",
    picture="ui.orbit_feed:OrbitFeed",
    tooltip="Move the camera under the full light; Placement takes over when it rests.",
    accuracy="ui.panels.accuracy_orbit:draw",
)
DEFORM = Mode(
    "deform",
    "Deform",
    DeformController,
    worker="app.jobs.deform_worker:DeformWorker",
    picture="ui.deform_feed:DeformFeed",
    tooltip="Bend and animate objects under soft light and shadows.",
    accuracy="ui.panels.accuracy_deform:draw",
    tools="ui.panels.deformers:draw",
    strip="ui.panels.timeline:draw",
    handles="ui.panels.deform_handles:handles",
)
MODES = (PLACEMENT, ORBIT, DEFORM)
