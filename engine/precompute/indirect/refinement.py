"""Where a picture requires more samples: the light of its gather points under the present materials, with its noise.

The radiance that each half of the rays gathers is compared: the mean of the halves is the light, their difference the
noise. Both decide where blocks of the lattice are split, and which points get extra sample sets.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect._ray_kernels import NORMAL
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.indirect_light import Footprint, GatherPoints
from engine.precompute.indirect.lattice import Lattice, least_alike
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.smoothing import extra_sample_sets

_PHOTONS_SHARE = np.float32(0.3)


class Refinement:
    """Light, noise (P, 3) and clearance (P,) of a picture under certain layers, known at the gather points so far."""

    def __init__(self, lattice: Lattice, layers: Sequence[IndirectLayer], radiosity: NDArray[np.float32]) -> None:
        """radiosity (C, D, 3): rough radiosity of the first C records."""
        self.lattice = lattice
        self._layers, self._radiosity = layers, radiosity
        n_points = len(lattice.hits.pixel)
        self._light, self._noise = np.zeros((2, n_points, 3), np.float32)
        self._clearance = np.zeros(n_points, np.float32)

    def measure(self, points: GatherPoints, n_records: int) -> Generator[None, None, None]:
        """Computes light and noise of these gather points, whose rays hit n_records records. A generator of steps.

        Glossy surfaces reflect by albedo, with a share of the photons, because their directional reflection is noisier.
        """
        n_new = n_records - len(self._radiosity)  # not known yet: dark
        radiosity = np.concatenate([self._radiosity, np.zeros((n_new, *self._radiosity.shape[1:]), np.float32)])
        caustics = points.caustic_flux(self._layers)
        caustics = caustics._replace(light=_PHOTONS_SHARE * caustics.light)
        first, second = yield from points.halves(self._layers, OutgoingRadiance(radiosity, None, caustics))
        rows = points.samples.rows
        self._light[rows], self._noise[rows] = 0.5 * (first + second), 0.5 * abs(first - second)
        self._clearance[rows] = points.samples.clearance

    def split_blocks(self) -> bool:
        """Splits the blocks of the lattice that require it; returns whether gather points are missing now."""
        return self.lattice.refine(self._light, self._noise, self._clearance)

    def extra_sets(
        self, points: GatherPoints, footprint: Footprint, most: float
    ) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
        """The extra sample sets (q,) of noisy gather points that the picture shows: the row of each, and its number at
        that row. most: on average per point."""
        rows, (numbers, weights) = points.samples.rows, footprint
        # The squared weight with which each gather point contributes to the picture: its share of the variance.
        shown = np.bincount(numbers.ravel(), weights.ravel() ** 2, len(rows)).astype(np.float64)
        alike = least_alike(points.lobe_axes != NORMAL)
        n = extra_sample_sets(points.hits, rows, alike, self._light[rows], self._noise[rows], shown, most)
        nth = np.arange(1, n.sum() + 1) - np.repeat(np.cumsum(n) - n, n)
        return np.repeat(rows, n), nth.astype(np.uint8)
