"""Whatever is desired, answered, lost, stopped and refused, in whatever order: the reconciler's invariants hold.

States are small integers, or sets of them where more covers less; a response to the request for one is its text. Each
sequence is run against a plain list of what is under way, which knows nothing of how the reconciler decides.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.modes.reconciler import Reconciler

IDLE_SECONDS, PATIENCE, FRAME_SECONDS = 0.25, 1.0, 0.1
State = int | frozenset[int]


class Kind(NamedTuple):
    """A kind of request."""

    idle_seconds: float = 0.0
    patience: float = 0.0
    cancels_at_once: bool = False
    replaces: bool = False
    covers: Callable[[State, State], bool] = operator.eq


KINDS = {
    "error estimate": Kind(IDLE_SECONDS, cancels_at_once=True),
    "view": Kind(IDLE_SECONDS),
    "transport": Kind(IDLE_SECONDS, replaces=True),
    "side A": Kind(patience=PATIENCE),
    "table": Kind(patience=float("inf")),
    "images": Kind(covers=frozenset.issuperset),
}
STEPS = ("wait", "answer", "answer in part", "fail", "die", "die and resend", "stop", "restart", "late", "busy") + (
    "nothing", "accept", "skip idle", "revise",
)  # fmt: skip
SETS = ({0}, {1}, {0, 1}, {0, 1, 2})
REVISED = 10  # added to all numbers of a state that is described differently


def made_for(state: State) -> str:
    """The response to a request for a state, however that is described."""
    numbers = sorted(state) if isinstance(state, frozenset) else [state]
    return " ".join(str(number % REVISED) for number in numbers)


def revised(state: State) -> State:
    """The same state, described differently."""
    return frozenset(n + REVISED for n in state) if isinstance(state, frozenset) else state + REVISED


@dataclass
class Desk:
    """A reconciler and the worker that it is for: the requests under way, and those that a newer one has cancelled."""

    kind: Kind
    reconciler: Reconciler[State, str] = field(init=False)
    now: float = 0.0
    n_sent: int = 0
    n_revised: int = 0
    under_way: dict[int, State] = field(default_factory=dict)
    cancelled: dict[int, State] = field(default_factory=dict)
    changed_at: float = 0.0
    skips_idle: bool = False
    refused: State | None = None

    def __post_init__(self) -> None:
        idle, patience, cancels, replaces, covers = self.kind
        self.reconciler = Reconciler(idle, patience, cancels_at_once=cancels, replaces=replaces, covers=covers)

    def state(self, n: int) -> State:
        """The state of this number, 0 to 3, as it is described now."""
        state: State = n if self.kind.covers is operator.eq else frozenset(SETS[n])
        for _ in range(self.n_revised):
            state = revised(state)
        return state

    def desire(self, n: int) -> None:
        before, state = self.reconciler.desired, self.state(n)
        if before is None or not self.kind.covers(before, state):
            self.changed_at = self.now
        self.reconciler.desire(self.now, state)

    @property
    def serves(self) -> bool:
        """Whether what is under way is, or covers, what is desired."""
        desired = self.reconciler.desired
        return desired is not None and any(self.kind.covers(each, desired) for each in self.under_way.values())

    @property
    def is_refused(self) -> bool:
        """Whether exactly what is desired has failed, or was stopped."""
        return self.refused is not None and self.refused == self.reconciler.desired

    def frame(self, may_request: bool = True) -> None:
        """One frame: what is desired stays."""
        self.now += FRAME_SECONDS
        reconciler, desired = self.reconciler, self.reconciler.desired
        skips_idle, self.skips_idle = self.skips_idle, False
        reconciler.desire(self.now, desired)
        match reconciler.action(self.now, may_request):
            case "request":
                assert may_request and desired is not None and not self.serves and not self.is_refused
                assert skips_idle or self.now - self.changed_at >= self.kind.idle_seconds - 1e-9
                self.n_sent += 1
                self._cancel()
                self.under_way, self.refused = {self.n_sent: desired}, None
                reconciler.sent(self.now, self.n_sent)
            case "cancel":
                assert self.under_way and not self.serves
                self._cancel()
        assert not (self.kind.cancels_at_once and self.under_way) or self.serves

    def _cancel(self) -> None:
        self.cancelled, self.under_way = {**self.cancelled, **self.under_way}, {}

    def step(self, name: str) -> None:
        """What happens, by name; a step that has nothing to happen to does nothing."""
        reconciler = self.reconciler
        newest = next(iter(self.under_way.items()), None)
        match name:
            case "answer" | "answer in part" if newest is not None:
                is_last = name == "answer"
                assert reconciler.receive(newest[0], made_for(newest[1]), is_last)
                self.under_way = {} if is_last else self.under_way
            case "late" if self.cancelled:
                id, state = self.cancelled.popitem()
                assert not reconciler.receive(id, made_for(state)) and not reconciler.fail(id)
            case "fail" if newest is not None:
                assert reconciler.fail(newest[0])
                self.refused, self.under_way = newest[1], {}
            case "die":
                reconciler.lose()
                self.under_way = {}
            case "die and resend":
                reconciler.resent()
                if reconciler.is_under_way and reconciler.requested is not None:
                    self.under_way = {reconciler.requested.id: reconciler.requested.desired}
            case "stop":
                self.refused = None if reconciler.is_ready else reconciler.desired
                reconciler.stop()
                self.under_way = {}
            case "restart":
                reconciler.restart()
                self._cancel()
                self.refused = None
            case "nothing":
                reconciler.desire(self.now, None)
            case "accept" if reconciler.desired is not None:
                reconciler.accept(made_for(reconciler.desired), reconciler.desired)
                assert reconciler.is_ready
            case "skip idle":
                reconciler.skip_idle()
                self.skips_idle = True
            case "revise":
                reconciler.revise(revised)
                self.n_revised += 1
                self.under_way = {id: revised(each) for id, each in self.under_way.items()}
                self.refused = None if self.refused is None else revised(self.refused)

    def check(self) -> None:
        """What holds between any two steps."""
        reconciler = self.reconciler
        assert len(self.under_way) <= 1 and reconciler.is_under_way == bool(self.under_way)
        assert (reconciler.ready is None) == (reconciler.ready_for is None)
        assert reconciler.ready_for is None or reconciler.ready == made_for(reconciler.ready_for)
        if reconciler.is_ready:
            assert reconciler.ready_for is not None and reconciler.desired is not None
            assert self.kind.covers(reconciler.ready_for, reconciler.desired)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
@settings(max_examples=150, deadline=None)
@given(st.lists(st.sampled_from((*STEPS, 0, 1, 2, 3)), min_size=20, max_size=40))
def test_the_invariants_hold_and_in_the_end_the_desired_state_is_ready(kind: Kind, steps: list[int | str]) -> None:
    desk = Desk(kind)
    for step in steps:
        if isinstance(step, int):
            desk.desire(step)
        else:
            desk.step(step)
        desk.check()
        desk.frame(may_request=step != "busy")
        desk.check()
    desk.step("restart")
    desk.desire(0)
    for _ in range(8):  # the idle time, a request that is still held back, its answer, the request, its answer
        desk.frame()
        desk.check()
        desk.step("answer")
    assert desk.reconciler.is_ready and not desk.under_way
    n_sent = desk.n_sent
    for _ in range(20):
        desk.frame()
    assert desk.n_sent == n_sent  # and then it is quiet


@pytest.fixture
def desk() -> Desk:
    desk = Desk(Kind(IDLE_SECONDS))
    desk.desire(1)
    return desk


def test_the_idle_time_counts_from_the_last_change_and_can_be_skipped(desk: Desk) -> None:
    reconciler = desk.reconciler
    assert reconciler.action(0.2) == "wait"
    reconciler.desire(0.2, 2)
    assert reconciler.action(0.4) == "wait" and reconciler.action(0.45) == "request"
    reconciler.desire(0.5, 3)
    reconciler.skip_idle()
    assert reconciler.action(0.5) == "request"


def test_no_idle_time_passes_while_nothing_may_be_requested(desk: Desk) -> None:
    reconciler = desk.reconciler
    assert reconciler.action(5.0, may_request=False) == "wait"
    assert reconciler.action(6.0) == "wait" and reconciler.action(6.0 + IDLE_SECONDS) == "request"


def test_what_is_lost_is_requested_again_and_what_is_resent_is_not(desk: Desk) -> None:
    reconciler = desk.reconciler
    reconciler.sent(1.0, 1)
    reconciler.lose()
    assert reconciler.action(1.0) == "request"
    reconciler.sent(1.0, 2)
    assert reconciler.receive(2, "one") and reconciler.is_ready
    reconciler.resent()
    assert reconciler.is_under_way and not reconciler.is_ready and reconciler.action(1.0) == "wait"


def test_a_failure_is_repeated_after_a_restart_or_another_request_only(desk: Desk) -> None:
    reconciler = desk.reconciler
    reconciler.sent(1.0, 1)
    assert reconciler.fail(1) and not reconciler.fail(1) and reconciler.is_refused
    assert reconciler.action(9.0) == "wait"
    reconciler.desire(9.0, 2)
    assert reconciler.action(10.0) == "request"
    reconciler.sent(10.0, 2)
    reconciler.desire(10.0, 1)
    assert reconciler.action(11.0) == "request"
    reconciler.sent(11.0, 3)
    reconciler.stop()
    assert reconciler.action(12.0) == "wait"
    reconciler.restart()
    assert reconciler.action(12.0) == "request"


def test_patience_holds_back_another_request_and_not_longer() -> None:
    reconciler = Reconciler[int, str](patience=PATIENCE)
    reconciler.desire(0.0, 1)
    assert reconciler.action(0.0) == "request"
    reconciler.sent(0.0, 1)
    reconciler.desire(0.1, 2)
    assert reconciler.action(0.9) == "wait" and reconciler.action(PATIENCE) == "request"
    reconciler.receive(1, "one")
    assert not reconciler.is_ready and reconciler.action(0.9) == "request"


def test_what_was_ready_is_requested_again_where_a_request_replaces_it() -> None:
    for replaces, action in ((True, "request"), (False, "wait")):
        reconciler = Reconciler[int, str](replaces=replaces)
        reconciler.desire(0.0, 1)
        reconciler.sent(0.0, 1)
        reconciler.receive(1, "one")
        reconciler.desire(1.0, 2)
        reconciler.sent(1.0, 2)
        reconciler.fail(2)
        reconciler.desire(2.0, 1)
        assert reconciler.action(2.0) == action


def test_what_covers_the_desired_state_need_not_be_requested() -> None:
    reconciler = Reconciler[frozenset[int], str](covers=frozenset.issuperset)
    reconciler.desire(0.0, frozenset({1, 2}))
    reconciler.sent(0.0, 1)
    reconciler.desire(1.0, frozenset({2}))
    assert reconciler.action(1.0) == "wait"
    reconciler.receive(1, "both")
    assert reconciler.is_ready
    reconciler.desire(2.0, None)
    assert reconciler.ready is None
    reconciler.desire(3.0, frozenset({2}))
    assert reconciler.action(3.0) == "request"


def test_a_part_of_what_failed_is_requested() -> None:
    reconciler = Reconciler[frozenset[int], str](covers=frozenset.issuperset)
    reconciler.desire(0.0, frozenset({1, 2}))
    reconciler.sent(0.0, 1)
    reconciler.fail(1)
    assert reconciler.is_refused and reconciler.action(1.0) == "wait"
    reconciler.desire(1.0, frozenset({2}))
    assert not reconciler.is_refused and reconciler.action(1.0) == "request"
