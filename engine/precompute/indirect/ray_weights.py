"""Caches the part of the reflection operator that does not depend on the edited curve, between freezings.

The weights of a layer's rays and the arguments of its curves depend only on the model and its quotient: at most six
bytes a ray, two if the only curve is constant. A contraction is then one pass over the rays that reads a record's
polynomial, a weight and a value of the curve. Storing the contracted operator of points and records instead was
rejected: it takes as much memory (a point's 400 hits lie on 270 records), saves a quarter of the time, and every edit
of a curve invalidates it.

The light that glossy surfaces reflect along the stored rays depends on their curves. It is cached per object until the
object's curves change.
"""

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect import _reflection_kernels as kernels
from engine.precompute.indirect import _second_bounce_kernels as second_kernels
from engine.precompute.indirect.direction_patterns import lobe_tables
from engine.precompute.indirect.second_bounce import N_LOBE_RAYS, SecondBounceLight


def n_angles_of(optics: kernels.ReflectingLayer) -> int:
    """The number of angles that the curves take: none if the only curve is constant."""
    return 0 if optics.kind_a == kernels.CONSTANT else 1 + (optics.kind_b >= 0)


class RayWeights:
    """The weights of one layer for the rays of one object, computed part by part; several threads may compute parts."""

    def __init__(self, samples: kernels.SampleArrays, optics: kernels.ReflectingLayer, keeps: bool) -> None:
        """keeps: compute every part only once; call `complete` afterwards."""
        self._samples, self._optics = samples, optics
        self.n_angles = n_angles_of(optics)
        self._cached = self._room(0, len(samples.rows)) if keeps else None
        self._is_complete = False

    def part(self, begin: int, end: int) -> kernels.WeightArrays:
        """The weights of points [begin, end)."""
        stored_weights = self._room(begin, end) if self._cached is None else self._cached
        if not self._is_complete:
            kernels.weigh_rays(self._samples, begin, end, self._optics, stored_weights)
        return stored_weights

    def complete(self) -> None:
        """Marks all parts as computed."""
        self._is_complete = self._cached is not None

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else sum(array.nbytes for array in self._cached[:3])

    def _room(self, begin: int, end: int) -> kernels.WeightArrays:
        shape = end - begin, self._samples.records.shape[1]
        angles = np.empty((self.n_angles, *shape), np.uint16)
        return kernels.WeightArrays(np.empty(shape, np.uint16), np.empty(shape[0], np.float32), angles, begin)


class SecondBounceWeights:
    """The light along the stored rays of one object; the reflection of glossy surfaces may be cached."""

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
        """The objects (M,) whose reflection is not cached for the parts of a step, by its number: the light may change
        between two steps."""
        looks, lamps = self._cached_of.get(step, ((), None))
        if lamps is not light.lamps:
            return np.ones(len(light.digests), bool)
        return np.array([now != then for now, then in zip(light.digests, looks, strict=True)])

    def part(self, begin: int, end: int, light: SecondBounceLight, wanted: NDArray[np.bool_]) -> kernels.SecondBounce:
        """The second-bounce light of points [begin, end)."""
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
        """Marks the parts of a step as computed under this light."""
        if self._cached is not None:
            self._cached_of[step] = light.digests, light.lamps

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else self._cached.nbytes
