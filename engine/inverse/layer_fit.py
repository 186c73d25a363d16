"""Finds changes of one or both curves of a layer that bring pixels to given radiances.

The radiance of a pixel is f_q f_o(theta_o) sum_jk a_j b_k U_jk [BenArtzi07, eq. 4.16], times its images, summed over
layers: linear in the curve A where B stays, and in B where A does. One curve is one linear problem (`curve_fit`). Both
are solved in turn, each with the other as it was found last, and each measured against what it was before: so neither
drifts to where the other takes it back.

The scale of a layer, f_q, is solved for like a curve of one band whose value is 1: `SCALE`.

Light between surfaces reaches a pixel by the same curve at the last bounce, which is linear as well, and by bounces
before, which are not. Its rows are added where they are known; for the rest the problem is solved again in the picture
that the change made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from engine.inverse.curve_fit import (
    HOLDING,
    SCALE,
    SMOOTHNESS,
    CurveFit,
    Float64Array,
    NormalEquations,
    fit_change,
    normal_equations,
)

if TYPE_CHECKING:
    from engine.precompute.direct.bandstore import BandStore

Curves = Mapping[str, Float64Array]
Rows = NDArray[np.floating]
_ONE = np.ones((1, 3))
# How often both curves are solved in turn: then each moves by less than a hundredth of its change.
N_ROUNDS = 4


class LinearSamples(Protocol):
    """n samples of what a layer reflects, linear in each of its curves: those of a picture, or of a BRDF."""

    @property
    def curves(self) -> Curves:
        """Band values (J, 3) by name."""

    def n_bands(self, name: str) -> int:
        """J of a curve, 0 where it has none of this name."""

    def rows(self, name: str, changed: Curves) -> Rows:
        """The value (J, n, 3) of each sample for a 1 in each band of a curve, where the others are as in `changed`."""


@dataclass(frozen=True, eq=False)
class LayerPixels:
    """Some pixels of a layer, n of them: the transport of their points; view (n, 3), f_q f_o and images times the unit
    of the transport; band values (J, 3) of its one or two curves by name. indirect: rows (J, n, 3) of light between
    surfaces by curve, with unit and view, where they are known. is_scaled: whether the scale that is solved for is this
    layer's."""

    store: BandStore
    view: NDArray[np.floating]
    curves: Curves
    indirect: Mapping[str, NDArray[np.floating]] = field(default_factory=dict)
    is_scaled: bool = True

    def n_bands(self, name: str) -> int:
        """J of a curve, 0 where it has none of this name."""
        return int(self.is_scaled) if name == SCALE else len(self.curves.get(name, ()))

    @property
    def radiance(self) -> NDArray[np.floating]:
        """The direct light (n, 3) that the pixels reflect."""
        first, *second = self.curves.values()
        return np.asarray(self.store.radiance(first, second[0] if second else _ONE) * self.view)

    def at(self, which: NDArray[np.bool_]) -> LayerPixels:
        """Some of the pixels."""
        between = {name: rows[:, which] for name, rows in self.indirect.items()}
        return replace(self, store=self.store.take(np.flatnonzero(which)), view=self.view[which], indirect=between)

    def rows(self, name: str, changed: Curves) -> Rows:
        """The radiance (J, n, 3) of each pixel for a 1 in each band of a curve, where the other is as in `changed`."""
        if name == SCALE:
            first = next(iter(self.curves))
            values = {**self.curves, **changed}[first]
            return np.einsum("jnc,jc->nc", self.rows(first, {**changed, SCALE: _ONE}), values)[None]
        place = list(self.curves).index(name)
        first_curve, *second = ({**self.curves, **changed}[each] for each in self.curves)
        curves = first_curve, second[0] if second else _ONE
        n_bands = self.store.bands[place]
        direct = self.store.fill(place, curves, np.ones(n_bands), np.float32, wavelet=False).numbers
        rows = direct.astype(np.float64) * self.view
        rows = rows + self.indirect[name] if name in self.indirect else rows
        return rows * changed[SCALE] if SCALE in changed and self.is_scaled else rows


@dataclass(frozen=True, eq=False)
class LayerFit:
    """fits: what was found of each curve by its name; left (n, 3): the radiance that is still missing."""

    fits: dict[str, CurveFit]
    left: NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class HeldPixels:
    """Pixels that are to stay as they are: m of the same layers, and their weights (m, 3)."""

    layers: Sequence[LinearSamples]
    weights: NDArray[np.floating]


def fit_layers(
    layers: Sequence[LinearSamples], names: Sequence[str], missing: NDArray[np.floating], weights: NDArray[np.floating],
    held: HeldPixels | None = None, smoothness: float = SMOOTHNESS, holding: float = HOLDING, in_grey: bool = False,
) -> LayerFit:  # fmt: skip
    """The changes of the curves of these names that add the missing radiance (n, 3) to pixels.

    layers: those that share the curves, at the same n pixels, the one that decides their band values first; weights
    (n, 3): see `curve_fit.radiance_weights`; smoothness, holding, in_grey: see `curve_fit.fit_change`.
    """
    before = {name: _ONE if name == SCALE else layers[0].curves[name] for name in names}
    found, fits, left = dict(before), dict[str, CurveFit](), missing
    for _ in range(N_ROUNDS if len(names) > 1 else 1):
        for name in names:
            rows = _rows(layers, name, found)
            # What this curve is to add to what it was, with the other as it is now.
            wanted = left + np.einsum("jnc,jc->nc", rows, found[name] - before[name])
            fixed = None if held is None else _held_equations(held, name, found, before)
            equations = normal_equations(rows, wanted, weights)
            fits[name] = fit = fit_change(equations, before[name], fixed, smoothness, holding, in_grey)
            found[name] = before[name] + fit.change
            left = wanted - np.einsum("jnc,jc->nc", rows, fit.change)
    return LayerFit(fits, left)


def _rows(layers: Sequence[LinearSamples], name: str, changed: Curves) -> Rows:
    """The rows of a curve in all layers that have it in so many bands."""
    n_bands = layers[0].n_bands(name)
    return np.asarray(sum(each.rows(name, changed) for each in layers if each.n_bands(name) == n_bands))


def _held_equations(held: HeldPixels, name: str, now: Curves, before: Curves) -> NormalEquations:
    """The equations that pixels keep the radiance that they had, for a change of one curve from where it was; the other
    may have changed."""
    rows = _rows(held.layers, name, now)
    gone = np.zeros(rows.shape[1:])
    if any(now[other] is not before[other] for other in now if other != name):
        gone = np.einsum("jnc,jc->nc", _rows(held.layers, name, before) - rows, before[name])
    return normal_equations(rows, gone, held.weights)
