"""Decides in one place how many cores are used: all that this process may run on.

Work is divided into parts whose results do not depend on the number of threads: the output is bit-identical on any
number of cores.

Where threads change shared state, `run_in_order` fixes the order. An irradiance cache record's index depends on which
thread inserts it first. Ordered sections make that the same in every run, so that results computed in parts, some of
them on another day, equal those computed at once, bit for bit. The order depends on the number of items processed at a
time, so that is two on any number of cores; the rays of each item are distributed over all cores.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache
from typing import Any, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
AT_A_TIME = 2  # items of `run_in_order`
_OWN = threading.local()


def n_cores() -> int:
    """The cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def n_threads() -> int:
    """The number of threads that share work: one per core."""
    return n_cores()


def pool(n: int | None = None) -> ThreadPoolExecutor:
    """Threads for work that arrives bit by bit, n of them or one per core; close it using `with`."""
    return ThreadPoolExecutor(n or n_threads(), initializer=_begin, initargs=(has_own_threads(),))


def on_threads(work: Callable[..., Result], *items: Iterable[Any]) -> list[Result]:
    """The results of `work` for the items, passed as by `map`, in their order; the threads share the items.

    The threads are reused: a picture has about fifteen such calls, and starting threads for each costs a sixth of its
    time. A thread with another priority has threads of its own (`use_own_threads`).
    """
    calls = list(zip(*items, strict=True))
    # A shared thread that waits for shared threads would deadlock.
    if len(calls) == 1 or getattr(_OWN, "is_shared", False):
        return [work(*call) for call in calls]
    futures = [_shared(n_threads(), has_own_threads()).submit(work, *call) for call in calls]
    wait(futures)
    return [future.result() for future in futures]


def use_own_threads() -> None:
    """From now on this thread, whose priority differs from that of others, shares its work with threads of the same
    priority, which they inherit from the thread that starts them."""
    _OWN.is_apart = True


def has_own_threads() -> bool:
    """Whether this thread has its own worker threads, or is one of them."""
    return getattr(_OWN, "is_apart", False)


@lru_cache(maxsize=8)
def _shared(n: int, is_apart: bool) -> ThreadPoolExecutor:
    """The threads shared by all calls, or those of threads with another priority."""
    return ThreadPoolExecutor(n, "work", initializer=_begin, initargs=(is_apart, True))


def _begin(is_apart: bool, is_shared: bool = False) -> None:
    _OWN.is_apart, _OWN.is_shared = is_apart, is_shared


def even_parts(count: int) -> tuple[list[int], list[int]]:
    """The begins and the ends of as many even parts of `count` items as there are threads; some may be empty."""
    bounds = [count * i // n_threads() for i in range(n_threads() + 1)]
    return bounds[:-1], bounds[1:]


def map_ahead(
    threads: ThreadPoolExecutor, work: Callable[[Item], Result], items: Iterable[Item], n_ahead: int
) -> Iterator[Result]:
    """The results of `work` in the order of the items, of which up to n_ahead are under way: no thread waits for the
    consumer, and little is computed in vain where the consumer stops."""
    under_way: deque[Future[Result]] = deque()
    for item in items:
        under_way.append(threads.submit(work, item))
        if len(under_way) == n_ahead:
            yield under_way.popleft().result()
    while under_way:
        yield under_way.popleft().result()


class OrderedSection:
    """A section that one of several concurrent items enters with `with turn:` when it is its turn, once per stage.

    Of each two items, both run their first stage in order, then both their second; then come the next two.
    """

    def __init__(self, passed: Sequence[threading.Event], turns: Sequence[int]) -> None:
        """passed: of the turns of all items, in order; turns: those of this item, one per stage."""
        self._passed, self._turns = passed, deque(turns)

    def __enter__(self) -> None:
        if self._turns[0]:
            self._passed[self._turns[0] - 1].wait()

    def __exit__(self, *_: object) -> None:
        self._passed[self._turns.popleft()].set()

    def end(self) -> None:
        """Passes the turns that were not taken, each when it comes."""
        while self._turns:
            with self:
                pass


def run_in_order(
    work: Callable[[Item, OrderedSection], Result], items: Sequence[Item], n_stages: int
) -> Iterator[Result]:
    """Runs `work` on all items, two at a time, with the result of one thread; each may enter its ordered section
    `n_stages` times."""
    passed = [threading.Event() for _ in range(n_stages * len(items))]

    def ended(item: Item, turn: OrderedSection) -> Result:
        try:
            return work(item, turn)
        finally:
            turn.end()

    def turns_of(i: int) -> OrderedSection:
        first, n = i - i % AT_A_TIME, min(AT_A_TIME, len(items) - (i - i % AT_A_TIME))
        return OrderedSection(passed, [n_stages * first + stage * n + i % AT_A_TIME for stage in range(n_stages)])

    numbers = iter(range(len(items)))
    with pool(AT_A_TIME) as threads:
        try:
            yield from map_ahead(threads, lambda i: ended(items[i], turns_of(i)), numbers, 2 * AT_A_TIME)
        finally:
            # After an error, or where the consumer stops, an item under way may wait for one that never began.
            for i in numbers:
                if i % AT_A_TIME == 0:
                    break
                turns_of(i).end()
