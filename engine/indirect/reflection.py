"""What the gather points reflect of the cells' light, layer by layer: with the curves as they are, or by band of one.

Both are sums over the same rays. Nothing is kept between two calls: the rays' directions come from tables, and a
point's cells take two bytes a ray, so that this costs less than reading stored bands would.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.indirect import _reflection_kernels as kernels
from engine.indirect import _second_kernels as second_kernels
from engine.indirect.curves import LayerCurves
from engine.indirect.gather import FanSize, Gathered, object_of_rows
from engine.indirect.rays import cosine_tables, pole_tables
from engine.indirect.second_bounce import N_POLE_RAYS, SecondLight
from engine.scene.hits import PrimaryHits

_PART = 128


@dataclass(frozen=True, eq=False)
class SentLight:
    """What surfaces send towards gather points: matt (C, D, 3), radiosity of the cells that goes to all sides alike,
    and what glossy ones send to one side, None where that counts as matt."""

    matt: NDArray[np.float32]
    glossy: SecondLight | None


class Fans:
    """The gather points of one object, all their rays or one half of them."""

    def __init__(
        self, hits: PrimaryHits, gathered: Gathered, i_object: int, pole: int, size: FanSize,
        half: int | None = None,
    ) -> None:  # fmt: skip
        begin, end = np.searchsorted(object_of_rows(hits, gathered.rows), (i_object, i_object + 1))
        rows = gathered.rows[begin:end]
        self._position = hits.position
        records = gathered.records
        self._records = records._replace(start=records.start[begin : end + 1], times=records.times[begin:end])
        self._fans = kernels.Fans(
            rows, np.full(len(rows), pole, np.int64), gathered.seen[begin:end], -1 if half is None else half,
            cosine_tables(size.n_cosine), pole_tables(size.n_pole), hits.tangent, hits.normal, hits.wo,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self._fans.rows)

    def reflected(self, layers: Sequence[LayerCurves], light: SentLight) -> list[NDArray[np.float32]]:
        """Radiance (p, D, 3) of each layer towards the eye, without f_q and f_o."""
        out = [np.empty((len(self), *light.matt.shape[1:]), np.float32) for _ in layers]
        optics = [layer.optics(folded=True) for layer in layers]

        def work(begin: int, end: int, second: kernels.Second) -> None:
            for each, result in zip(optics, out, strict=True):
                kernels.reflect(self._fans, begin, end, each, light.matt, second, result)

        self._in_parts(light, work)
        return out

    def by_band(self, layer: LayerCurves, factor: int, light: SentLight) -> NDArray[np.float32]:
        """Of one layer by band of its first or second curve: (3, J, D, p); times the curve and summed over J it is
        `reflected`."""
        out = np.empty((3, len(layer.curves[factor]), light.matt.shape[1], len(self)), np.float32)
        optics = layer.optics()

        def work(begin: int, end: int, second: kernels.Second) -> None:
            kernels.reflect_bands(self._fans, begin, end, optics, factor == 0, light.matt, second, out)

        self._in_parts(light, work)
        return out

    def _in_parts(self, light: SentLight, work: Callable[[int, int, kernels.Second], None]) -> None:
        def do(begin: int) -> None:
            end = min(begin + _PART, len(self))
            work(begin, end, self._second(begin, end, light))

        with ThreadPoolExecutor(2) as pool:
            list(pool.map(do, range(0, len(self), _PART)))

    def _second(self, begin: int, end: int, light: SentLight) -> kernels.Second:
        """What glossy surfaces send back to points [begin, end)."""
        records, glossy = self._records, light.glossy
        base = int(records.start[begin])
        if glossy is None:
            none = np.zeros((0, *light.matt.shape[1:]), np.float32)
            return kernels.Second(np.zeros(len(self) + 1, np.int64), records.ray, none, 0)
        found = np.empty((int(records.start[end]) - base, *light.matt.shape[1:]), np.float32)
        second_kernels.second_light(
            self._fans, self._position, records, begin, end, glossy.objects, glossy.layers, glossy.lamps,
            pole_tables(N_POLE_RAYS), glossy.radiosity, glossy.edited, glossy.inverse, found,
        )  # fmt: skip
        return kernels.Second(records.start, records.ray, found, base)
