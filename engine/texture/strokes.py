"""Weights at points of a surface under the strokes of a brush [engine.material.strokes], dab after dab.

A stroke that goes on costs what its last dabs cover: points stand in blocks, by where they are in space, and of most
blocks the bounds say that a dab does not reach them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.material.strokes import HARDEST, Stroke, Strokes
from engine.texture._stroke_kernels import cover

BLOCK = 64
_CELLS = 64  # along each axis, by which points are sorted

Floats = NDArray[np.float32]


class PaintedPoints:
    """Points that are painted. What was done to them is kept, so that strokes which go on from those of the call before
    are not painted again."""

    def __init__(self, base: Floats, positions: Floats, normals: Floats) -> None:
        """base (N,): the weights without strokes; positions (N, 3) in the scene's frame; normals (N, 3), unit, on the
        side that the winding faces."""
        self._order = _by_place(positions)
        self._base = np.ascontiguousarray(base[self._order], np.float32)
        points = np.concatenate([positions, normals], axis=1)[self._order]
        self._points = np.ascontiguousarray(points, np.float32)
        starts = np.arange(0, len(points), BLOCK)
        self._low = np.minimum.reduceat(self._points[:, :3], starts) if len(points) else np.zeros((0, 3), np.float32)
        self._high = np.maximum.reduceat(self._points[:, :3], starts) if len(points) else np.zeros((0, 3), np.float32)
        self._forget()

    def weights(self, strokes: Strokes) -> Floats:
        """The weights (N,) under these strokes."""
        if not strokes.goes_on_from(Strokes(self._painted)):
            self._forget()
        n_painted = len(self._painted)
        for i in range(max(n_painted - 1, 0), len(strokes.strokes)):
            self._paint(strokes.strokes[i], goes_on=i < n_painted)
        out = np.empty_like(self._base)
        out[self._order] = self._blended()
        return out

    def _forget(self) -> None:
        """Nothing is painted: `_below` is what the newest stroke is painted on."""
        self._painted: tuple[Stroke, ...] = ()
        self._below = self._base
        self._coverage = np.zeros(len(self._base), np.float32)

    def _paint(self, stroke: Stroke, goes_on: bool) -> None:
        """Go on with the newest stroke where this is it, else begin another."""
        n_done = 0
        if goes_on:
            n_done, self._painted = self._painted[-1].n_dabs, self._painted[:-1]
        else:
            self._below = self._blended()
            self._coverage = np.zeros(len(self._base), np.float32)
        inner = min(stroke.hardness, HARDEST) * stroke.radius
        cover(
            self._points, self._low, self._high, BLOCK, np.array(stroke.array[n_done:]), stroke.radius, inner,
            self._coverage,
        )  # fmt: skip
        self._painted = (*self._painted, stroke)

    def _blended(self) -> Floats:
        if not self._painted:
            return self._below
        stroke = self._painted[-1]
        share = np.float32(stroke.strength) * self._coverage
        return np.asarray(self._below + share * (np.float32(stroke.value) - self._below), np.float32)


def _by_place(positions: Floats) -> NDArray[np.int64]:
    """The order (N,) in which neighbours in space are neighbours in the list."""
    if not len(positions):
        return np.zeros(0, np.int64)
    low = positions.min(axis=0)
    extent = max(float(np.ptp(positions, axis=0).max()), 1e-30)
    x, y, z = np.minimum((positions - low) * (_CELLS / extent), _CELLS - 1).astype(np.int64).T
    return np.argsort((x * _CELLS + y) * _CELLS + z, kind="stable")
