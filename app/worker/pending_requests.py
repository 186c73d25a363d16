"""The pending requests: the newest of each kind, whose responses count and which a new worker gets again.

A request of one kind replaces the older of that kind and what was built on it: a scene replaces its view, a view the
transport, a transport the contraction and the freezing. A response to a request that is no longer pending is stale.
Each worker is sent each of them once; but a scene and its view that are pending again, because those after them were
refused or cancelled, are sent once more to a worker that has dropped them for what came after.
"""

from __future__ import annotations

from app.messages.worker_messages import (
    CancelRequests,
    OpenScene,
    Progress,
    Request,
    RequestFailed,
    Response,
    SetCamera,
    ViewTraced,
    WorkerWarnings,
)


class PendingRequests:
    """At most one request of each kind; a scene that fails to open, or a view that fails, leaves the one before
    pending."""

    def __init__(self) -> None:
        self._requests: dict[type[Request], Request] = {}
        self._traced: dict[type[Request], Request] = {}  # the scene that was traced last, and its view
        self._sent: set[int] = set()  # what the present worker was sent
        self._traced_here = 0  # the view that it has traced

    def add(self, request: Request) -> None:
        """Note a request that is sent now."""
        self._clear(request)
        if not isinstance(request, CancelRequests):
            self._requests[type(request)] = request
        elif request.cancels(SetCamera):
            self._restore_last_view()

    def worker_restarted(self) -> None:
        """Note that there is a new worker, which was sent nothing."""
        self._sent.clear()
        self._traced_here = 0

    def unsent(self) -> list[Request]:
        """The requests to send to the present worker now, in order; they count as sent."""
        unsent = [request for request in self.requests() if request.id not in self._sent]
        self._sent.update(request.id for request in unsent)
        return unsent

    def note_response(self, response: Response) -> None:
        """Note a response of the present worker, current or not."""
        if isinstance(response, ViewTraced):
            self._traced_here = response.id

    def is_current(self, response: Response) -> bool:
        """Whether it is still current; warnings about the cache are, whatever was requested since."""
        return isinstance(response, WorkerWarnings) or any(
            request.id == response.id for request in self._requests.values()
        )

    def settle(self, response: Response) -> None:
        """Note a current response: a request that failed, or was answered completely, is no longer pending."""
        if isinstance(response, ViewTraced):
            self._traced = {kind: each for kind, each in self._requests.items() if kind in (OpenScene, SetCamera)}
        elif isinstance(response, RequestFailed) or self._is_complete_answer(response):
            self.drop(response.id)

    def drop(self, id: int) -> None:
        """Drop the request of this number and what was built on it."""
        for request in list(self._requests.values()):
            if request.id == id:
                self._clear(request)
                if request in self._traced.values():
                    self._traced = {}
                if isinstance(request, OpenScene | SetCamera):
                    self._restore_last_view()

    def requests(self) -> list[Request]:
        """The requests in the order in which a new worker needs them."""
        return sorted(self._requests.values(), key=lambda request: (request.priority or 0, request.depth()))

    def _clear(self, request: Request) -> None:
        """Drop what this request makes void."""
        self._requests = {kind: each for kind, each in self._requests.items() if not request.cancels(kind)}

    def _is_complete_answer(self, response: Response) -> bool:
        """Whether it is the complete response to its request."""
        if isinstance(response, Progress | WorkerWarnings):
            return False
        return any(request.answered_once and request.id == response.id for request in self._requests.values())

    def _restore_last_view(self) -> None:
        """Make the scene that was traced last pending again, with its view, and none that is not open."""
        for kind in (OpenScene, SetCamera):
            self._requests.pop(kind, None)
        self._requests |= self._traced
        if self._traced and self._traced[SetCamera].id != self._traced_here:
            self._sent -= {request.id for request in self._traced.values()}
