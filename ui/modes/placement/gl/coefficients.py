"""The state of incremental rendering: which coefficients to add next, which are on screen, the error of the picture.

B = Σ_k c_k T_k is on screen for some c_shown; the desired curve is c_wanted. Each frame adds Δc_k T_k for the K terms
with the largest effect on the image, |Δc_k|·‖T_k‖ [BenArtzi07, ch. 7; there by |Δc_k| alone]. c_shown is in float64 and
moved by exactly the float32 amounts that were added, so rounding of a coefficient is not lost, only deferred.

What does drift is the float32 sum in the accumulator: each addition rounds by up to 2⁻²⁴ of the picture and of what is
added. A running estimate (roots of summed squares) relative to the picture follows it. Above `TIDY_ABOVE` an idle
renderer rebuilds the sum from zero, above `REBUILD_ABOVE` the next step is a rebuild even during a drag; both are below
the 1e-5 that a picture's error may be. A step that would add as many terms as the whole sum has is made a rebuild too:
it costs the same, and has no drift. No GL here, so all of it is tested as arithmetic.

Shapes: J coefficients, K terms of one step, 3 colour channels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

TIDY_ABOVE = 1e-6
REBUILD_ABOVE = 3e-6
_ROUNDING = 2.0**-24
_LAST_DIGIT = 2.0**-23  # of a float32: one addition cannot get nearer to the wanted value
_NEGLIGIBLE = 1e-9

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RefineStep:
    """The next step: add `deltas` (K,3) of the terms `indices` (K,), or sum all terms of `indices` from zero."""

    kind: Literal["nothing", "increment", "rebuild", "tidy"]
    indices: NDArray[np.intp]
    deltas: Float64Array


class CoefficientState:
    """c_shown and c_wanted of one layer whose transport has the norms ‖T_k‖ (J,3) over all its samples."""

    def __init__(self, norms: NDArray[np.floating]) -> None:
        self.norms: Float64Array = np.array(norms, dtype=np.float64)
        self.wanted: Float64Array = np.zeros_like(self.norms)
        self.shown: Float64Array | None = None
        self.may_rebuild = True
        self._drift_squared = 0.0

    def start_from(self, shown: NDArray[np.floating] | None) -> None:
        """Continue increments from a picture computed elsewhere; no rebuild, which would bring the old one back.

        shown: the (J,3) coefficients of that picture; None when unknown, then nothing can be added.
        """
        self.may_rebuild = False
        self.shown = None if shown is None else np.array(shown, dtype=np.float64)
        self._drift_squared = 0.0

    def next_step(self, limit: int | None = None) -> RefineStep:
        """The most effective `limit` terms (None: all that differ), or a rebuild where that is due."""
        if self.shown is None:
            return self._rebuild("rebuild") if self.may_rebuild else _NOTHING
        pending = self.pending()
        if pending.size == 0:
            return self._rebuild("tidy") if self.may_rebuild and self.drift() > TIDY_ABOVE else _NOTHING
        step = RefineStep("increment", pending[:limit], (self.wanted - self.shown)[pending[:limit]])
        return self._rebuild("rebuild") if self.may_rebuild and self._rebuild_is_due(step, limit) else step

    def pending(self) -> NDArray[np.intp]:
        """Indices of the terms that differ noticeably from the wanted ones, the largest effect first."""
        shown = self._shown_or_zero()
        missing = self.wanted - shown
        effect = self._effects(np.where(np.abs(missing) > _LAST_DIGIT * np.abs(self.wanted), missing, 0.0))
        threshold = _NEGLIGIBLE * max(_length(self._effects(self.wanted)), _length(self._effects(shown)))
        order = np.argsort(-effect, kind="stable")
        return order[effect[order] > threshold]

    def remaining_effect(self) -> float:
        """sqrt(Σ_k |Δc_k|²‖T_k‖²), the length of what is missing in the picture if the T_k were orthogonal."""
        return _length(self._effects(self.wanted - self._shown_or_zero()))

    def drift(self) -> float:
        """Estimated rounding error of the accumulator relative to the picture's length."""
        return _relative(self._drift_squared**0.5, _length(self._effects(self._shown_or_zero())))

    def record_increment(self, indices: NDArray[np.intp], added: Float64Array) -> None:
        """Note that the terms were added with exactly the amounts `added` (K,3)."""
        self._drift_squared = self._drift_squared_after(indices, added)
        assert self.shown is not None
        self.shown[indices] += added

    def record_rebuild(self, coefficients: Float64Array) -> None:
        """Note that the accumulator is the sum from zero of exactly these (J,3)."""
        self.shown = np.array(coefficients, dtype=np.float64)
        self._drift_squared = 0.0

    def _rebuild(self, kind: Literal["rebuild", "tidy"]) -> RefineStep:
        indices = np.flatnonzero(np.any(self.wanted != 0.0, axis=1))
        return RefineStep(kind, indices, self.wanted[indices])

    def _rebuild_is_due(self, step: RefineStep, limit: int | None) -> bool:
        n_terms = int(np.count_nonzero(np.any(self.wanted != 0.0, axis=1)))
        if step.indices.size >= n_terms and (limit is None or limit >= n_terms):
            return True
        after = self._shown_or_zero().copy()
        after[step.indices] += step.deltas
        drift = self._drift_squared_after(step.indices, step.deltas) ** 0.5
        return _relative(drift, _length(self._effects(after))) > REBUILD_ABOVE

    def _drift_squared_after(self, indices: NDArray[np.intp], added: Float64Array) -> float:
        effects = np.sqrt(np.sum((added * self.norms[indices]) ** 2, axis=1))
        size = _length(self._effects(self._shown_or_zero())) + float(effects.sum())
        return self._drift_squared + (_ROUNDING * size) ** 2

    def _shown_or_zero(self) -> Float64Array:
        return np.zeros_like(self.wanted) if self.shown is None else self.shown

    def _effects(self, coefficients: Float64Array) -> Float64Array:
        return np.sqrt(np.sum((coefficients * self.norms) ** 2, axis=1))


def _length(values: Float64Array) -> float:
    return float(np.sqrt(np.sum(values * values)))


def _relative(error: float, size: float) -> float:
    if error == 0.0:
        return 0.0
    return error / size if size > error * 1e-6 else 1e6


_NOTHING = RefineStep("nothing", np.zeros(0, dtype=np.intp), np.zeros((0, 3)))
