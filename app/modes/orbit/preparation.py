"""Requests that the worker makes ready what pictures are drawn of, coarse first."""

from __future__ import annotations

from collections.abc import Callable

from app.messages.worker_messages import Request
from app.modes.orbit.desired_state import DesiredOrbit, ReadyState
from app.modes.orbit.orbit_drawing import OrbitDrawing
from app.modes.orbit.orbit_messages import OrbitProgress
from app.modes.reconciler import Reconciler


class Preparation:
    """What is prepared of a scene. send: sends a request; drawing: makes it.

    ready: how much is ready of the last request that pictures were drawn of, which may be an older one; n_bytes: of
    memory held for it.
    """

    def __init__(self, send: Callable[[Request], int], drawing: OrbitDrawing) -> None:
        self._send, self._drawing = send, drawing
        self._reconciler = Reconciler[DesiredOrbit, ReadyState](replaces=True)
        self.forget()

    def forget(self) -> None:
        """What was ready is lost, and requests will not be answered: another scene is open, or the worker has died."""
        self._reconciler.clear()
        self.ready, self.n_bytes = ReadyState(), 0

    @property
    def id(self) -> int:
        """The number of the newest request; 0 where there is none whose response would count."""
        return 0 if self._reconciler.requested is None else self._reconciler.requested.id

    @property
    def requested(self) -> DesiredOrbit | None:
        """The state that was requested last, and is not to be requested again."""
        return None if self._reconciler.requested is None else self._reconciler.requested.desired

    @property
    def is_ready(self) -> bool:
        """Whether all is ready that the last request needs."""
        return self.ready.is_done and self.ready.prepared == self.id

    @property
    def is_running(self) -> bool:
        """Whether a request is under way."""
        return self._reconciler.is_under_way

    def update(self, now: float, desired: DesiredOrbit, may_request: bool) -> None:
        """Request what is desired."""
        self._reconciler.desire(now, desired)
        if self._reconciler.action(now, may_request) == "request":
            self._reconciler.sent(now, self._send(self._drawing.preparation(desired)))

    def stop(self) -> None:
        """The user stopped the work: what is desired is not requested again before a restart."""
        self._reconciler.stop()

    def restart(self) -> None:
        """Request again what is desired, even if it is ready or under way."""
        self._reconciler.restart()

    def resume(self) -> None:
        """Request again what was not completed: a newly traced view has cancelled it."""
        if not self.is_ready:
            self.restart()

    def receive(self, response: OrbitProgress) -> bool:
        """Note how much is ready; returns whether it is of the newest request."""
        if response.id != self.id:
            return False
        self.note_ready(ReadyState(response.id, response.version, response.is_done, response.follows_move))
        self.n_bytes = response.n_bytes
        return True

    def note_ready(self, known: ReadyState) -> None:
        """Note how much is ready of the newest request. Where that was all there, a picture needs what no picture has
        used before: it is still to be prepared."""
        if self.is_ready and not known.is_done:
            self._reconciler.restart()
        self.ready = known
        self._reconciler.receive(self.id, known, known.is_done)

    def receive_failure(self, id: int) -> DesiredOrbit | None:
        """Note that a request failed; returns the state that cannot be prepared, None where it is not the newest."""
        requested = self._reconciler.requested
        if requested is None or requested.id != id:
            return None
        self._reconciler.fail(id)
        return requested.desired
