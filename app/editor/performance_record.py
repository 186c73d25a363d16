"""Frame times and picture errors of the last two minutes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

SECONDS = 120.0
STEP = 0.25  # samples within it are merged
# After a pause this long without a frame nothing was drawn, and the record has a gap.
_PAUSE = 1.0


class PerformanceRecord:
    """A ring of samples: when, the time of the slowest frame in ms, and the last relative RMS error (NaN where
    unknown)."""

    def __init__(self) -> None:
        self._samples = np.full((round(SECONDS / STEP), 3), np.nan)
        self._samples[:, 0] = -math.inf
        self._newest = 0

    def add_frame(self, now: float, frame_ms: float, error: float | None) -> None:
        """Record a frame. now: seconds of a steady clock."""
        sample = self._samples[self._newest]
        if now - sample[0] >= STEP:
            self._newest = (self._newest + 1) % len(self._samples)
            sample = self._samples[self._newest]
            sample[:] = now, frame_ms, np.nan
        sample[1] = max(sample[1], frame_ms)
        sample[2] = np.nan if error is None else error

    def samples_at(self, now: float) -> NDArray[np.float64]:
        """Samples (n, 3), oldest first: age in s, slowest frame in ms, and error. Before a sample that follows a pause
        there is a row without a time, with the error that held during the pause."""
        samples = np.roll(self._samples, -self._newest - 1, axis=0)
        samples = samples[now - samples[:, 0] <= SECONDS]
        ages = now - samples[:, 0]
        breaks = np.flatnonzero(-np.diff(ages) > _PAUSE)
        found = np.column_stack([ages, samples[:, 1:]])
        still = np.column_stack([ages[breaks + 1] + STEP, np.full(len(breaks), np.nan), found[breaks, 2]])
        return np.asarray(np.insert(found, breaks + 1, still, axis=0))
