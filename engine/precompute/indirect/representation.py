"""The representation of indirect light between precomputation and edits, and its freezing for an object.

Freezing contracts the precomputed light into the polynomials [BenArtzi07, eq. 6.7, 6.8] that an edit needs: with n the
power of the edited object's albedo, Σ_n d^n V_n for every layer, and for the selected one Σ_n d^n Σ_j c_j F_jn.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.irradiance import NO_OBJECT
from engine.precompute.indirect.reflection import HemisphereSamples


@dataclass(frozen=True)
class SelectedCurve:
    """The layer, by its number among all, and the curve of it whose bands are selected."""

    layer: int
    factor: int


@dataclass(frozen=True, eq=False)
class FrozenLight:
    """Radiance at the gather points without f_q and f_o. reflected: V (p, D, 3) of each layer by its number; bands: F
    (3, J, D, p) of the selected layer."""

    reflected: dict[int, NDArray[np.float32]]
    bands: NDArray[np.float32]


Freezing = Generator[None, None, FrozenLight]


class Representation(Protocol):
    """A representation of indirect light for edits."""

    @property
    def n_bytes(self) -> int:
        """Memory in addition to the traced rays."""

    def freeze(
        self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT, selected: SelectedCurve | None = None
    ) -> Freezing:
        """The light under these layers as a polynomial in the albedo of the object `edited`. A generator of steps."""


class GatherPolynomial:
    """The default: the records that the gather points' rays hit, times a polynomial at the records, which all points
    share.

    Measured against the thesis' tensor (`dense`) with the same 512 rays of 951 gather points, a Cornell box divided
    into M objects with one curve of 64 bands each, N bounces (`make measure`, indirect_representations.csv; seconds
    of one processor, both pictures within 3e-7 of the plain sum):

         M  N    MB: this, dense    s to make after tracing    s to freeze
         2  4       4.2     6.6            0.05  0.09          0.026  0.003
         4  4       4.2    24.8            0.04  0.22          0.031  0.005
         7  4       4.2    86.9            0.04  0.57          0.023  0.054
        12  4       4.2   331.6            0.05  2.82          0.022  0.241
         7  2       3.9     5.1            0.04  0.06          0.020  0.001
         7  3       4.2    25.6            0.04  0.14          0.019  0.005
         7  5       4.2   240.3            0.05  2.05          0.030  0.212

    A small tensor freezes faster. But it grows with C(M + N - 1, N - 1), to 1.5 GB at the 16,300 gather points of the
    built-in Cornell box (the thesis stored 1,461 MB). It must be rebuilt for another light or roughness, and a second
    curve or bands at the second bounce would multiply it again.
    """

    def __init__(self, light: IndirectLight, keeps: bool = True) -> None:
        """keeps: store what does not depend on curves, for the next freezing."""
        self._light, self._keeps = light, keeps
        self._samples: dict[int, HemisphereSamples] = {}

    def with_light(self, light: IndirectLight) -> GatherPolynomial:
        """The same for another light; reuses the ray weights if the rays are the same."""
        other = GatherPolynomial(light, self._keeps)
        if light.points.samples is self._light.points.samples:
            other._samples = self._samples
        return other

    @property
    def n_bytes(self) -> int:
        return sum(samples.n_bytes for samples in self._samples.values())

    def freeze(
        self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT, selected: SelectedCurve | None = None
    ) -> Freezing:
        light = self._light.outgoing_radiance(layers, edited)
        yield None
        reflected: dict[int, NDArray[np.float32]] = {}
        bands = np.zeros((3, 0, light.n_powers, 0), np.float32)
        for i_object in sorted({layer.i_object for layer in layers}):
            samples = self._samples_of(i_object)
            own = [i for i, layer in enumerate(layers) if layer.i_object == i_object]
            samples.forget_all_but([layers[i].curves for i in own])
            whole = [i for i in own if selected is None or i != selected.layer]
            found = yield from samples.reflect([layers[i].curves for i in whole], light)
            reflected |= zip(whole, found, strict=True)
            if selected is not None and selected.layer in own:
                bands = yield from samples.by_band(layers[selected.layer].curves, selected.factor, light)
        return FrozenLight(reflected, bands)

    def _samples_of(self, i_object: int) -> HemisphereSamples:
        if i_object not in self._samples:
            self._samples[i_object] = self._light.points.hemisphere_samples(i_object, keeps=self._keeps)
        return self._samples[i_object]
