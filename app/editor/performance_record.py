"""What frames have taken and how far off the picture was, over the last two minutes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

SECONDS = 120.0
STEP = 0.25  # what comes within it is one sample
# After so long without a frame nothing moved, and the time of none stands for it.
_PAUSE = 1.0


class PerformanceRecord:
    """A ring of samples: when, how long its slowest frame took, ms, and how far off the last one was, relative RMS
    (not a number where that was not known)."""

    def __init__(self) -> None:
        self._samples = np.full((round(SECONDS / STEP), 3), np.nan)
        self._samples[:, 0] = -math.inf
        self._newest = 0

    def add_frame(self, now: float, frame_ms: float, error: float | None) -> None:
        """A frame was drawn. now: seconds of a steady clock."""
        sample = self._samples[self._newest]
        if now - sample[0] >= STEP:
            self._newest = (self._newest + 1) % len(self._samples)
            sample = self._samples[self._newest]
            sample[:] = now, frame_ms, np.nan
        sample[1] = max(sample[1], frame_ms)
        sample[2] = np.nan if error is None else error

    def samples_at(self, now: float) -> NDArray[np.float64]:
        """(n, 3) from the oldest on: how long ago, s, what the slowest frame took, ms, and the error; before
        one that comes after a pause a row without a time, and with the error that there was all along."""
        samples = np.roll(self._samples, -self._newest - 1, axis=0)
        samples = samples[now - samples[:, 0] <= SECONDS]
        ages = now - samples[:, 0]
        breaks = np.flatnonzero(-np.diff(ages) > _PAUSE)
        found = np.column_stack([ages, samples[:, 1:]])
        still = np.column_stack([ages[breaks + 1] + STEP, np.full(len(breaks), np.nan), found[breaks, 2]])
        return np.asarray(np.insert(found, breaks + 1, still, axis=0))
