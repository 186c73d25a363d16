"""What the worker does next: one long job and one quick one of each kind, all advanced step by step.

A job is the iterator that a handler returns; each `next` is one step, short enough (about 100 ms) that a new request is
noticed soon. A contraction is quick, and so are a freezing, the planning of bands and the sampling of images: they are
served between the steps of a transport that is under way. There are no threads and no queue but nine places, one for
the newest request of each kind, so an old request cannot pile up.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from app.jobs.messages import (
    Cancel,
    ComputeTransport,
    Contract,
    Failed,
    Freeze,
    HandOutTable,
    OpenScene,
    PlanBands,
    ReadMeasured,
    Request,
    Response,
    SampleMaps,
    WriteFiles,
    stamped,
)
from engine.errors import InsituError

_log = logging.getLogger("insitu.jobs")
Steps = Iterator[Response | None]

_CANCELS: dict[type[Request], tuple[type[Request], ...]] = {
    Cancel: (OpenScene, ComputeTransport, Contract, Freeze, ReadMeasured, WriteFiles),
    OpenScene: (OpenScene, ComputeTransport, Contract, Freeze, ReadMeasured, WriteFiles, SampleMaps),
    ComputeTransport: (ComputeTransport, Contract, Freeze),
    Contract: (Contract,),
    Freeze: (Freeze,),
    PlanBands: (PlanBands,),
    ReadMeasured: (ReadMeasured,),
    HandOutTable: (HandOutTable,),
    WriteFiles: (WriteFiles,),
    SampleMaps: (SampleMaps,),
}
# The first goes first.
_QUICK: tuple[type[Request], ...] = (PlanBands, SampleMaps, Contract, Freeze, HandOutTable, ReadMeasured, WriteFiles)


class Handlers(Protocol):
    """What does the work. A step may yield None when it has nothing to tell; errors are raised.

    `quick` answers any other request and may be called while a `handle` of ComputeTransport is
    suspended between two steps: when that is not far enough yet, it notes the wish, yields nothing, and the transport
    answers later.
    A job that is cancelled is closed: GeneratorExit is raised where it is suspended.
    """

    def handle(self, request: Request) -> Steps: ...

    def quick(
        self, request: PlanBands | SampleMaps | Contract | Freeze | HandOutTable | ReadMeasured | WriteFiles
    ) -> Steps: ...


class _Job:
    def __init__(self, request: Request, start: Callable[[Any], Steps]) -> None:
        self.request = request
        self._start = start
        self._steps: Steps | None = None

    @property
    def begun(self) -> bool:
        return self._steps is not None

    def step(self) -> Response | None:
        """The next answer or None; StopIteration when the job is done."""
        if self._steps is None:
            self._steps = iter(self._start(self.request))
        response = next(self._steps)
        if response is None:
            return None
        return stamped(response, response.id or self.request.id, self.request.revision)

    def close(self) -> None:
        close = getattr(self._steps, "close", None)
        if close is not None:
            try:
                close()
            except Exception:
                _log.exception("a cancelled job did not close")


class Schedule:
    """The jobs of one set of handlers. `details` tells a person where the traceback of a defect is."""

    def __init__(self, handlers: Handlers, details: str = "") -> None:
        self._handlers = handlers
        self._details = details
        self._waiting: dict[type[Request], Request] = {}
        self._long: _Job | None = None
        self._quick: dict[type[Request], _Job] = {}

    def accept(self, request: Request) -> None:
        """Take a request in; it cancels the older of its kind and what was built on that."""
        self._cancel(_CANCELS[type(request)])
        if not isinstance(request, Cancel):
            self._waiting[type(request)] = request

    def choose(self) -> Request | None:
        """The request that `step` will advance; None when there is nothing to do."""
        if self._long is None:
            request = self._waiting.pop(OpenScene, None) or self._waiting.pop(ComputeTransport, None)
            self._long = _Job(request, self._handlers.handle) if request else None
        for kind in _QUICK:
            if kind not in self._quick and kind in self._waiting and self._may_contract():
                self._quick[kind] = _Job(self._waiting.pop(kind), self._handlers.quick)
        job = self._chosen
        return job.request if job else None

    @property
    def _chosen(self) -> _Job | None:
        return next((self._quick[kind] for kind in _QUICK if kind in self._quick), self._long)

    def step(self) -> Response | None:
        """Advance the chosen job by one step; an error in it becomes a Failed answer and ends that job alone."""
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

    def fail(self, error: Exception) -> Failed:
        """End the job that was advanced last, and what was built on it, because of this error."""
        job = self._chosen
        assert job is not None
        self._cancel(_CANCELS[type(job.request)])
        line = _line_for(error, job.request, self._details)
        return Failed(line, id=job.request.id, revision=job.request.revision)

    def _may_contract(self) -> bool:
        """A quick job waits until its scene is open and the transport it belongs to has begun."""
        if self._long is None:
            return True
        return isinstance(self._long.request, ComputeTransport) and self._long.begun

    def _finish(self, job: _Job) -> None:
        if self._quick.pop(type(job.request), None) is None:
            self._long = None

    def _cancel(self, kinds: tuple[type[Request], ...]) -> None:
        for kind in kinds:
            self._waiting.pop(kind, None)
        for job in (*self._quick.values(), self._long):
            if job is not None and type(job.request) in kinds:
                job.close()
                self._finish(job)


def _line_for(error: Exception, request: Request, details: str) -> str:
    """One line for the person; what is no fault of theirs goes to the log with its traceback."""
    if isinstance(error, InsituError):
        return str(error)
    _log.error("%s failed", type(request).__name__, exc_info=error)
    if isinstance(error, MemoryError):
        return "out of memory; lower the resolution, the lights or the bands" + details
    return "the computation failed: a defect of Insitu. Undo the last edit to go on" + details
