"""Serves the same requests in this process: for commands without a window, and for most tests."""

from __future__ import annotations

import itertools
import time

from app.messages.worker_messages import Request, Response, with_numbers
from app.worker.pending_requests import PendingRequests
from app.worker.schedule import RequestHandler, Schedule


class InProcessClient:
    """Has the interface of `client.Client`; `poll` itself does the work, one step at least, until its budget is used
    up."""

    alive = True
    pid: int | None = None

    def __init__(self, handler: RequestHandler) -> None:
        self._schedule = Schedule(handler)
        self._pending = PendingRequests()
        self._ids = itertools.count(1)

    def send(self, request: Request) -> int:
        request = with_numbers(request, request.id or next(self._ids), request.revision)
        self._pending.add(request)
        self._schedule.accept(request)
        return request.id

    def poll(self, budget_s: float = 0.004) -> list[Response]:
        deadline = time.monotonic() + budget_s
        responses = []
        while self._schedule.choose() is not None:
            response = self._schedule.step()
            if response is not None:
                self._pending.settle(response)
                responses.append(response)
            if time.monotonic() >= deadline:
                break
        return responses

    @property
    def arriving(self) -> bool:
        """Always False: responses are handed over whole."""
        return False

    def wait(self, timeout_s: float) -> bool:
        """Whether `poll` has something to do; there is no other process to wait for."""
        return self._schedule.choose() is not None

    def close(self) -> None:
        """Does nothing: there is no process to end."""
