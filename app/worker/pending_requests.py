"""The requests that stand: the newest of each kind, whose answers count and which a new worker is given again.

A request of one kind replaces the older of that kind and what was built on it: a scene the look at it, a look the
transport, a transport the contraction and the freezing. An answer to a request that no longer stands is stale. Each
worker is sent each of them once; but a scene and the look at it that stand again, where those after them were refused
or cancelled, once more to a worker that does not see it so: what came after made that worker give it up.
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
    """At most one request of each kind; a scene that fails to open, or a look that fails, leaves those before
    standing."""

    def __init__(self) -> None:
        self._requests: dict[type[Request], Request] = {}
        self._traced: dict[type[Request], Request] = {}  # the scene that was seen last, and the look at it
        self._sent: set[int] = set()  # what the present worker was sent
        self._traced_here = 0  # the look that it has taken

    def add(self, request: Request) -> None:
        """Note a request that is sent now."""
        self._clear(request)
        if not isinstance(request, CancelRequests):
            self._requests[type(request)] = request
        elif request.cancels(SetCamera):
            self._restore_last_view()

    def worker_restarted(self) -> None:
        """Another worker, which was sent nothing."""
        self._sent.clear()
        self._traced_here = 0

    def unsent(self) -> list[Request]:
        """What the present worker is to be sent now, in order; it counts as sent."""
        unsent = [request for request in self.requests() if request.id not in self._sent]
        self._sent.update(request.id for request in unsent)
        return unsent

    def note_response(self, response: Response) -> None:
        """Note an answer of the present worker, current or not."""
        if isinstance(response, ViewTraced):
            self._traced_here = response.id

    def is_current(self, response: Response) -> bool:
        """Whether it still counts; what is said of the cache is true whatever was asked since."""
        return isinstance(response, WorkerWarnings) or any(
            request.id == response.id for request in self._requests.values()
        )

    def settle(self, response: Response) -> None:
        """Note a current answer: a request that failed, or was answered once and for all, stands no longer."""
        if isinstance(response, ViewTraced):
            self._traced = {kind: each for kind, each in self._requests.items() if kind in (OpenScene, SetCamera)}
        elif isinstance(response, RequestFailed) or self._is_complete_answer(response):
            self.drop(response.id)

    def drop(self, id: int) -> None:
        """Give up the request of this number and what was built on it."""
        for request in list(self._requests.values()):
            if request.id == id:
                self._clear(request)
                if request in self._traced.values():
                    self._traced = {}
                if isinstance(request, OpenScene | SetCamera):
                    self._restore_last_view()

    def requests(self) -> list[Request]:
        """In the order in which a new worker needs them."""
        return sorted(self._requests.values(), key=lambda request: (request.priority or 0, request.depth()))

    def _clear(self, request: Request) -> None:
        """Give up what is void with this request."""
        self._requests = {kind: each for kind, each in self._requests.items() if not request.cancels(kind)}

    def _is_complete_answer(self, response: Response) -> bool:
        """Whether it is the whole answer to its request."""
        if isinstance(response, Progress | WorkerWarnings):
            return False
        return any(request.answered_once and request.id == response.id for request in self._requests.values())

    def _restore_last_view(self) -> None:
        """Let the scene that was seen last stand, as it was seen, and none that is not open."""
        for kind in (OpenScene, SetCamera):
            self._requests.pop(kind, None)
        self._requests |= self._traced
        if self._traced and self._traced[SetCamera].id != self._traced_here:
            self._sent -= {request.id for request in self._traced.values()}
