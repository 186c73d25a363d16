"""Work on two threads that ends as work on one would: what is shared is changed in a fixed order.

Where a cell gets its number is decided by who comes first. With turns that is the same one in every run, so that what
is found in parts, some of them on another day, is what is found at once, to the last bit. How many items are worked on
at a time decides the order, so that it is two on any number of cores; the rays of each are shared among all of them.
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
    """What one of several items worked on at a time waits for: `with turn:` lets it do what is its turn, once a stage.

    All items have their first stage in their order, then all their second.
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
        """Nobody has to wait for this item any more."""
        for event in self._passed[self._next :: self._n_items]:
            event.set()


def run_in_order(
    work: Callable[[Item, OrderedSection], Result], items: Sequence[Item], n_stages: int
) -> Iterator[Result]:
    """`work` of all items, two at a time, in their order; each may enter its turn `n_stages` times."""
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
