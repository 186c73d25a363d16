"""Fills what a measurement does not contain: gaps, and samples below the horizon.

Gaps are interpolated linearly in phi_d, in which reflection changes slowest, between the nearest existing samples;
empty rows, and samples below the horizon, take the last sample before them in theta_d, the one just above the horizon.
Samples below are never visible, but interpolation near the horizon reads them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.measured.coordinates import above_horizon


@dataclass(frozen=True, eq=False)
class FilledTable:
    """A table (90, 90, 180, 3) float32 without gaps; measured (90, 90, 180): which samples are original; and the number
    of filled samples, above the horizon and below it."""

    table: NDArray[np.float32]
    measured: NDArray[np.bool_]
    n_missing: int
    n_below: int


def fill_samples(samples: NDArray[np.float32]) -> FilledTable | None:
    """Fill all samples that are negative in any channel; None if there is no other."""
    measured: NDArray[np.bool_] = np.asarray((samples >= 0.0).all(axis=-1))
    if not measured.any():
        return None
    above = above_horizon()
    missing = np.asarray(above & ~measured)
    n_missing, n_below = int(missing.sum()), int((~above & ~measured).sum())
    table = np.ascontiguousarray(samples, np.float32).copy()
    known = measured.copy()
    _fill_around(table, known, above)
    for axis in (1, 0, 2):
        if not known.all():
            table, known = _extrapolate(table, known, axis)
    return FilledTable(table, measured & above, n_missing, n_below)


def _extrapolate(
    table: NDArray[np.float32], known: NDArray[np.bool_], axis: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Replace unknown samples by the last known one along an axis, or by the first if there is none before."""
    n = table.shape[axis]
    places = np.arange(n).reshape([-1 if a == axis else 1 for a in range(3)])
    before = np.maximum.accumulate(np.where(known, places, -1), axis=axis)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, places, n), axis), axis=axis), axis)
    source = np.where(before >= 0, before, np.where(after < n, after, places))
    carried = np.take_along_axis(table, source[..., None], axis=axis)
    return np.ascontiguousarray(carried), np.asarray(np.take_along_axis(known, source, axis=axis))


def _fill_around(table: NDArray[np.float32], known: NDArray[np.bool_], above: NDArray[np.bool_]) -> None:
    """Fill gaps above the horizon in rows over phi_d that have samples."""
    gaps = above & ~known
    n = table.shape[2]
    for i, j in np.argwhere(gaps.any(axis=2) & known.any(axis=2)):
        at, there = np.flatnonzero(gaps[i, j]), np.flatnonzero(known[i, j])
        for channel in range(3):
            table[i, j, at, channel] = np.interp(at, there, table[i, j, there, channel], period=n)
        known[i, j, at] = True
