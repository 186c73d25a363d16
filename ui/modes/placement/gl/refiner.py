"""Moves one layer's picture from the coefficients it shows to the wanted ones, a step a frame.

Owns the transport of the selected layer, its coefficient state and a spare accumulator. A rebuild sums from zero into
the spare and swaps when it is complete, so that an incomplete picture is never shown.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ui.gl.context import GraphicsError
from ui.gl.textures import TextureMemory
from ui.modes.placement.gl.accumulator import Accumulator, TermSum
from ui.modes.placement.gl.coefficients import CoefficientState, Float64Array, RefineStep
from ui.modes.placement.gl.transport import TransportTexture

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
