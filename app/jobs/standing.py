"""The requests that stand: the newest of each kind, whose answers count and which a new worker is given again.

A request of one kind replaces the older of that kind and what was built on it: a scene the transport, a transport the
contraction and the freezing. An answer to a request that no longer stands is stale. Each worker is sent each of them
once; but a scene that stands again, where the one after it was refused or cancelled, once more to a worker that has not
opened it: what came after it made that worker give it up.
"""

from __future__ import annotations

from app.jobs.messages import Cancel, Failed, Noted, OpenScene, Progress, Request, Response, SceneOpened


class Standing:
    """At most one request of each kind; a scene that fails to open leaves the one opened before it standing."""

    def __init__(self) -> None:
        self._requests: dict[type[Request], Request] = {}
        self._opened: Request | None = None  # the last scene that did open
        self._sent: set[int] = set()  # what the present worker was sent
        self._open_here = 0  # the scene that it has open

    def add(self, request: Request) -> None:
        """Note a request that is sent now."""
        self._clear(request)
        if not isinstance(request, Cancel):
            self._requests[type(request)] = request
        elif request.cancels(OpenScene):
            self._fall_back()

    def new_worker(self) -> None:
        """Another worker, which was sent nothing."""
        self._sent.clear()
        self._open_here = 0

    def to_send(self) -> list[Request]:
        """What the present worker is to be sent now, in order; it counts as sent."""
        unsent = [request for request in self.requests() if request.id not in self._sent]
        self._sent.update(request.id for request in unsent)
        return unsent

    def heard(self, response: Response) -> None:
        """Note an answer of the present worker, current or not."""
        if isinstance(response, SceneOpened):
            self._open_here = response.id

    def is_current(self, response: Response) -> bool:
        """Whether it still counts; what is said of the cache is true whatever was asked since."""
        return isinstance(response, Noted) or any(request.id == response.id for request in self._requests.values())

    def settle(self, response: Response) -> None:
        """Note a current answer: a request that failed, or was answered once and for all, stands no longer."""
        if isinstance(response, SceneOpened):
            self._opened = self._requests[OpenScene]
        elif isinstance(response, Failed) or self._answers_once(response):
            self.drop(response.id)

    def drop(self, id: int) -> None:
        """Give up the request of this number and what was built on it."""
        for request in list(self._requests.values()):
            if request.id == id:
                self._clear(request)
                if request is self._opened:
                    self._opened = None
                if isinstance(request, OpenScene):
                    self._fall_back()

    def requests(self) -> list[Request]:
        """In the order in which a new worker needs them."""
        return sorted(self._requests.values(), key=lambda request: (request.quick or 0, request.depth()))

    def _clear(self, request: Request) -> None:
        """Give up what is void with this request."""
        self._requests = {kind: each for kind, each in self._requests.items() if not request.cancels(kind)}

    def _answers_once(self, response: Response) -> bool:
        """Whether it is the whole answer to its request."""
        if isinstance(response, Progress | Noted):
            return False
        return any(request.once and request.id == response.id for request in self._requests.values())

    def _fall_back(self) -> None:
        """Let the scene that was opened last stand, and none that is not open."""
        self._requests.pop(OpenScene, None)
        if self._opened is None:
            return
        self._requests[OpenScene] = self._opened
        if self._opened.id != self._open_here:
            self._sent.discard(self._opened.id)
