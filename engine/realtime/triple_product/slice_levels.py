"""Chooses the level of triangles for each layer's slices, so that all of them together fit into a given memory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from engine.material.layer import Layer
from engine.realtime.core.terms import has_isotropic_reflection
from engine.realtime.triple_product.slices import LEAST_LEVEL, slice_bytes_of, table_bytes_of
from engine.realtime.triple_product.visibility import LEVEL

Layers = tuple[Layer, ...]
_NOTE = "Orbit: so many glossy layers do not fit into memory; their highlights are coarser"


class SliceLevels:
    """The level of each layer, `slices.LEAST_LEVEL` to 4: `of`.

    All layers get the finest level at which they all fit; then the first ones, as many as fit, get one level more. At
    the coarsest level an isotropic layer takes 0.1 MB and an anisotropic one 0.5 MB, whether or not they fit: 512 MiB
    hold 5,000 or 1,100 layers.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._isotropic: dict[Layer, bool] = {}
        self.of: dict[Layer, int] = {}
        self.notes: tuple[str, ...] = ()

    def choose(self, terms: Sequence[Layers]) -> None:
        """Choose the levels for layers that are summed in these terms, each distinct sum once."""
        layers = dict.fromkeys(layer for term in terms for layer in term)
        known = self._isotropic
        self._isotropic = {each: known[each] if each in known else has_isotropic_reflection(each) for each in layers}

        def at(level: int, n_finer: int) -> dict[Layer, int]:
            finer = {layer for term in terms[:n_finer] for layer in term}
            return {layer: level + (layer in finer) for layer in layers}

        # Both sequences need more bytes from one entry to the next: find the last that fits by bisection.
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
        """Bytes that slices and tables of all sums take at these levels."""
        total = sum(slice_bytes_of(level, self._isotropic[layer]) for layer, level in of.items())
        for term in terms:
            made = max(of[layer] for layer in term), all(self._isotropic[layer] for layer in term)
            # A sum of several layers has slices of its own.
            total += table_bytes_of(*made) + (slice_bytes_of(*made) if len(term) > 1 else 0)
        return total
