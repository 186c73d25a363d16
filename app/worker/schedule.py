"""Schedules the worker: one long job and one quick one of each kind, all advanced step by step.

A job is the iterator that a handler returns; each `next` is one step, short enough (about 100 ms) that a new request is
noticed soon. Quick ones are served between the steps of a long one that is under way. There are no threads and no queue
but a place for the newest request of each kind, so old requests cannot pile up. Each class of request defines its kind
and which others it cancels (`messages.Request`). `InProcessClient` serves the same requests in this process, for
commands without a window and for most tests.
"""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from app.messages.worker_messages import CancelRequests, Request, RequestFailed, Response, with_numbers
from app.worker.client import PendingRequests
from engine.core.errors import InsituError

_log = logging.getLogger("insitu.jobs")
Steps = Iterator[Response | None]
Handlers = Mapping[type[Request], Callable[[Any], Steps]]


class RequestHandler(Protocol):
    """Does the work of requests. A step may yield None when it has no response; errors are raised.

    A quick request may be handled while a long one is suspended between two steps. A job that is cancelled is closed:
    GeneratorExit is raised where it is suspended.
    """

    def handle(self, request: Request) -> Steps: ...


class _Job:
    def __init__(self, request: Request, start: Callable[[Any], Steps]) -> None:
        self.request = request
        self._start = start
        self._steps: Steps | None = None

    @property
    def is_started(self) -> bool:
        return self._steps is not None

    def step(self) -> Response | None:
        """The next response or None; StopIteration when the job is done."""
        if self._steps is None:
            self._steps = iter(self._start(self.request))
        response = next(self._steps)
        if response is None:
            return None
        return with_numbers(response, response.id or self.request.id, self.request.revision)

    def close(self) -> None:
        close = getattr(self._steps, "close", None)
        if close is not None:
            try:
                close()
            except Exception:
                _log.exception("a cancelled job did not close")


class Schedule:
    """The jobs of one handler. `details` tells the user where the traceback of a defect is."""

    def __init__(self, handler: RequestHandler, details: str = "") -> None:
        self._handler = handler
        self._details = details
        self._queued: dict[type[Request], Request] = {}
        self._long: _Job | None = None
        self._quick: dict[type[Request], _Job] = {}

    def accept(self, request: Request) -> None:
        """Accept a request; it cancels the older of its kind and what was built on that."""
        self._cancel(request)
        if not isinstance(request, CancelRequests):
            self._queued[type(request)] = request

    def choose(self) -> Request | None:
        """The request that `step` will advance; None when there is nothing to do."""
        if self._long is None:
            long = [kind for kind in self._queued if kind.priority is None]
            kind = min(long, key=lambda kind: kind.depth(), default=None)
            self._long = None if kind is None else _Job(self._queued.pop(kind), self._handler.handle)
        for kind in [kind for kind in self._queued if kind.priority is not None and kind not in self._quick]:
            if self._serves(kind):
                self._quick[kind] = _Job(self._queued.pop(kind), self._handler.handle)
        job = self._chosen
        return job.request if job else None

    @property
    def _chosen(self) -> _Job | None:
        first = min(self._quick, key=lambda kind: kind.priority or 0, default=None)
        return self._long if first is None else self._quick[first]

    def step(self) -> Response | None:
        """Advance the chosen job by one step; an error in it becomes a RequestFailed and ends only that job."""
        if self.choose() is None:
            return None
        job = self._chosen
        assert job is not None
        try:
            return job.step()
        except StopIteration:
            self._finish(job)
            return None
        except Exception as error:
            return self.fail(error)

    def fail(self, error: Exception) -> RequestFailed:
        """End the job that was advanced last, and what was built on it, because of this error."""
        job = self._chosen
        assert job is not None
        self._cancel(job.request)
        line = _line_for(error, job.request, self._details)
        return RequestFailed(line, id=job.request.id, revision=job.request.revision)

    def _serves(self, kind: type[Request]) -> bool:
        """Whether nothing is under way that a quick kind waits for, such as the opening of a scene."""
        return self._long is None or (
            self._long.is_started and (kind.served_anytime or not self._long.request.exclusive)
        )

    def _finish(self, job: _Job) -> None:
        if self._quick.pop(type(job.request), None) is None:
            self._long = None

    def _cancel(self, request: Request) -> None:
        """Drop what this request makes void, when it is there or has failed."""
        self._queued = {kind: each for kind, each in self._queued.items() if not request.cancels(kind)}
        for job in (*self._quick.values(), self._long):
            if job is not None and request.cancels(type(job.request)):
                job.close()
                self._finish(job)


def _line_for(error: Exception, request: Request, details: str) -> str:
    """One line for the user; a defect of the program goes to the log with its traceback."""
    if isinstance(error, InsituError):
        return str(error)
    _log.error("%s failed", type(request).__name__, exc_info=error)
    if isinstance(error, MemoryError):
        return "out of memory; lower the resolution, the lights or the bands" + details
    return "the computation failed: a bug in Insitu. Undo the last edit to go on" + details


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
