"""Multisets of objects: which objects light has met, in whatever order [BenArtzi07, sect. 6.1.2].

The thesis numbers lists of objects, M^N of them. The albedos of a list multiply alike in any order, so that one number
serves all lists of the same objects: with K places, each of which may stay empty, there are C(M + K, K).
"""

from functools import cached_property
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray

NONE = -1


class Multisets:
    """All multisets of at most K of M objects, numbered: 0 is the empty one."""

    def __init__(self, n_objects: int, size: int) -> None:
        self._n_objects, self._size = n_objects, size

    def __len__(self) -> int:
        return comb(self._n_objects + self._size, self._size)

    def rank(self, members: NDArray[np.integer]) -> NDArray[np.int64]:
        """Numbers (...) of multisets (..., K): objects from 1 on, 0 for an empty place, in any order.

        With m_1 ≤ … ≤ m_K it is Σ_i C(m_i + i - 1, i), the combinatorial number system for multisets.
        """
        table = [[comb(m + i, i + 1) for i in range(self._size)] for m in range(self._n_objects + 1)]
        ascending = np.sort(members, axis=-1)
        return np.asarray(np.array(table, np.int64)[ascending, np.arange(self._size)].sum(axis=-1))

    @cached_property
    def members(self) -> NDArray[np.int64]:
        """Objects (Z, K) of each multiset, ascending from 1 on, after 0 for every empty place."""
        listed = np.array(list(combinations_with_replacement(range(self._n_objects + 1), self._size)))
        return listed[np.argsort(self.rank(listed))]

    @cached_property
    def exponents(self) -> NDArray[np.int64]:
        """How often (Z, M) each object is in each multiset."""
        return np.asarray((self.members[:, :, None] == np.arange(1, self._n_objects + 1)).sum(axis=1))

    @cached_property
    def joined(self) -> NDArray[np.int64]:
        """The multiset (Z, M) with one object more; NONE where all places are taken."""
        more = np.repeat(self.members[:, None], self._n_objects, axis=1)
        more[:, :, 0] = np.arange(1, self._n_objects + 1)
        return np.where(self.members[:, :1] == 0, self.rank(more), NONE)
