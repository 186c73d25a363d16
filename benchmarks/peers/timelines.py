"""What a program showed after each edit, against the truth of each state: errors, areas, changes at rest.

The error of the picture on screen is a step function of time: until an edit's first picture is there, the one from
before the edit is seen, and is wrong by the edit. Its area, by seconds and by seconds of processor time up to the
edit's horizon, counts being late and being wrong alike. Other programs on the machine stretch seconds far more than
processor time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peer import Pictures, cleared_error
from benchmarks.peers.edits import Edit
from engine.render.picture_difference import CLAMP_PERCENTILE

# Errors that differ by less of themselves are of a picture that the edit did not reach.
SAME = 0.1


@dataclass(frozen=True)
class Watched:
    """One edit by one program: relRMSE of each picture that was shown, when it came (s, and s of processor time, since
    the edit), and of the picture from before the edit; change: relRMSE between the last two pictures; raw: error and
    processor seconds of the last picture without denoiser, None for ours."""

    before: float
    errors: tuple[float, ...]
    seconds: tuple[float, ...]
    cpu_seconds: tuple[float, ...]
    change: float
    raw: tuple[float, float] | None = None

    @property
    def first(self) -> float:
        """relRMSE of the first picture, of the one from before where none came."""
        return self.errors[0] if self.errors else self.before

    def changed_after(self) -> float:
        """Processor seconds until a picture's error is another one than before the edit, by a tenth; inf if none is."""
        shown = zip(self.errors, self.cpu_seconds, strict=True)
        return next((at for error, at in shown if abs(error - self.before) > SAME * self.before), math.inf)

    def last(self, horizon_s: float, cpu: bool) -> float:
        """relRMSE of the picture at the horizon."""
        times = self.cpu_seconds if cpu else self.seconds
        there = [error for error, at in zip(self.errors, times, strict=True) if at < horizon_s]
        return there[-1] if there else self.before

    def area(self, horizon_s: float, cpu: bool) -> float:
        """Under the error over time, in relRMSE · s."""
        return area((0.0, *(self.cpu_seconds if cpu else self.seconds)), (self.before, *self.errors), horizon_s)


def area(times: Sequence[float], errors: Sequence[float], horizon: float) -> float:
    """Integral from times[0] to the horizon of a step function that is errors[i] from times[i] on; times ascend."""
    ends = np.minimum([*times[1:], np.inf], horizon)
    return float(np.sum(np.maximum(ends - times, 0.0) * errors))


def watched(
    edits: Sequence[Edit], found: Mapping[str, Any], truths: Pictures, mask: NDArray[np.bool_]
) -> list[Watched]:
    """The answer of a program (`progressive`), edit by edit. truths (states, 2, H, W, 3); mask (H, W): what counts."""
    pictures, halves = np.asarray(found["pictures"])[:, mask], truths[:, :, mask]
    shown = np.asarray(found["opened"])[mask]
    watches = []
    for index, edit in enumerate(edits):
        a, b = halves[edit.state]
        rows = np.flatnonzero(found["edit"] == index)
        errors = tuple(cleared_error(pictures[row], a, b) for row in rows)
        seconds, used = (tuple(np.asarray(found[name])[rows].tolist()) for name in ("seconds", "cpu_seconds"))
        pair = [shown, *pictures[rows]][-2:]
        raw = None
        if "raw" in found:
            error = cleared_error(np.asarray(found["raw"])[index][mask], a, b)
            raw = error, float(found["raw_cpu_seconds"][index])
        change = difference(pair[-1], pair[0])
        watches.append(Watched(cleared_error(shown, a, b), errors, seconds, used, change, raw))
        shown = pair[-1]
    return watches


def difference(picture: Pictures, other: Pictures) -> float:
    """RMS of the difference of two pictures, relative to the mean of the second."""
    apart = np.asarray(picture, np.float64) - other
    return float(np.sqrt(np.mean(apart**2)) / np.mean(other, dtype=np.float64))


def differences_again(edits: Sequence[Edit], found: Mapping[str, Any], mask: NDArray[np.bool_]) -> list[float]:
    """Between the pictures at rest of a state and of the same state when it comes again."""
    last: dict[int, Pictures] = {}
    again = []
    for index, edit in enumerate(edits):
        if edit.kind == "drag":
            continue
        picture = np.asarray(found["pictures"])[np.flatnonzero(found["edit"] == index)[-1]][mask]
        if edit.state in last:
            again.append(difference(picture, last[edit.state]))
        last[edit.state] = picture
    return again


def difference_of_halves(ours: Pictures, theirs: Pictures) -> float:
    """relRMSE between two long pictures of two halves each (2, ...), without the noise of any half."""
    top = np.percentile(theirs.mean(axis=0), CLAMP_PERCENTILE)
    (a, b), (c, d) = (np.minimum(np.asarray(each, np.float64), top) for each in (ours, theirs))
    return float(np.sqrt(max(float(np.mean((a - c) * (b - d))), 0.0)) / np.mean((c + d) / 2))
