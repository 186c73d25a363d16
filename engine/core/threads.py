"""How many cores are used, decided in one place: all that this process may run on.

Work is cut into parts whose results do not depend on how many threads share them: what comes out is the same to the
last bit on any number of cores.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import lru_cache
from typing import Any, TypeVar

Result = TypeVar("Result")
_OWN = threading.local()


def n_cores() -> int:
    """Cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def n_threads() -> int:
    """On how many threads work is to be shared: one a core."""
    return n_cores()


def pool(n: int | None = None) -> ThreadPoolExecutor:
    """Threads for work that comes bit by bit, n or one a core; to be closed, by `with`."""
    return ThreadPoolExecutor(n or n_threads(), initializer=_begin, initargs=(has_own_threads(),))


def on_threads(work: Callable[..., Result], *items: Iterable[Any]) -> list[Result]:
    """What `work` makes of the items, as `map` calls it, in their order; the items are shared among the threads.

    These stay, as a picture has some fifteen such works, and to begin threads for each costs a sixth of its time.
    One that is kept apart has threads of its own.
    """
    calls = list(zip(*items, strict=True))
    if len(calls) == 1 or getattr(_OWN, "is_shared", False):  # those that wait for themselves would wait for ever
        return [work(*call) for call in calls]
    futures = [_shared(n_threads(), has_own_threads()).submit(work, *call) for call in calls]
    wait(futures)
    return [future.result() for future in futures]


def use_own_threads() -> None:
    """From now on this thread, which has another priority than others, shares its work with threads that have the same:
    they get it from the one that begins them."""
    _OWN.is_apart = True


def has_own_threads() -> bool:
    """Whether this thread was kept apart, or works for one that was."""
    return getattr(_OWN, "is_apart", False)


@lru_cache(maxsize=8)
def _shared(n: int, is_apart: bool) -> ThreadPoolExecutor:
    """The threads of all such works, or of those that are kept apart."""
    return ThreadPoolExecutor(n, "work", initializer=_begin, initargs=(is_apart, True))


def _begin(is_apart: bool, is_shared: bool = False) -> None:
    _OWN.is_apart, _OWN.is_shared = is_apart, is_shared


def even_parts(count: int) -> tuple[list[int], list[int]]:
    """Where as many even parts of `count` things begin, and where they end, as there are threads; some may be empty."""
    bounds = [count * i // n_threads() for i in range(n_threads() + 1)]
    return bounds[:-1], bounds[1:]
