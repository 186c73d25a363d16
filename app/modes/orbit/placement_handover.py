"""Placement's picture of an idle view, which follows that of a mode whose pictures the worker draws.

Placement's controller is held back until that picture is complete, and again as soon as it could not keep up: neither
mode's files depend on what the other requests. Rejected: to switch the mode when idle, which would change the session
with every pause of the user.
"""

from __future__ import annotations

from app.document.document import Document
from app.document.view_state import ViewState
from app.messages.editor_status import Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import CancelRequests
from app.modes.mode import EditorServices
from app.modes.placement.placement_controller import PlacementController
from app.modes.placement.placement_messages import ComputeTransport


class PlacementHandover:
    """Placement's part. placement: its controller; is_active: whether it computes the picture of the view, or has it;
    follows: whether its picture is the document's, and follows edits; is_held_back: whether that is not to come on
    screen yet, because shadow catchers in it are still shown as objects; is_shown: whether it is on screen."""

    def __init__(self, services: EditorServices) -> None:
        self._services = services
        self.placement = PlacementController(services)
        self.is_held_back = False
        self.forget()

    def forget(self) -> None:
        """Placement has no picture: another scene or view was opened."""
        self.is_active = self.follows = self.is_shown = False

    def begin(self) -> None:
        """Let Placement compute the picture of the view."""
        self.is_active = True
        self.placement.view_restored()

    def hold_back(self) -> None:
        """Stop Placement's requests until the other picture is complete again."""
        if self.is_active:
            self.is_active = self.follows = False
            self.placement.scene_closed()
            self._services.send(CancelRequests(of=(ComputeTransport,)))

    def picture_shown(self) -> None:
        """The other picture is on screen: over it Placement's only if it follows."""
        self.is_shown = self.follows and not self.is_held_back

    def update(self, now: float, document: Document, view: ViewState, is_requested: bool) -> list[PictureEvent]:
        """Update Placement, where it is active; it is held back as soon as its picture is not the document's. That
        picture stays on screen until there is another. is_requested: whether the document's scene was requested of the
        other mode; Placement may have planned the number of bounces since."""
        if not self.is_active:
            return []
        events = self.placement.update(now, document, view)
        picture = self.placement.status(Status()).picture
        followed, is_finished = self.follows, picture in ("finished", "exact")
        self.follows = is_finished or followed and picture == "refining"
        self.is_shown |= self.follows and not self.is_held_back
        if not self.follows and (followed or not is_requested):
            self.hold_back()
        return events
