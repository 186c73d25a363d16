"""What of reflection no curve changes, kept from one freezing to the next.

How a layer weighs the rays of its fans, and which angles its curves take there, depends on the model and its quotient
alone: six bytes a ray at most, two where the only curve is the same at all angles. With these at hand a contraction is
one pass over the rays that reads a cell's polynomial, a weight and a value of the curve. To keep the contracted
operator of points and cells instead was rejected: it takes as much memory (a point's 400 hits fall on 270 cells),
saves a quarter of the time, and every edit of a curve makes it wrong.

What a glossy surface sends along the remembered rays depends on its curves: it is kept object by object, until an
object's curves are others.
"""

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect import _reflection_kernels as kernels
from engine.precompute.indirect import _second_bounce_kernels as second_kernels
from engine.precompute.indirect.direction_patterns import lobe_tables
from engine.precompute.indirect.second_bounce import N_LOBE_RAYS, SecondBounceLight


def n_angles_of(optics: kernels.ReflectingLayer) -> int:
    """How many angles the curves take: none where the only one is the same at all of them."""
    return 0 if optics.kind_a == kernels.CONSTANT else 1 + (optics.kind_b >= 0)


class RayWeights:
    """How one layer weighs the rays of one object's fans, found part by part; parts may be found by several threads."""

    def __init__(self, samples: kernels.SampleArrays, optics: kernels.ReflectingLayer, keeps: bool) -> None:
        """keeps: so that every part has to be found once; call `complete` then."""
        self._samples, self._optics = samples, optics
        self.n_angles = n_angles_of(optics)
        self._cached = self._room(0, len(samples.rows)) if keeps else None
        self._is_complete = False

    def part(self, begin: int, end: int) -> kernels.WeightArrays:
        """Of points [begin, end)."""
        stored_weights = self._room(begin, end) if self._cached is None else self._cached
        if not self._is_complete:
            kernels.weigh_rays(self._samples, begin, end, self._optics, stored_weights)
        return stored_weights

    def complete(self) -> None:
        """All parts were found."""
        self._is_complete = self._cached is not None

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else sum(array.nbytes for array in self._cached[:3])

    def _room(self, begin: int, end: int) -> kernels.WeightArrays:
        shape = end - begin, self._samples.records.shape[1]
        angles = np.empty((self.n_angles, *shape), np.uint16)
        return kernels.WeightArrays(np.empty(shape, np.uint16), np.empty(shape[0], np.float32), angles, begin)


class SecondBounceWeights:
    """The light along the remembered rays of one object's fans; what glossy surfaces send along them may be kept."""

    def __init__(
        self, samples: kernels.SampleArrays, position: NDArray[np.float32], records: second_kernels.GlossyHits,
        area: NDArray[np.float32], keeps: bool,
    ) -> None:  # fmt: skip
        """area (p,): see `photons.NearbyPhotons`."""
        self._samples, self._position, self._records, self._area = samples, position, records, area
        self._first = int(records.start[0])
        self._cached = np.empty((int(records.start[-1]) - self._first, 3, 3), np.float32) if keeps else None
        self._cached_of: dict[int, tuple[tuple[bytes, ...], second_kernels.SampledLights]] = {}

    def missing_objects(self, light: SecondBounceLight, step: int) -> NDArray[np.bool_]:
        """The objects (M,) whose surfaces send what is not known yet of the parts of a step, by its number: another
        light may be asked for between two steps."""
        looks, lamps = self._cached_of.get(step, ((), None))
        if lamps is not light.lamps:
            return np.ones(len(light.digests), bool)
        return np.array([now != then for now, then in zip(light.digests, looks, strict=True)])

    def part(self, begin: int, end: int, light: SecondBounceLight, wanted: NDArray[np.bool_]) -> kernels.SecondBounce:
        """Of points [begin, end)."""
        records, base = self._records, int(self._records.start[begin])
        n = int(records.start[end]) - base
        sent, first = (np.empty((n, 3, 3), np.float32), base) if self._cached is None else (self._cached, self._first)
        if wanted.any():
            second_kernels.second_bounce_light(
                self._samples, self._position, records, begin, end, light.objects, light.layers, light.lamps,
                lobe_tables(N_LOBE_RAYS), self._area, light.per_area, wanted, first, sent,
            )  # fmt: skip
        lit = np.empty((n, *light.radiosity.shape[2:]), np.float32)
        second_kernels.light_second_bounce(
            self._samples, records, begin, end, light.objects, sent, first, light.radiosity, light.edited,
            light.inverse,
            lit,
        )  # fmt: skip
        return kernels.SecondBounce(records.start, records.ray, lit, base)

    def complete(self, light: SecondBounceLight, step: int) -> None:
        """The parts of a step were found under this light."""
        if self._cached is not None:
            self._cached_of[step] = light.digests, light.lamps

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else self._cached.nbytes
