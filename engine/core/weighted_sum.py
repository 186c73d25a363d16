"""Σ_l w_l B_l of pictures B_l (p, 3) with weights w_l (3,), as fast as their memory is read."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core import _weighted_sum_kernels as kernels
from engine.core.threads import even_parts, on_threads

Float32Array = NDArray[np.float32]
RGB = tuple[float, float, float]
Name = TypeVar("Name", bound=Hashable)
_AT_ONCE = 4  # pictures, so that the sum is read and written once for four of them
_REPEATS = 256  # of weights, so that three numbers a point fill the processor's registers
_SAME = 1e-6  # the relative difference of weights that are multiples by one factor


def weighted_sum(
    pictures: Mapping[Name, Float32Array | None], weights: Mapping[Name, RGB], n_points: int,
    start: Float32Array | None = None,
) -> Float32Array:  # fmt: skip
    """`start` + Σ_l w_l B_l, (p, 3) float32. pictures: by name, (p, 3) or None for a black one; start: (p, 3), None for
    0."""
    total = np.zeros(3 * n_points, np.float32) if start is None else start.flatten()
    terms = [
        (np.ascontiguousarray(picture, np.float32).reshape(-1), weight)
        for name, weight in weights.items() if any(weight) and (picture := pictures[name]) is not None
    ]  # fmt: skip
    # Fours of them, the last one filled up with a picture that counts for nothing.
    terms += [(terms[0][0], (0.0, 0.0, 0.0))] * (-len(terms) % _AT_ONCE) if terms else []
    fours = [terms[i : i + _AT_ONCE] for i in range(0, len(terms), _AT_ONCE)]
    repeated = [np.tile(np.array([weight for _, weight in four], np.float32), _REPEATS) for four in fours]

    def add(begin: int, end: int) -> None:
        for four, of_four in zip(fours, repeated, strict=True):
            first, second, third, fourth = (picture for picture, _ in four)
            kernels.add_four(total, first, second, third, fourth, of_four, 3 * begin, 3 * end)

    on_threads(add, *even_parts(n_points))
    return total.reshape(-1, 3)


class ChangingSum(Generic[Name]):
    """A weighted sum whose weights change a few at a time, as while one of many lights is dragged.

    The sum of the terms that stayed from one time to the next is stored, and the others are added to it: a single term
    that changes costs one picture, however many there are. So do several that change by one factor, as a group of
    lights does: their sum is stored as well. Rejected: the difference of its weights times the picture,
    added to the sum of before, of which rounding errors stay when a very bright light is dimmed.
    """

    def __init__(self, picture_of: Callable[[Name], Float32Array | None], n_points: int) -> None:
        """picture_of: the picture (p, 3) of a name, None for a black one."""
        self._picture_of, self._n_points = picture_of, n_points
        self._last: dict[Name, RGB] = {}
        self._staying: dict[Name, RGB] = {}
        self._sum_of_staying: Float32Array | None = None
        self._group: dict[Name, RGB] = {}  # those that change
        self._sum_of_group: Float32Array | None = None

    def at(self, weights: Mapping[Name, RGB]) -> Float32Array:
        """The sum (p, 3) with these weights, a new array."""
        terms = {name: weight for name, weight in weights.items() if any(weight)}
        stayed = {name: weight for name, weight in terms.items() if self._last.get(name) == weight}
        if not self._staying.items() <= terms.items() or not stayed.keys() <= self._staying.keys():
            self._staying, self._sum_of_staying = stayed, self._sum(stayed, None)
        self._last = terms
        changing = {name: weight for name, weight in terms.items() if name not in self._staying}
        factor = _common_factor(changing, self._group)
        if factor is None:
            self._group, self._sum_of_group = changing, None
            return self._sum(changing, self._sum_of_staying)
        if self._sum_of_group is None:
            self._sum_of_group = self._sum(self._group, None)
        return weighted_sum({"": self._sum_of_group}, {"": factor}, self._n_points, self._sum_of_staying)

    def _sum(self, weights: Mapping[Name, RGB], start: Float32Array | None) -> Float32Array:
        return weighted_sum({name: self._picture_of(name) for name in weights}, weights, self._n_points, start)


def _common_factor(now: Mapping[Name, RGB], then: Mapping[Name, RGB]) -> RGB | None:
    """The factor (3,) by which all weights of several terms have changed; None where it is not one for all."""
    if len(now) < 2 or now.keys() != then.keys():
        return None
    after, before = (np.array([each[name] for name in now]) for each in (now, then))
    brightest = before.argmax(axis=0), np.arange(3)
    factor = np.divide(after[brightest], before[brightest], out=np.zeros(3), where=before[brightest] > 0.0)
    if not np.allclose(after, factor * before, rtol=_SAME, atol=0.0):
        return None
    red, green, blue = factor.tolist()
    return red, green, blue
