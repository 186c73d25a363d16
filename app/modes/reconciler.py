"""Compares what is desired of the worker with what was requested and what is ready, and says what to do about it.

    desire(now, desired) ─► action(now) ─► "request" ─► the controller sends it ─► sent(now, id)
                                       └─► "cancel"  ─► the controller cancels it
                            receive(id, ready) ◄─ a response        fail(id) ◄─ a failure

Each controller of the window's process says what it desires and how that is requested; when to request, to wait, to
cancel and to request again is decided here, once. States are compared, events are not followed: so an undo, a late
response, a failure or another worker needs no special case. It has no clock, no client and no threads: time comes in as
an argument, and what is to be done is returned.

What holds, whatever happens in whatever order (`tests/app/modes/test_reconciler.py`):

- Of one desired state there are never two requests under way.
- What is under way and no longer desired is cancelled: at once (`cancels_at_once`), or by the next request, which
  cancels the older of its kind (`app.messages.worker_messages.Request`).
- What is ready is ready for the state that it was requested for, and for no other.
- What failed or was stopped is not requested again until another state was requested, or a restart is asked for.
- What was under way in a worker that died is requested again.
- A request is sent `idle_seconds` after the last change of the desired state at the earliest.
- Without further input, the desired state is ready after finitely many steps.

Rejected: to send and cancel from here, which would tie every test of this to messages; and a base class of all
controllers, because what they do with partial results has nothing in common.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, Literal, TypeVar

Desired = TypeVar("Desired")
Ready = TypeVar("Ready")

Action = Literal["wait", "request", "cancel"]


@dataclass(frozen=True)
class SentRequest(Generic[Desired]):
    """A request: its number, the state that it is for, and the time at which it was sent."""

    id: int
    desired: Desired
    sent_at: float


class Reconciler(Generic[Desired, Ready]):
    """The desired, the requested and the ready state of one kind of request.

    idle_seconds: how long a state is to be desired before it is requested; patience: seconds for which a request under
    way holds back one for another state; cancels_at_once: whether a request is cancelled as soon as its state is not
    desired, and not only by the next; replaces: whether a request takes the place of what was ready, as another light
    does in the worker, so that this is to be requested again; covers: whether what was made for the first state serves
    the second.

    desired: the state, None for none; requested: the newest request, answered or not, None where its response would not
    count; is_under_way: whether its last response is still to come; ready: what has come last, for `ready_for`.
    """

    def __init__(
        self,
        idle_seconds: float = 0.0,
        patience: float = 0.0,
        *,
        cancels_at_once: bool = False,
        replaces: bool = False,
        covers: Callable[[Desired, Desired], bool] = operator.eq,
    ) -> None:
        self._idle_seconds, self._patience = idle_seconds, patience
        self._cancels_at_once, self._replaces, self._covers = cancels_at_once, replaces, covers
        self.clear()

    def clear(self) -> None:
        """Forget everything: another scene is open."""
        self.desired: Desired | None = None
        self.requested: SentRequest[Desired] | None = None
        self.is_under_way = False
        self._refused: Desired | None = None
        self._since = math.inf
        self._skips_idle = False
        self.forget_ready()

    def forget_ready(self) -> None:
        """Forget what is ready: it is void, or let go."""
        self.ready: Ready | None = None
        self.ready_for: Desired | None = None

    # ---------------------------------------------------------------------------------------------- what is to be done

    def desire(self, now: float, desired: Desired | None) -> None:
        """Note the desired state; once a frame. None: nothing is, and what is ready is of no more use."""
        if desired is None:
            self.forget_ready()
        elif self.desired is None or not self._covers(self.desired, desired):
            self._since = now
        self.desired = desired

    def action(self, now: float, may_request: bool = True) -> Action:
        """What to do about the desired state. "request": send a request for it, and report it to `sent`; "cancel":
        cancel what is under way. may_request: whether it is time to request anything; otherwise no idle time passes."""
        skips_idle, self._skips_idle = self._skips_idle, False
        if self._cancels_at_once and self.is_under_way and not self.is_met:
            self.lose()
            return "cancel"
        if not may_request:
            self._since = math.inf
            return "wait"
        self._since = min(self._since, now)
        if self.desired is None or self.is_met or self.is_refused or self._is_held_back(now):
            return "wait"
        return "request" if skips_idle or now - self._since >= self._idle_seconds else "wait"

    def _is_held_back(self, now: float) -> bool:
        """Whether the response to the request under way is worth waiting for, though another state is desired."""
        return self.is_under_way and self.requested is not None and now - self.requested.sent_at < self._patience

    def skip_idle(self) -> None:
        """Let the next `action` not wait for the idle time: a drag has ended."""
        self._skips_idle = True

    @property
    def is_ready(self) -> bool:
        """Whether what is ready is what is desired."""
        return self.desired is not None and self.ready_for is not None and self._covers(self.ready_for, self.desired)

    @property
    def is_met(self) -> bool:
        """Whether nothing is left to request: what is desired is under way, or ready with nothing else under way."""
        if self.desired is None or self.requested is None or not self.is_under_way:
            return self.is_ready
        return self._covers(self.requested.desired, self.desired)

    @property
    def is_refused(self) -> bool:
        """Whether the request for what is desired has failed, or was stopped. One for more than that says nothing: a
        part of it may succeed alone."""
        if self.desired is None or self._refused is None:
            return False
        return self._covers(self._refused, self.desired) and self._covers(self.desired, self._refused)

    # ---------------------------------------------------------------------------------------------------- what happened

    def sent(self, now: float, id: int, desired: Desired | None = None) -> None:
        """A request was sent: for the desired state, or for another one in its place."""
        state = self.desired if desired is None else desired
        assert state is not None
        self.requested, self.is_under_way, self._refused = SentRequest(id, state, now), True, None
        if self._replaces:
            self.forget_ready()

    def receive(self, id: int, ready: Ready, is_last: bool = True) -> bool:
        """Take a response, the last or one before it; returns whether it is one to the newest request."""
        if self.requested is None or self.requested.id != id:
            return False
        self.ready, self.ready_for = ready, self.requested.desired
        self.is_under_way = self.is_under_way and not is_last
        return True

    def accept(self, ready: Ready, ready_for: Desired) -> None:
        """Something has become ready without a request: it was remembered, or made in the window's process."""
        self.ready, self.ready_for = ready, ready_for

    def fail(self, id: int) -> bool:
        """A request failed; returns whether it was the newest, and under way."""
        if self.requested is None or self.requested.id != id or not self.is_under_way:
            return False
        self._refused, self.is_under_way = self.requested.desired, False
        return True

    def stop(self) -> None:
        """The user stopped the work: no response will come, and what is desired is not requested again."""
        self._refused, self.is_under_way = None if self.is_ready else self.desired, False

    def retry(self) -> None:
        """Request again what failed or was stopped; what is ready stays."""
        self._refused = None

    def restart(self) -> None:
        """Request again what is desired, even if it is ready, has failed or was stopped."""
        self.lose()
        self._refused = None
        self.forget_ready()

    def revise(self, change: Callable[[Desired], Desired]) -> None:
        """Describe all states differently from now on: the worker has decided what was left to it."""
        self.desired = None if self.desired is None else change(self.desired)
        self.ready_for = None if self.ready_for is None else change(self.ready_for)
        self._refused = None if self._refused is None else change(self._refused)
        if self.requested is not None:
            self.requested = replace(self.requested, desired=change(self.requested.desired))

    def lose(self) -> None:
        """What is under way will not be answered: it was cancelled, or its worker has died."""
        self.requested, self.is_under_way = None, False

    def resent(self) -> None:
        """A new worker was given the newest request again, by its old number: it is under way, and nothing ready."""
        self.is_under_way = self.requested is not None and (self.is_under_way or self.ready_for is not None)
        self.forget_ready()
