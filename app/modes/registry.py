"""The list of modes. The window opens with the first."""

from __future__ import annotations

from app.modes.mode import Mode

PLACEMENT = Mode(
    "placement",
    "Placement",
    "app.modes.placement.placement_controller:PlacementController",
    worker="app.worker.placement_worker:PlacementWorker",
    picture="ui.modes.placement.placement_feed:PlacementFeed",
    tooltip="Exact light and shadows from this camera; edits show at once.",
    accuracy="ui.modes.placement.accuracy_placement:draw",
)
ORBIT = Mode(
    "orbit",
    "Orbit",
    "app.modes.orbit.orbit_controller:OrbitController",
    worker="app.worker.orbit_worker:OrbitWorker",
    picture="ui.modes.orbit.orbit_feed:OrbitFeed",
    tooltip="Move the camera under the full light; Placement takes over when idle.",
    accuracy="ui.modes.orbit.accuracy_orbit:draw",
)
DEFORM = Mode(
    "deform",
    "Deform",
    "app.modes.deform.deform_controller:DeformController",
    worker="app.worker.deform_worker:DeformWorker",
    picture="ui.modes.deform.deform_feed:DeformFeed",
    tooltip="Bend and animate objects under soft light and shadows.",
    accuracy="ui.modes.deform.accuracy_deform:draw",
    tools="ui.modes.deform.deformers_panel:draw",
    strip="ui.panels.timeline:draw",
    handles="ui.modes.deform.deform_handles:handles",
)
MODES = (PLACEMENT, ORBIT, DEFORM)
