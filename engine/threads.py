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


def pool() -> ThreadPoolExecutor:
    """Threads for work that comes bit by bit; to be closed, by `with`."""
    return ThreadPoolExecutor(n_threads())


def on_threads(work: Callable[..., Result], *items: Iterable[Any]) -> list[Result]:
    """What `work` makes of the items, as `map` calls it, in their order; the items are shared among the threads.

    These stay, as a picture has some fifteen such works, and to begin threads for each costs a sixth of its time.
    """
    calls = list(zip(*items, strict=True))
    if len(calls) == 1 or getattr(_OWN, "is_shared", False):  # those that wait for themselves would wait for ever
        return [work(*call) for call in calls]
    futures = [_shared(n_threads()).submit(work, *call) for call in calls]
    wait(futures)
    return [future.result() for future in futures]


@lru_cache(maxsize=4)
def _shared(n: int) -> ThreadPoolExecutor:
    """The threads of all such works."""
    return ThreadPoolExecutor(n, "work", initializer=_note_shared)


def _note_shared() -> None:
    _OWN.is_shared = True


def even_parts(count: int) -> tuple[list[int], list[int]]:
    """Where as many even parts of `count` things begin, and where they end, as there are threads; some may be empty."""
    bounds = [count * i // n_threads() for i in range(n_threads() + 1)]
    return bounds[:-1], bounds[1:]
