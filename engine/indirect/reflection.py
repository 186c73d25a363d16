"""What the gather points reflect of the cells' light, layer by layer: with the curves as they are, or by band of one.

Both are sums over the same rays. Nothing is kept between two calls: the rays' directions come from tables, and a
point's cells take two bytes a ray, so that this costs less than reading stored bands would.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.indirect import _reflection_kernels as kernels
from engine.indirect.gather import FanSize, Gathered, object_of_rows
from engine.indirect.rays import cosine_tables, pole_tables
from engine.material.model import Model
from engine.scene.hits import PrimaryHits

_PART = 512


@dataclass(frozen=True, eq=False)
class LayerCurves:
    """A layer as gather points reflect with it: model, quotient parameters (8,), values at the nodes of its one or two
    curves, (J, 3) and (K, 3)."""

    model: Model
    quotient_parameters: NDArray[np.float64]
    curves: tuple[NDArray[np.float64], ...]

    def optics(self) -> kernels.Optics:
        first, *second = (np.ascontiguousarray(curve, np.float32) for curve in self.curves)
        factors = self.model.factors
        kind_b = factors[1].gamma if len(factors) > 1 else -1
        other = second[0] if second else np.ones((1, 3), np.float32)
        q = np.asarray(self.quotient_parameters, np.float64)
        return kernels.Optics(self.model.kind, q, factors[0].gamma, kind_b, first, other)


class Fans:
    """The gather points of one object, all their rays or one half of them."""

    def __init__(
        self, hits: PrimaryHits, gathered: Gathered, i_object: int, pole: int, size: FanSize,
        half: int | None = None,
    ) -> None:  # fmt: skip
        begin, end = np.searchsorted(object_of_rows(hits, gathered.rows), (i_object, i_object + 1))
        rows = gathered.rows[begin:end]
        self._fans = kernels.Fans(
            rows, np.full(len(rows), pole, np.int64), gathered.seen[begin:end], -1 if half is None else half,
            cosine_tables(size.n_cosine), pole_tables(size.n_pole), hits.tangent, hits.normal, hits.wo,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self._fans.rows)

    def reflected(self, layer: LayerCurves, radiosity: NDArray[np.float32]) -> NDArray[np.float32]:
        """Radiance (p, D, 3) towards the eye of radiosity (C, D, 3), without f_q and f_o."""
        out = np.empty((len(self), *radiosity.shape[1:]), np.float32)
        optics = layer.optics()
        self._in_parts(lambda begin, end: kernels.reflect(self._fans, begin, end, optics, radiosity, out))
        return out

    def by_band(self, layer: LayerCurves, factor: int, radiosity: NDArray[np.float32]) -> NDArray[np.float32]:
        """The same by band of the layer's first or second curve: (3, J, D, p); times the curve and summed over J it is
        `reflected`."""
        n_bands = len(layer.curves[factor])
        out = np.empty((3, n_bands, radiosity.shape[1], len(self)), np.float32)
        optics = layer.optics()
        self._in_parts(
            lambda begin, end: kernels.reflect_bands(self._fans, begin, end, optics, factor == 0, radiosity, out)
        )
        return out

    def _in_parts(self, work: Callable[[int, int], None]) -> None:
        parts = range(0, len(self), _PART)
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(lambda begin: work(begin, min(begin + _PART, len(self))), parts))
