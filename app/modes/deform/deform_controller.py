"""Deform's controller: Orbit's, with another drawing.

As in Orbit, the worker draws a picture for each frame in which something moves, and Placement takes over once the view
is idle: the worker traces the scene in its new pose, as it traces a new view.
"""

from __future__ import annotations

from app.modes.deform.deform_drawing import DeformDrawing
from app.modes.mode import EditorServices
from app.modes.orbit.orbit_controller import OrbitController
from engine.realtime.core.gpu_parts import Numbers


class DeformController(OrbitController):
    """The controller of Deform."""

    def __init__(self, services: EditorServices) -> None:
        self._deform = DeformDrawing()
        super().__init__(services, self._deform)

    def draw_in_window(self, most_bytes: int) -> None:
        """From now on the window draws moving pictures itself; 0: the worker does."""
        self._deform.draw_in_window(most_bytes)

    def resend_parts(self, known: Numbers) -> None:
        """Send parts again: the window could not draw its last picture from these alone."""
        self._deform.resend_parts(known)
        self.draw_again()
