"""The arrays that a function gave last, kept as far as they take no more than so much memory.

`functools.lru_cache` counts results, and these differ in size by a thousand: 64 tables of equivalent albedos, one for
each roughness that a slider went through, were 134 MB.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from threading import Lock
from typing import Any, ParamSpec

from numpy.typing import NDArray

Arguments = ParamSpec("Arguments")


def cache_recent_arrays(
    most_bytes: int,
) -> Callable[[Callable[Arguments, NDArray[Any]]], Callable[Arguments, NDArray[Any]]]:
    """Decorates a function of hashable arguments by place. Its arrays are read alone; the one asked for last is kept
    whatever its size."""

    def decorate(function: Callable[Arguments, NDArray[Any]]) -> Callable[Arguments, NDArray[Any]]:
        kept: OrderedDict[Hashable, NDArray[Any]] = OrderedDict()
        lock = Lock()

        @wraps(function)
        def recent(*arguments: Arguments.args, **named: Arguments.kwargs) -> NDArray[Any]:
            key = arguments, tuple(sorted(named.items()))
            with lock:
                if key in kept:
                    kept.move_to_end(key)
                    return kept[key]
            found = function(*arguments, **named)
            found.setflags(write=False)
            with lock:
                kept[key] = found
                while len(kept) > 1 and sum(array.nbytes for array in kept.values()) > most_bytes:
                    kept.popitem(last=False)
            return found

        return recent

    return decorate
