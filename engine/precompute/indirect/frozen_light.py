"""Indirect light frozen for the edits of an object: sums over what was contracted, for each frame of a drag.

With d the equivalent albedo of the edited object, a layer's radiance is the polynomial Σ_n d^n V_n, and that of a layer
whose curve f is edited Σ_n d^n Σ_j f_j F_jn [BenArtzi07, eq. 6.7, 6.8]. The light that an edited curve sends on at the
second bounce is linear in the curve as well [BenArtzi07, eq. 6.9]. Frozen for one curve, it follows an edit by the
change δ of f_q f:

    L = L⁰ + Σ_k δ_k L_k + Σ_n Σ_k (d^n − d⁰^n) δ_k L_nk + Σ_r Σ_k δ_r δ_k M_rk ,

where L_nk is of light that reaches the curve by n reflections off its object, and M of light that meets it twice. At a
layer whose own curve changes by ε, Σ_r Σ_k ε_r δ_k L_rk is added.

Each sum is a product of a vector and a matrix per colour channel. NumPy leaves it to a threaded BLAS, which takes about
a millisecond for 64 bands of 25,000 points; compute shaders of the software renderer took 13 to 30. The window imports
this module, and no compiler.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

# Beyond this, products with single-precision numbers are summed in double precision.
_LARGE = 1e12


@dataclass(frozen=True)
class SelectedCurve:
    """The layer, by its number among all, and the curve of it whose bands are selected."""

    layer: int
    factor: int


@dataclass(frozen=True, eq=False)
class Modes:
    """K modes of the changes of a curve of J bands: shapes (J, K); weights (K, J), which give the amounts of a change,
    those nearest to it."""

    shapes: Float32Array
    weights: Float64Array


@dataclass(frozen=True, eq=False)
class FrozenCurve:
    """An edited curve at the first bounce as it was frozen, values (J, 3), and modes of its changes."""

    values: Float64Array
    modes: Modes


@dataclass(frozen=True, eq=False)
class FrozenGloss:
    """Light of an edited curve at the second bounce by its change. curve: which; tint (3,); frozen (J, 3): f_q f when
    frozen, without the tint; knots (K,): bands; effect (J, 3): the mean light of all points, times their f_q, per
    unit of each band; modes: K' of its changes; by receiving layer, where there is enough of it: by_layer (3, K, p);
    pairs (3, K', K', p): light that met the curve twice; by_power (3, N, K', p): light that it sends on, by the first
    to the Nth power of the edited object's albedo, which was `albedo` (3,); products: where the layer's own curve is
    edited."""

    curve: SelectedCurve
    tint: Float64Array
    frozen: Float64Array
    knots: NDArray[np.intp]
    effect: Float64Array
    modes: Modes
    albedo: Float64Array
    by_layer: dict[int, Float32Array] = field(default_factory=dict)
    pairs: dict[int, Float32Array] = field(default_factory=dict)
    by_power: dict[int, Float32Array] = field(default_factory=dict)
    products: dict[int, Float32Array] = field(default_factory=dict)

    def change(self, edit: LightEdit) -> Float64Array:
        """δ (J, 3), the tint included."""
        return self.tint * (edit.sent[self.curve.layer] - self.frozen)

    @property
    def n_bytes(self) -> int:
        """Memory of the sums that follow the curve."""
        parts = self.by_layer, self.pairs, self.by_power, self.products
        return sum(array.nbytes for part in parts for array in part.values())

    def unrepresented(self, edit: LightEdit) -> float:
        """The mean light of the part of the change that the knots leave out: all of it where nothing is stored."""
        change = self.change(edit)
        if not self.by_layer:
            return float(np.sum(np.abs(change) * self.effect))
        bands = np.arange(len(change))
        found = np.stack([np.interp(bands, self.knots, change[self.knots, c]) for c in range(3)], axis=1)
        return float(np.sum(np.abs(change - found) * self.effect))

    def departure(self, edit: LightEdit) -> float:
        """The change relative to the light of this curve when frozen."""
        whole = float(np.sum(np.abs(self.tint * self.frozen) * self.effect))
        return float(np.sum(np.abs(self.change(edit)) * self.effect)) / whole if whole > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class LightEdit:
    """An edit of what is frozen. albedo (3,): d of the edited object; by the number of each layer whose curve is
    edited: curves (J, 3) at the first bounce, and sent (J, 3), f_q f at the second."""

    albedo: Float64Array
    curves: Mapping[int, Float64Array]
    sent: Mapping[int, Float64Array]


@dataclass(frozen=True, eq=False)
class FrozenLight:
    """Radiance at the gather points without f_q and f_o. reflected: V (3, D, p) of each layer by its number; bands: F
    (3, J, D, p) of each whose curve is edited, instead; curves: of these, where they reflect what an edited curve sends
    on; gloss: what these curves change at the second bounce."""

    reflected: dict[int, Float32Array]
    bands: dict[int, Float32Array]
    curves: dict[int, FrozenCurve] = field(default_factory=dict)
    gloss: tuple[FrozenGloss, ...] = ()

    @property
    def n_bytes(self) -> int:
        whole = sum(array.nbytes for array in (*self.reflected.values(), *self.bands.values()))
        return whole + sum(each.n_bytes for each in self.gloss)

    def dependence(self, layer: int, edit: LightEdit) -> bytes:
        """Identifies the radiance of a layer after an edit."""
        used = [edit.albedo, *([edit.curves[layer]] if layer in self.bands else [])]
        used += [edit.sent[each.curve.layer] for each in self.gloss if layer in each.by_layer]
        return b"".join(array.tobytes() for array in used)

    def departure(self, edit: LightEdit) -> float:
        """How far edited curves have moved, at most: the change relative to their light at the second bounce."""
        return max((each.departure(edit) for each in self.gloss), default=0.0)

    def unrepresented(self, edit: LightEdit) -> float:
        """The mean light that knots leave out after an edit."""
        return sum(each.unrepresented(edit) for each in self.gloss)

    def radiance(self, layer: int, edit: LightEdit) -> NDArray[np.floating]:
        """Radiance (p, 3) of a layer, by its number, after an edit."""
        planes = self.bands[layer] if layer in self.bands else self.reflected[layer]
        # Powers in double precision: beyond single, what they multiply may be 0.
        powers = edit.albedo ** np.arange(planes.shape[-2])[:, None]
        total = _sum(edit.curves[layer][:, None] * powers if layer in self.bands else powers, planes)
        for gloss in self.gloss:
            change = gloss.change(edit)
            if layer in gloss.by_layer:
                total += _sum(change[gloss.knots], gloss.by_layer[layer])
            amounts = gloss.modes.weights @ change
            if layer in gloss.pairs:
                total += _sum(amounts[:, None] * amounts, gloss.pairs[layer])
            if layer in gloss.by_power:
                exponents = np.arange(1, gloss.by_power[layer].shape[1] + 1)[:, None]
                rise = edit.albedo**exponents - gloss.albedo**exponents
                total += _sum(rise[:, None] * amounts, gloss.by_power[layer])
            if layer in gloss.products:
                own = self.curves[layer]
                total += _sum(
                    (own.modes.weights @ (edit.curves[layer] - own.values))[:, None] * amounts, gloss.products[layer]
                )
        return np.ascontiguousarray(total.T)


def _sum(weights: Float64Array, planes: Float32Array) -> NDArray[np.floating]:
    """Σ weights (..., 3) · planes (3, ..., p) over all but the channel and the point: (3, p)."""
    flat = np.moveaxis(weights, -1, 0).reshape(3, -1)
    matrices = planes.reshape(3, flat.shape[1], planes.shape[-1])
    if np.abs(flat).max(initial=0.0) < _LARGE:
        return np.stack([row.astype(np.float32) @ matrix for row, matrix in zip(flat, matrices, strict=True)])
    return np.stack([row @ matrix.astype(np.float64) for row, matrix in zip(flat, matrices, strict=True)])
