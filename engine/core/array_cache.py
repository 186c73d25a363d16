"""Caches the most recent arrays of a function, up to a total size in bytes.

`functools.lru_cache` counts results, and these differ in size by a factor of a thousand: 64 tables of equivalent
albedos, one for each roughness that a slider passed through, took 134 MB.
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
    """Decorates a function of hashable arguments. Its arrays become read-only; the most recent one is cached whatever
    its size."""

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
