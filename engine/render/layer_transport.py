"""One layer's radiance under any curves, from stored transport: an edit sums only what it changes.

Along the edited curve, with the other one fixed, transport is one plane of numbers for each band, T_j (P, 3), and

    B = B₀ + Σ_j (c_j − c⁰_j) T_j          [BenArtzi07, eq. 4.16, 7.4]

over only those bands that differ from the curve c⁰ at which the planes were computed. B₀ stays that of c⁰ from edit to
edit, so that rounding errors do not accumulate. Where most bands differ, or the curve has become much darker, the sum B
= Σ_j c_j T_j is computed anew: this costs as much, and a dark picture is never the difference of two bright ones.

The planes are those of bands. Wavelets, which the editor has on the GPU, need few coefficients for a wide smooth edit,
but leave the others for later; a call here returns a finished picture, for which bands need no transform and no order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import n_threads, on_threads
from engine.precompute.direct.bandstore import BandStore
from engine.render._layer_kernels import BLOCK, sum_bands

# Below this share of the curve's largest value, differences from it are not precise.
DARKER = 0.1

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Planes:
    """Transport (J, P, 3) along the curve number `factor`; radiance (P, 3) under `curves`, at which it was computed."""

    factor: int
    numbers: Float32Array
    curves: tuple[Float64Array, ...]
    radiance: Float32Array


class LayerTransport:
    """Band transport of one layer at P points; see the module."""

    def __init__(self, store: BandStore) -> None:
        self._store = store
        self._curves: tuple[Float64Array, ...] = ()
        self._radiance: Float32Array = np.empty((0, 3), np.float32)
        self._planes: _Planes | None = None

    @property
    def n_bytes(self) -> int:
        """Bytes of the stored arrays."""
        return self._store.n_bytes + (0 if self._planes is None else self._planes.numbers.nbytes)

    def radiance(self, curves: Sequence[Float64Array]) -> Float32Array:
        """Radiance (P, 3) without f_q and f_o, in the unit of the transport, under the band values (J, 3) of the one or
        two curves. The array belongs to this object: do not write to it."""
        curves = (*curves, np.ones((1, 3)))[:2]
        if self._curves and _first_difference(curves, self._curves) is None:
            return self._radiance
        factor = _first_difference(curves, self._curves) if self._curves else None
        planes = self._planes
        if planes is not None and np.array_equal(curves[1 - planes.factor], planes.curves[1 - planes.factor]):
            self._radiance = _sum_bands(planes, curves[planes.factor])
        elif factor is not None and np.array_equal(curves[1 - factor], self._curves[1 - factor]):
            self._planes = None  # free the planes before new ones are made: they are large
            self._planes = self._planes_along(factor, curves)
            self._radiance = self._planes.radiance
        else:  # the first picture, or both curves at once
            self._planes = None
            self._radiance = self._store.radiance(*curves)
        self._curves = curves
        return self._radiance

    def _planes_along(self, factor: int, curves: tuple[Float64Array, ...]) -> _Planes:
        n_bands = self._store.bands[factor]
        filled = self._store.fill(factor, (curves[0], curves[1]), np.ones(n_bands), np.float32, wavelet=False)
        return _Planes(factor, filled.numbers, curves, filled.radiance)


def _first_difference(one: Sequence[Float64Array], other: Sequence[Float64Array]) -> int | None:
    """Index of the first curve that differs."""
    return next((i for i in (0, 1) if not np.array_equal(one[i], other[i])), None)


def _sum_bands(planes: _Planes, curve: Float64Array) -> Float32Array:
    """Radiance (P, 3) under another curve (J, 3) along which the planes are; see the module."""
    before = planes.curves[planes.factor]
    changed = np.flatnonzero((curve != before).any(axis=1))
    anew = 2 * len(changed) > len(curve) or bool(curve.max() < DARKER * before.max())
    bands = np.arange(len(curve)) if anew else changed
    weights = np.tile(np.asarray(curve if anew else curve - before, np.float32)[bands], (1, BLOCK // 3))
    out = np.zeros_like(planes.radiance) if anew else planes.radiance.copy()
    numbers, flat = planes.numbers.reshape(len(curve), -1), out.reshape(-1)
    step = BLOCK * -(-flat.size // (BLOCK * n_threads()))
    begins = range(0, flat.size, step)
    on_threads(lambda begin: sum_bands(numbers, bands, weights, begin, min(begin + step, flat.size), flat), begins)
    return out
