"""Σ_l w_l B_l of pictures B_l (p, 3) with weights w_l (3,), as fast as their memory is read."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads

Float32Array = NDArray[np.float32]
RGB = tuple[float, float, float]
Name = TypeVar("Name", bound=Hashable)
_BLOCK = 4096  # points that are summed at a time


def weighted_sum(
    pictures: Mapping[Name, Float32Array | None], weights: Mapping[Name, RGB], n_points: int,
    start: Float32Array | None = None,
) -> Float32Array:  # fmt: skip
    """`start` + Σ_l w_l B_l, (p, 3) float32. pictures: by name, (p, 3) or None for a black one; start: (p, 3), None for
    0.

    Block by block, so that sums stay in the cache of a processor while each picture is read once. Weights are repeated
    for a block: numpy is ten times slower where it goes through three numbers at a time.
    """
    total = np.zeros(3 * n_points, np.float32) if start is None else start.flatten()
    terms = [
        (picture.reshape(-1), np.tile(np.array(weight, np.float32), _BLOCK))
        for name, weight in weights.items() if any(weight) and (picture := pictures[name]) is not None
    ]  # fmt: skip

    def add(begin: int, end: int) -> None:
        product = np.empty(3 * _BLOCK, np.float32)
        for first in range(3 * begin, 3 * end, 3 * _BLOCK):
            part = total[first : min(first + 3 * _BLOCK, 3 * end)]
            for picture, repeated in terms:
                of_part = product[: len(part)]
                np.multiply(picture[first : first + len(part)], repeated[: len(part)], out=of_part)
                part += of_part

    on_threads(add, *even_parts(n_points))
    return total.reshape(-1, 3)


class ChangingSum(Generic[Name]):
    """A weighted sum whose weights change a few at a time, as while one of many lights is dragged.

    The sum of the terms that stayed from one time to the next is stored, and the others are added to it: a single term
    that changes costs one picture, however many there are. Rejected: the difference of its weights times the picture,
    added to the sum of before, of which rounding errors stay when a very bright light is dimmed.
    """

    def __init__(self, picture_of: Callable[[Name], Float32Array | None], n_points: int) -> None:
        """picture_of: the picture (p, 3) of a name, None for a black one."""
        self._picture_of, self._n_points = picture_of, n_points
        self._last: dict[Name, RGB] = {}
        self._staying: dict[Name, RGB] = {}
        self._sum_of_staying: Float32Array | None = None

    def at(self, weights: Mapping[Name, RGB]) -> Float32Array:
        """The sum (p, 3) with these weights, a new array."""
        terms = {name: weight for name, weight in weights.items() if any(weight)}
        stayed = {name: weight for name, weight in terms.items() if self._last.get(name) == weight}
        if not self._staying.items() <= terms.items() or not stayed.keys() <= self._staying.keys():
            self._staying, self._sum_of_staying = stayed, self._sum(stayed, None)
        self._last = terms
        changing = {name: weight for name, weight in terms.items() if name not in self._staying}
        return self._sum(changing, self._sum_of_staying)

    def _sum(self, weights: Mapping[Name, RGB], start: Float32Array | None) -> Float32Array:
        return weighted_sum({name: self._picture_of(name) for name in weights}, weights, self._n_points, start)
