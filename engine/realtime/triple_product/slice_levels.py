"""Over how fine triangles each layer's slices stand, so that all of them together take no more than so much memory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from engine.material.layer import Layer
from engine.realtime.triple_product.slices import LEAST_LEVEL, has_isotropic_reflection, slice_bytes_of, table_bytes_of
from engine.realtime.triple_product.visibility import LEVEL

Layers = tuple[Layer, ...]
_NOTE = "Orbit: so many glossy layers do not fit into memory; their highlights are coarser"


class SliceLevels:
    """The level of each layer, `slices.LEAST_LEVEL` to 4: `of`.

    All layers have the finest level at which they fit; then as many as still fit, the first ones, have one more. Of the
    coarsest level an isotropic layer takes 0.1 MB, one with a grain 0.5, whether or not they fit: in 512 MiB 5,000 or
    1,100 layers do.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._isotropic: dict[Layer, bool] = {}
        self.of: dict[Layer, int] = {}
        self.notes: tuple[str, ...] = ()

    def choose(self, terms: Sequence[Layers]) -> None:
        """The levels for layers that are summed so, each sum once."""
        layers = dict.fromkeys(layer for term in terms for layer in term)
        known = self._isotropic
        self._isotropic = {each: known[each] if each in known else has_isotropic_reflection(each) for each in layers}

        def at(level: int, n_finer: int) -> dict[Layer, int]:
            finer = {layer for term in terms[:n_finer] for layer in term}
            return {layer: level + (layer in finer) for layer in layers}

        # Both are more bytes from one to the next: the last that fits is searched for by halves.
        fits = bisect_right(
            range(LEAST_LEVEL + 1, LEVEL + 1), self._most_bytes, key=lambda level: self._n_bytes(terms, at(level, 0))
        )
        level, n_finer = LEAST_LEVEL + fits, 0
        if level < LEVEL:
            n_finer = bisect_right(
                range(1, len(terms) + 1), self._most_bytes, key=lambda n: self._n_bytes(terms, at(level, n))
            )
        self.of = at(level, n_finer)
        is_coarse = any(level < LEVEL for level in self.of.values())
        self.notes = (_NOTE,) if is_coarse else ()

    def _n_bytes(self, terms: Sequence[Layers], of: dict[Layer, int]) -> int:
        """What slices and tables of all sums take at these levels."""
        total = sum(slice_bytes_of(level, self._isotropic[layer]) for layer, level in of.items())
        for term in terms:
            made = max(of[layer] for layer in term), all(self._isotropic[layer] for layer in term)
            # A sum of several layers has slices of its own.
            total += table_bytes_of(*made) + (slice_bytes_of(*made) if len(term) > 1 else 0)
        return total
