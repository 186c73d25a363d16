"""What one layer reflects of the rays and of the photons of an object's gather points, but for its curves: computed
part by part, once where it is kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct._projection_kernels import ViewedPoints
from engine.precompute.indirect._photon_kernels import ReflectedPhotons, weigh_nearby
from engine.precompute.indirect._reflection_kernels import (
    CONSTANT,
    ReflectingLayer,
    SampleArrays,
    WeightArrays,
    weigh_rays,
)
from engine.precompute.indirect.photons import NearbyPhotons


def weights_key(optics: ReflectingLayer) -> tuple[int, bytes]:
    """What weights depend on."""
    return optics.model, optics.q.tobytes()


def n_angles_of(optics: ReflectingLayer) -> int:
    """The number of angles that the curves take: none if the only curve is constant."""
    return 0 if optics.kind_a == CONSTANT else 1 + (optics.kind_b >= 0)


class RayWeights:
    """The weights of one layer for the rays of one object, computed part by part; several threads may compute parts."""

    def __init__(self, samples: SampleArrays, surface: ViewedPoints, optics: ReflectingLayer, keeps: bool) -> None:
        """surface: the points in the layer's frame; keeps: compute every part only once; call `complete`
        afterwards."""
        self._samples, self._surface, self._optics = samples, surface, optics
        self.n_angles = n_angles_of(optics)
        self._cached = self._room(0, len(samples.rows)) if keeps else None
        self._is_complete = False

    def part(self, begin: int, end: int) -> WeightArrays:
        """The weights of points [begin, end)."""
        stored_weights = self._room(begin, end) if self._cached is None else self._cached
        if not self._is_complete:
            weigh_rays(self._samples, begin, end, self._optics, self._surface, stored_weights)
        return stored_weights

    def complete(self) -> None:
        """Marks all parts as computed."""
        self._is_complete = self._cached is not None

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else sum(array.nbytes for array in self._cached[:3])

    def _room(self, begin: int, end: int) -> WeightArrays:
        shape = end - begin, self._samples.records.shape[1]
        angles = np.empty((self.n_angles, *shape), np.uint16)
        return WeightArrays(np.empty(shape, np.uint16), np.empty(shape[0], np.float32), angles, begin)


class PhotonWeights:
    """The same of the photons near these points."""

    def __init__(
        self, samples: SampleArrays, nearby: NearbyPhotons, surface: ViewedPoints, optics: ReflectingLayer, keeps: bool
    ) -> None:  # fmt: skip
        """surface, keeps: see `RayWeights`."""
        self._samples = samples._replace(tangent=surface.tangent, normal=surface.normal)
        self._nearby, self._optics = nearby, optics
        self.n_angles = n_angles_of(optics)
        self._cached = self._room(0, len(nearby.photon)) if keeps else None
        self._is_complete = False

    def part(self, begin: int, end: int, directions: NDArray[np.float32]) -> ReflectedPhotons:
        """The weights of photons near points [begin, end), which fly in directions (n, 3)."""
        start = self._nearby.start
        stored_weights = self._room(int(start[begin]), int(start[end])) if self._cached is None else self._cached
        if not self._is_complete:
            weigh_nearby(self._samples, begin, end, self._optics, self._nearby, directions, stored_weights)
        return stored_weights

    def complete(self) -> None:
        """Marks all parts as computed."""
        self._is_complete = self._cached is not None

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else self._cached.weights.nbytes + self._cached.angles.nbytes

    def _room(self, begin: int, end: int) -> ReflectedPhotons:
        n = end - begin
        return ReflectedPhotons(np.empty(n, np.float32), np.empty((self.n_angles, n), np.uint16), begin)
