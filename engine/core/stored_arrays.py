"""Validates arrays from a file before anything is computed with them.

Kernels index without bounds checks: an array of another shape or with too large a number would read foreign memory. A
checksum proves that the bytes are as written, not that they belong here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

Arrays = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True)
class ArrayInPieces:
    """An array of this type and shape that is never whole in memory: `pieces` produces its parts along the first axis,
    in order, each time they are needed."""

    dtype: np.dtype[np.generic]
    shape: tuple[int, ...]
    pieces: Callable[[], Iterable[NDArray[np.generic]]]

    @property
    def nbytes(self) -> int:
        """Bytes of all pieces."""
        return self.dtype.itemsize * math.prod(self.shape)


Writable = Mapping[str, NDArray[np.generic] | ArrayInPieces]


def n_bytes_of(arrays: Writable) -> int:
    """The size of all arrays in bytes."""
    return sum(array.nbytes for array in arrays.values())


class UnsoundArrays(Exception):
    """The arrays are not what was stored; the caller computes them anew."""


class ArrayReader:
    """Takes and validates arrays one by one. Sizes have names. A size that is not given here is set by the first array
    that names it: `ArrayReader(arrays, P=10).take("seen", np.uint16, "P", "R")`."""

    def __init__(self, arrays: Arrays, **sizes: int) -> None:
        self._arrays = arrays
        self.sizes = sizes

    def take(
        self, name: str, dtype: DTypeLike, *shape: int | str, below: int | None = None, or_else: int | None = None
    ) -> NDArray[Any]:
        """A copy, which kernels may write. Floats must be finite; integers at least 0, and less than `below` or equal
        to `or_else`.

        Raises UnsoundArrays.
        """
        array = self._arrays.get(name)
        if array is None:
            raise UnsoundArrays(f"there is no {name!r}")
        if array.dtype != np.dtype(dtype) or not self._fits(array.shape, shape):
            raise UnsoundArrays(f"{name!r} is {array.dtype} {array.shape}, expected {np.dtype(dtype)} {shape}")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise UnsoundArrays(f"{name!r} is not finite")
        if below is not None and array.size and not _within(array, below, or_else):
            raise UnsoundArrays(f"{name!r} has numbers beyond 0 to {below - 1}")
        return np.array(array)

    def runs(self, name: str, of: str, within: str) -> NDArray[np.int64]:
        """The start of each of `of` rows in arrays of `within` entries, and the end of the last.

        Raises UnsoundArrays.
        """
        starts = self.take(name, np.int64, self.sizes[of] + 1)
        end = self.sizes.setdefault(within, int(starts[-1]))
        if starts[0] != 0 or starts[-1] != end or (np.diff(starts) < 0).any():
            raise UnsoundArrays(f"{name!r} does not begin and end with the rows")
        return starts

    def _fits(self, found: tuple[int, ...], expected: tuple[int | str, ...]) -> bool:
        if len(found) != len(expected):
            return False
        wanted = (
            self.sizes.setdefault(size, n) if isinstance(size, str) else size
            for n, size in zip(found, expected, strict=True)
        )
        return found == tuple(wanted)


def _within(array: NDArray[Any], below: int, or_else: int | None) -> bool:
    good = array < below
    if or_else is not None:
        good |= array == or_else
    return bool(good.all()) and int(array.min()) >= 0
