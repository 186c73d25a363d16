"""Runs work on two threads with the result of one: shared state changes in a fixed order.

A record's index depends on which thread inserts it first. Ordered sections make that the same in every run, so that
results computed in parts, some of them on another day, equal those computed at once, bit for bit. The order depends on
the number of items processed at a time, so that is two on any number of cores; the rays of each item are distributed
over all cores.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from threading import Event
from typing import TypeVar

from engine.core.threads import pool

AT_A_TIME = 2

Item = TypeVar("Item")
Result = TypeVar("Result")


class OrderedSection:
    """A section that one of several concurrent items enters with `with turn:` when it is its turn, once per stage.

    All items run their first stage in order, then all their second.
    """

    def __init__(self, passed: Sequence[Event], item: int, n_items: int) -> None:
        self._passed, self._next, self._n_items = passed, item, n_items

    def __enter__(self) -> None:
        if self._next:
            self._passed[self._next - 1].wait()

    def __exit__(self, *_: object) -> None:
        self._passed[self._next].set()
        self._next += self._n_items

    def end(self) -> None:
        """Releases all items that wait for this one."""
        for event in self._passed[self._next :: self._n_items]:
            event.set()


def run_in_order(
    work: Callable[[Item, OrderedSection], Result], items: Sequence[Item], n_stages: int
) -> Iterator[Result]:
    """Runs `work` on all items in order, two at a time; each may enter its ordered section `n_stages` times."""
    with pool(AT_A_TIME) as threads:
        for begin in range(0, len(items), AT_A_TIME):
            few = items[begin : begin + AT_A_TIME]
            passed = [Event() for _ in range(n_stages * len(few))]
            turns = [OrderedSection(passed, i, len(few)) for i in range(len(few))]
            yield from threads.map(lambda item, turn: _ended(work, item, turn), few, turns)


def _ended(work: Callable[[Item, OrderedSection], Result], item: Item, turn: OrderedSection) -> Result:
    try:
        return work(item, turn)
    finally:
        turn.end()
