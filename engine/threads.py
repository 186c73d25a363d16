"""How many cores are used, decided in one place: all that this process may run on.

Work is cut into parts whose results do not depend on how many threads share them: what comes out is the same to the
last bit on any number of cores.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

Result = TypeVar("Result")


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
    """What `work` makes of the items, as `map` calls it, in their order; the items are shared among the threads."""
    with pool() as threads:
        return list(threads.map(work, *items))


def even_parts(count: int) -> tuple[list[int], list[int]]:
    """Where as many even parts of `count` things begin, and where they end, as there are threads; some may be empty."""
    bounds = [count * i // n_threads() for i in range(n_threads() + 1)]
    return bounds[:-1], bounds[1:]
