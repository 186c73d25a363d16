"""The real worker in this process, late: a command comes after any step of it, its answers lie about for a while before
they are taken, and it can be killed between two of them."""

from __future__ import annotations

import numpy as np

from app.messages.worker_messages import CancelRequests, Request, RequestFailed, Response, WorkerRestarted, with_numbers
from app.worker.cache import ArrayCache
from app.worker.client import PendingRequests
from app.worker.schedule import Schedule
from app.worker.tasks import RequestDispatcher


class LateClient:
    """As `Client`, but the worker takes a few steps a poll, and what it answers lies about before it is taken."""

    alive, pid, arriving = True, None, False

    def __init__(self, random: np.random.Generator, store: ArrayCache) -> None:
        self._random, self._store = random, store
        self._schedule, self._standing = Schedule(RequestDispatcher(store)), PendingRequests()
        self._late: list[Response] = []
        self._n_sent = 0
        self.hurries = False

    def send(self, request: Request) -> int:
        self._n_sent += 1
        request = with_numbers(request, self._n_sent, request.revision)
        self._standing.add(request)
        if isinstance(request, CancelRequests):
            self._schedule.accept(request)
        self._post_pending()
        return request.id

    def poll(self, budget_s: float = 0.004) -> list[Response]:
        for _ in range(60 if self.hurries else int(self._random.integers(0, 6))):
            if self._schedule.choose() is None:
                break
            if (response := self._schedule.step()) is not None:
                self._late.append(response)
        n = len(self._late) if self.hurries else int(self._random.integers(0, len(self._late) + 1))
        taken, self._late = self._late[:n], self._late[n:]
        return [response for response in taken if self._counts(response)]

    def kill(self, store: ArrayCache | None = None) -> None:
        """The process dies: of what it has sent a part is still read, and another one is given what stands; store: and
        another cache."""
        self._store = store or self._store
        self._late = [*self._late[: int(self._random.integers(0, len(self._late) + 1))], WorkerRestarted("killed")]
        self._schedule = Schedule(RequestDispatcher(self._store))
        self._standing.worker_restarted()
        self._post_pending()

    def close(self) -> None:
        """Nothing to end."""

    def _counts(self, response: Response) -> bool:
        if isinstance(response, WorkerRestarted):
            return True
        self._standing.note_response(response)
        if not self._standing.is_current(response):
            return False
        self._standing.settle(response)
        if isinstance(response, RequestFailed):
            self._post_pending()
        return True

    def _post_pending(self) -> None:
        for request in self._standing.unsent():
            self._schedule.accept(request)
