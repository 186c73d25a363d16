"""The state of incremental rendering: which coefficients to add next, which are on screen, the error of the picture.

B = Σ_k c_k T_k is on screen for some c_shown; the desired curve is c_wanted. Each frame adds Δc_k T_k for the K terms
with the largest effect on the image, |Δc_k|·‖T_k‖ [BenArtzi07, ch. 7; there by |Δc_k| alone]. c_shown is in float64 and
moved by exactly the float32 amounts that were added, so rounding of a coefficient is not lost, only deferred.

What does drift is the float32 sum in the accumulator: each addition rounds by up to 2⁻²⁴ of the picture and of what is
added. A running estimate (roots of summed squares) relative to the picture follows it. Above `TIDY_ABOVE` an idle
renderer rebuilds the sum from zero, above `REBUILD_ABOVE` the next step is a rebuild even during a drag; both are below
the 1e-5 that a picture's error may be. A step that would add as many terms as the whole sum has is made a rebuild too:
it costs the same, and has no drift. `CoefficientState` makes no GL calls, so all of it is tested as arithmetic.

Shapes: J coefficients, K terms of one step, 3 colour channels.

`Refiner` moves one layer's picture from the coefficients it shows to the wanted ones, a step a frame. It owns the
transport of the selected layer, its coefficient state and a spare accumulator. A rebuild sums from zero into the spare
and swaps when it is complete, so that an incomplete picture is never shown.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory
from ui.modes.placement.gl.transport import Accumulator, TermSum, TransportTexture

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


# ----------------------------------------------------------------------------------------- steps of one layer's picture


_LARGEST_MULTIPLIER = 1e36
# Terms of the step by which the cost of one is measured, where there is a budget.
_TERMS_TO_MEASURE = 8
LEAST_REBUILT = 32


@dataclass
class _Rebuild:
    """A sum from zero under way: the first `n_done` of `indices` (K,) are in the spare accumulator."""

    indices: NDArray[np.intp]
    exact: Float64Array
    multipliers: NDArray[np.float32]
    is_tidying: bool
    n_done: int = 0


@dataclass(frozen=True)
class StepDone:
    """The result of one step: terms added, whether the picture changed, whether the accumulator was swapped."""

    applied: int
    shown_changed: bool
    swapped: bool = False


class Refiner:
    """The transport of one layer, added to its accumulator; `seconds_per_term` is measured once."""

    def __init__(
        self, memory: TextureMemory, terms: TermSum, transport: TransportTexture, norms: NDArray[np.floating]
    ) -> None:
        terms.reserve(transport.rows)
        self.transport = transport
        self.state = CoefficientState(norms)
        self.seconds_per_term: float | None = None
        self._memory, self._terms = memory, terms
        self._spare: Accumulator | None = Accumulator(memory, transport.n_samples)
        self._rebuild: _Rebuild | None = None
        # A sum of no terms compiles the shaders now, so that the first real step measures what a term costs.
        self._terms.add(transport, np.zeros(0, dtype=np.intp), np.zeros((0, 3), dtype=np.float32), self._spare)

    def fits(self, coefficients: NDArray[np.floating]) -> bool:
        """Whether there are as many coefficients as the transport has."""
        return np.shape(coefficients) == self.state.wanted.shape

    def want(self, coefficients: NDArray[np.floating]) -> None:
        """Set c_wanted (J,3); raises GraphicsError on a wrong shape or a number that no picture can show."""
        wanted = np.asarray(coefficients, dtype=np.float64)
        if not self.fits(wanted):
            raise GraphicsError(f"coefficients of shape {wanted.shape}, expected {self.state.wanted.shape}")
        if not np.isfinite(wanted).all() or np.abs(wanted * self.transport.scale).max() > _LARGEST_MULTIPLIER:
            raise GraphicsError("a curve coefficient is not finite or beyond 1e36; the old picture stays")
        self.state.wanted = wanted.copy()

    def start_from(self, shown: NDArray[np.floating] | None) -> None:
        """Note that the accumulator was replaced by a picture with these coefficients (None: unknown)."""
        self._rebuild = None
        if shown is not None and not self.fits(shown):
            shown = None
        self.state.start_from(shown)

    def step(self, accumulator: Accumulator, limit: int | None) -> tuple[StepDone, Accumulator]:
        """Add at most `limit` terms (a due rebuild may take more); returns the accumulator to show from now on."""
        if self._rebuild is not None and not self._rebuild.is_tidying:
            return self._go_on_rebuilding(accumulator, limit)
        step = self.state.next_step(limit)
        if step.kind == "increment":
            self._rebuild = None
            return self._increment(accumulator, step), accumulator
        if step.kind == "nothing":
            self._rebuild = None
            return StepDone(0, shown_changed=False), accumulator
        if self._rebuild is None or step.kind == "rebuild":
            self._rebuild = self._started(step)
        return self._go_on_rebuilding(accumulator, limit)

    def term_limit(self, max_terms: int | None, budget_s: float | None) -> int | None:
        """How many terms a step may add; None is all."""
        limits = [] if max_terms is None else [max(0, max_terms)]
        if budget_s is not None and self.seconds_per_term is None:
            limits.append(_TERMS_TO_MEASURE)
        elif budget_s is not None and self.seconds_per_term is not None:
            limits.append(max(1, int(budget_s / self.seconds_per_term)))
        return min(limits, default=None)

    def mean_radiance(self) -> Float64Array:
        """mean| (3,) over the samples of the shown picture; 0 while unknown."""
        if self.state.shown is None:
            return np.zeros(3)
        return np.abs(np.sum(self.state.shown * self.transport.means, axis=0))

    @property
    def is_exact(self) -> bool:
        """Whether nothing is left to add or to rebuild."""
        return self._rebuild is None and self.state.next_step().kind == "nothing" and self.state.shown is not None

    def _increment(self, accumulator: Accumulator, step: RefineStep) -> StepDone:
        exact, multipliers = self._rounded(step.indices, step.deltas)
        self._timed(step.indices, multipliers, accumulator, replace=False)
        self.state.record_increment(step.indices, exact)
        return StepDone(len(step.indices), shown_changed=len(step.indices) > 0)

    def _started(self, step: RefineStep) -> _Rebuild:
        exact = np.zeros_like(self.state.wanted)
        exact[step.indices], multipliers = self._rounded(step.indices, step.deltas)
        return _Rebuild(step.indices, exact, multipliers, step.kind == "tidy")

    def _go_on_rebuilding(self, accumulator: Accumulator, limit: int | None) -> tuple[StepDone, Accumulator]:
        work = self._rebuild
        assert work is not None
        spare = self._spare_for(self.transport.n_samples)
        n = len(work.indices) if limit is None else _chunk(limit, work.is_tidying)
        part = slice(work.n_done, work.n_done + n)
        self._timed(work.indices[part], work.multipliers[part], spare, replace=work.n_done == 0)
        work.n_done += len(work.indices[part])
        n_added = len(work.indices[part])
        if work.n_done < len(work.indices):
            return StepDone(n_added, shown_changed=False), accumulator
        self._rebuild, self._spare = None, accumulator
        self.state.record_rebuild(work.exact)
        return StepDone(n_added, shown_changed=True, swapped=True), spare

    def _spare_for(self, n_samples: int) -> Accumulator:
        """The spare accumulator, made anew when it came from a layer of another size."""
        if self._spare is None or self._spare.n_samples != n_samples:
            self.release_spare()
            self._spare = Accumulator(self._memory, n_samples)
        return self._spare

    def _rounded(self, indices: NDArray[np.intp], amounts: Float64Array) -> tuple[Float64Array, NDArray[np.float32]]:
        """(the amounts really added, the float32 multipliers of the stored numbers) for amounts (K,3)."""
        scale = self.transport.scale[indices]
        with np.errstate(under="ignore"):
            multipliers = (amounts * scale).astype(np.float32)
        return multipliers / scale, multipliers

    def _timed(
        self, indices: NDArray[np.intp], multipliers: NDArray[np.float32], target: Accumulator, replace: bool
    ) -> None:
        """Add; the first time wait for the GPU on both sides and measure what a term costs."""
        measure = self.seconds_per_term is None and len(indices) > 0
        if measure:
            self._memory.context.finish()
        begin = time.perf_counter()
        self._terms.add(self.transport, indices, multipliers, target, replace=replace)
        if measure:
            self._memory.context.finish()
            self.seconds_per_term = (time.perf_counter() - begin) / len(indices)

    def release_spare(self) -> None:
        if self._spare is not None:
            self._spare.release()
            self._spare = None

    def release(self) -> None:
        self.release_spare()
        self.transport.release()


def _chunk(limit: int, is_tidying: bool) -> int:
    """Terms of one step of a rebuild: the frame's share when idle; a due one takes some more, to be over soon. It took
    128 at once: of a layer of 512 × 512 pixels 127 ms of processor time, all in one frame."""
    return max(1, limit) if is_tidying else max(limit, LEAST_REBUILT)
