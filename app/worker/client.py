"""The window's side of the process boundary: send requests, poll for responses, never block, never lose the worker.

No threads: the window calls `poll` once a frame. A worker that dies, hangs or sends something damaged is replaced in
the same call and gets the pending requests again (all of them may be repeated: the responses are values); a
WorkerRestarted among the responses says so. A request on which the worker dies again and again is given up.

A request of one kind replaces the older of that kind and what was built on it: a scene replaces its view, a view the
transport, a transport the contraction and the freezing. A response to a request that is no longer pending is stale.
Each worker is sent each of them once; but a scene and its view that are pending again, because those after them were
refused or cancelled, are sent once more to a worker that has dropped them for what came after.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from types import TracebackType
from typing import Self

from app.messages.worker_messages import (
    CancelRequests,
    Heartbeat,
    OpenScene,
    Request,
    RequestFailed,
    Response,
    SetCamera,
    Shutdown,
    ViewTraced,
    WorkerRestarted,
    WorkerWarnings,
    with_numbers,
)
from app.worker.channel import ChannelClosed, ChannelError
from app.worker.process import HEARTBEAT_SECONDS, TASKS, StartedWorker, WorkerProcess, start_worker
from app.worker.shared_arrays import BlockError, Method, OutOfMemory

_MAX_CRASHES = 3  # in succession on one request
_START_TIMEOUT = 30.0  # seconds for the first sign of life: a cold disk, a busy machine
_GRACE = 0.5  # seconds for a worker to end by itself


class _CrashCounter:
    """How often in succession the worker died on the same request (0: before it could take any)."""

    def __init__(self) -> None:
        self._id: int | None = None
        self._n_crashes = 0
        self._begun = False

    def crashed(self, beat: Heartbeat) -> int:
        """Count a crash; an idle worker's belongs to no request."""
        self._begun = False
        if beat.state == "idle":
            return 0
        self._n_crashes = self._n_crashes + 1 if beat.id == self._id else 1
        self._id = beat.id
        return self._n_crashes

    def note(self, beat: Heartbeat) -> None:
        """Reset the count of a request that was begun again and has finished."""
        if beat.state == "busy" and beat.id == self._id:
            self._begun = True
        if beat.state == "idle" and (self._begun or self._id == 0):
            self._id = None


class Client:
    """A worker process and its pending requests; the worker starts at once and imports while the window opens.

    Create it in the thread that lives longest: on Linux the worker dies with the thread that started it. handlers:
    `module:name` of what makes the object that does the work; hang_timeout: seconds without a sign of life before the
    worker is replaced; heartbeat: seconds between signs of life; method: where shared blocks are (see `shared_arrays`);
    started: the first worker, where it was started before, with the same settings.
    """

    def __init__(
        self,
        handlers: str = TASKS,
        *,
        hang_timeout: float = 10.0,
        heartbeat: float = HEARTBEAT_SECONDS,
        method: Method | None = None,
        started: StartedWorker | None = None,
    ) -> None:
        self._command = (handlers, heartbeat, method)
        self._hang_timeout = hang_timeout
        self._ids = itertools.count(1)
        self._pending = PendingRequests()
        self._blame = _CrashCounter()
        self._due: list[Response] = []
        self._dying: list[WorkerProcess] = []
        self._process: WorkerProcess | None = None
        self._closed = False
        self._gave_up = False  # the worker has reported that it cannot start
        self._has_spoken = False  # whether this worker has given a sign of life
        self._beat = Heartbeat("starting")
        self._polled = self._heard = time.monotonic()
        self._start(started)

    @property
    def pid(self) -> int | None:
        """The worker's process id, None when there is no worker."""
        return self._process.pid if self._process else None

    @property
    def alive(self) -> bool:
        return self._process is not None

    @property
    def busy(self) -> bool:
        """Whether the worker, by its last heartbeat, is at work or still starting."""
        return self.alive and self._beat.state != "idle"

    def send(self, request: Request) -> int:
        """Send a request without waiting; returns the number its responses will carry. Leave `request.id` out.

        A worker that was given up is started again.
        """
        if self._closed:
            raise ValueError("the client is closed")
        request = with_numbers(request, request.id or next(self._ids), request.revision)
        self._pending.add(request)
        if self._process is None:
            self._start()
            return request.id
        if isinstance(request, CancelRequests):
            self._post(request)
        self._post_pending()
        return request.id

    def poll(self, budget_s: float = 0.004) -> list[Response]:
        """The responses that have arrived and are not stale; takes at most about `budget_s` seconds."""
        responses, self._due = self._due, []
        self._dying = [process for process in self._dying if not process.reaped()]
        if self._process is None:
            return responses
        now = time.monotonic()
        if now - self._polled > self._hang_timeout / 2:  # this process was stopped: silence proves nothing
            self._heard = now
        self._polled = now
        try:
            self._exchange(self._process, now + budget_s, responses)
        except ChannelClosed:
            self._replace(self._process.how_it_ended(), responses)
        except (ChannelError, BlockError) as error:
            self._replace(f"it sent {error}", responses)
        return responses

    @property
    def arriving(self) -> bool:
        """Whether a response is here that `poll` had no time to check to its end."""
        return self._process is not None and self._process.channel.is_checking

    def wait(self, timeout_s: float) -> bool:
        """Sleep until the worker has sent something, `timeout_s` at most; returns whether it has. For commands without
        a window."""
        if self._due or self._process is None:
            return bool(self._due)
        with contextlib.suppress(ChannelClosed):
            self._process.channel.flush()
        return self._process.channel.wait(timeout_s)

    def close(self) -> None:
        """End the worker; at most about half a second."""
        self._closed = True
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(ChannelClosed):
                process.channel.post(Shutdown())
                process.channel.flush()
            process.end(_GRACE)
            self._dying.append(process)
        for dying in self._dying:
            dying.wait_until_gone(_GRACE)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _exchange(self, process: WorkerProcess, deadline: float, responses: list[Response]) -> None:
        """Send what waits, receive what has come, and check whether the worker hangs."""
        process.channel.flush()
        while (message := process.channel.receive(deadline)) is not None:
            self._heard = self._polled
            self._has_spoken = True
            self._take(message, responses)
            if time.monotonic() >= deadline:
                return
        if process.channel.wait(0):
            self._heard = self._polled
        elif self._polled - self._heard > self._patience:
            self._replace(f"it did not answer for {self._patience:g} s", responses)

    @property
    def _patience(self) -> float:
        """Seconds of silence after which the worker counts as hung."""
        return self._hang_timeout if self._has_spoken else max(self._hang_timeout, _START_TIMEOUT)

    def _take(self, message: object, responses: list[Response]) -> None:
        if isinstance(message, Heartbeat):
            self._beat = message
            self._blame.note(message)
        elif isinstance(message, RequestFailed) and message.id == 0:  # it cannot start
            self._gave_up = True
            responses.append(message)
        elif isinstance(message, Response):
            self._pending.note_response(message)
            if self._pending.is_current(message):
                self._pending.settle(message)
                responses.append(message)
            if isinstance(message, RequestFailed):
                self._post_pending()  # the scene that is pending again may be one that this worker has not opened

    def _replace(self, reason: str, responses: list[Response]) -> None:
        """Replace a worker that died or hangs, unless it would die again and again."""
        assert self._process is not None
        self._process.end(0)
        self._dying.append(self._process)
        self._process = None
        beat, n_crashes = self._beat, self._blame.crashed(self._beat)
        if self._gave_up:
            return
        if n_crashes >= _MAX_CRASHES:
            line = f"computing failed {n_crashes} times in succession ({reason}); not tried again"
            responses.append(RequestFailed(line, id=beat.id, revision=beat.revision))
            self._pending.drop(beat.id)
            if beat.state == "starting":
                return
        self._start()
        responses.append(WorkerRestarted(reason))

    def _start(self, started: StartedWorker | None = None) -> None:
        self._beat = Heartbeat("starting")
        self._gave_up = self._has_spoken = False
        self._heard = self._polled = time.monotonic()
        try:
            self._process = WorkerProcess(started or start_worker(*self._command))
        except OSError as error:
            self._due.append(RequestFailed(f"computing could not be started: {error.strerror}"))
            return
        self._pending.worker_restarted()
        self._post_pending()

    def _post_pending(self) -> None:
        """Send the pending requests that this worker has not received."""
        for request in self._pending.unsent():
            self._post(request)

    def _post(self, request: Request) -> None:
        assert self._process is not None
        try:
            self._process.channel.post(request)
            self._process.channel.flush()
        except OutOfMemory as error:
            self._pending.drop(request.id)
            self._due.append(RequestFailed(str(error), id=request.id, revision=request.revision))
        except ChannelClosed:  # the next poll finds the reason and sends the request again
            pass


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
        if response.is_partial:
            return False
        return any(request.answered_once and request.id == response.id for request in self._requests.values())

    def _restore_last_view(self) -> None:
        """Make the scene that was traced last pending again, with its view, and none that is not open."""
        for kind in (OpenScene, SetCamera):
            self._requests.pop(kind, None)
        self._requests |= self._traced
        if self._traced and self._traced[SetCamera].id != self._traced_here:
            self._sent -= {request.id for request in self._traced.values()}
