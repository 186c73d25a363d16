"""The thesis' tensor: at each gather point a number for each band and each multiset of objects [BenArtzi07, eq. 6.6].

    B(x) = Σ_j Σ_z T_jz(x) c_j d̄_z        with d̄_z the product of the albedos of the objects in z

Kept to be measured against, from the same rays and cells: see `GatherPolynomial` for how it does. Layers have one curve
here, and all bounces after the first go by albedo: a second curve, or bands at the second bounce, would multiply it by
their number of bands again.

A multiset of objects says which objects light has met, in whatever order [BenArtzi07, sect. 6.1.2]. The thesis numbers
lists of objects, M^N of them. The albedos of a list multiply alike in any order, so that one number serves all lists of
the same objects: with K places, each of which may stay empty, there are C(M + K, K).
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.precompute.indirect.frozen_light import FrozenLight, SelectedCurve
from engine.precompute.indirect.gather_polynomial import Freezing
from engine.precompute.indirect.indirect_layers import IndirectLayer, albedos_of
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance_cache import NO_OBJECT, CacheLight, bounce_radiosity
from engine.precompute.indirect.reflection import OutgoingRadiance

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


class DenseTensor:
    """T of the layers: J·Z·3 numbers a gather point. Raises InsituError where a layer has two curves."""

    def __init__(self, light: IndirectLight, layers: Sequence[IndirectLayer]) -> None:
        if any(len(layer.curves.curves) != 1 for layer in layers):
            raise InsituError("the dense tensor takes layers with one curve, expected no more")
        self._n_bounces, self._n_objects = light.n_bounces, len(light.points.lobe_axes)
        self._objects = sorted({layer.i_object for layer in layers})
        self._sets = Multisets(len(self._objects), light.n_bounces - 1)
        sent = OutgoingRadiance(
            radiosity_by_multiset(light.light, self._objects, self._sets, light.n_bounces)[:, 1:], None
        )
        self._tensors = [
            run_to_end(light.points.hemisphere_samples(each.i_object).by_band(each.curves, 0, sent)) for each in layers
        ]

    @property
    def n_bytes(self) -> int:
        return sum(tensor.nbytes for tensor in self._tensors)

    def freeze(
        self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT, curves: Sequence[SelectedCurve] = ()
    ) -> Freezing:
        """As `Representation.freeze`; the layers have the models and bands that the tensor was made for."""
        powers = self._powers(layers, edited)
        reflected: dict[int, NDArray[np.float32]] = {}
        bands: dict[int, NDArray[np.float32]] = {}
        for i, (layer, tensor) in enumerate(zip(layers, self._tensors, strict=True)):
            if i in {each.layer for each in curves}:
                bands[i] = np.matmul(powers[:, None], tensor)
            else:
                curve = layer.curves.curves[0].T.astype(np.float32)[:, None]
                n_bands, shape = tensor.shape[1], tensor.shape[2:]
                whole = np.matmul(curve, tensor.reshape(3, n_bands, -1)).reshape(3, *shape)
                reflected[i] = np.matmul(powers, whole)
            yield None
        return FrozenLight(reflected, bands)

    def _powers(self, layers: Sequence[IndirectLayer], edited: int) -> NDArray[np.float32]:
        """d̄_z / d_i^n where z holds the edited object n times, else 0, (3, D, Z - 1): the others are multiplied."""
        exponents = self._sets.exponents[1:].copy()
        n_powers, times = 1, np.zeros(len(exponents), np.int64)
        if edited in self._objects:
            place = self._objects.index(edited)
            n_powers, times = self._n_bounces, exponents[:, place].copy()
            exponents[:, place] = 0
        albedos = albedos_of(layers, self._n_objects)[self._objects]
        products = np.prod(albedos ** exponents[:, :, None], axis=1)
        powers = np.zeros((3, n_powers, len(exponents)), np.float32)
        powers[:, times, np.arange(len(exponents))] = products.T
        return powers


def radiosity_by_multiset(
    light: CacheLight, objects: Sequence[int], sets: Multisets, n_bounces: int
) -> NDArray[np.float32]:
    """Radiosity (C, Z, 3) of the records over the albedos' products, for N bounces: see `irradiance_cache`."""
    latest = np.zeros((len(light.objects), len(sets), 3), np.float32)
    latest[:, 0] = light.irradiance
    total = latest.copy()
    for _ in range(n_bounces - 2):
        bright = np.pad(_times_albedo(latest, light.objects, objects, sets), ((0, 0), (0, 0), (0, 1)))
        latest = bounce_radiosity(light.records_hit, bright, len(sets))
        total += latest
    return _times_albedo(total, light.objects, objects, sets)


def _times_albedo(
    irradiance: NDArray[np.float32], object_of_cell: NDArray[np.int32], objects: Sequence[int], sets: Multisets
) -> NDArray[np.float32]:
    """Every number (C, Z, 3) moved to the multiset with its cell's object besides; dark where that has no layer."""
    out = np.zeros_like(irradiance)
    for place, i_object in enumerate(objects):
        mine, joined = np.flatnonzero(object_of_cell == i_object), sets.joined[:, place]
        known = np.flatnonzero(joined != NONE)
        out[np.ix_(mine, joined[known])] = irradiance[np.ix_(mine, known)]
    return out
