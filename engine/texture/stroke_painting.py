"""Evaluates brush strokes on weights at points of a surface [engine.material.strokes], dab after dab.

A stroke that continues costs only its new dabs: points are in spatial blocks, and the bounds of most blocks exclude a
dab.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine.material.strokes import HARDEST, Stroke, Strokes
from engine.texture._kernels import cover

BLOCK = 64
MOST_BACK = 16  # strokes for which the weights below are cached, so that painting can continue after an undo
_CELLS = 64  # grid cells along each axis, by which points are sorted

Float32Array = NDArray[np.float32]


class PaintedPoints:
    """Points with painted weights. Caches the result, so that strokes of the previous call are not painted again."""

    def __init__(self, base: Float32Array, positions: Float32Array, normals: Float32Array) -> None:
        """base (N,): the weights without strokes; positions (N, 3) in the scene's frame; normals (N, 3), unit, on the
        side that the winding faces."""
        self._order = _by_place(positions)
        self._base = np.ascontiguousarray(base[self._order], np.float32)
        points = np.concatenate([positions, normals], axis=1)[self._order]
        self._points = np.ascontiguousarray(points, np.float32)
        starts = np.arange(0, len(points), BLOCK)
        self._low = np.minimum.reduceat(self._points[:, :3], starts) if len(points) else np.zeros((0, 3), np.float32)
        self._high = np.maximum.reduceat(self._points[:, :3], starts) if len(points) else np.zeros((0, 3), np.float32)
        self._painted: tuple[Stroke, ...] = ()
        self._below: list[Float32Array | None] = []
        self._now = self._base
        self._coverage = np.zeros(len(self._base), np.float32)

    def weights(self, strokes: Strokes) -> Float32Array:
        """The weights (N,) under these strokes."""
        wanted = strokes.strokes
        n_same = next(
            (i for i, (old, new) in enumerate(zip(self._painted, wanted, strict=False)) if old != new),
            min(len(self._painted), len(wanted)),
        )
        goes_on = n_same == len(self._painted) - 1 < len(wanted) and wanted[n_same].continues(self._painted[-1])
        if n_same < len(self._painted) and not goes_on:
            n_same = self._go_back(n_same)
        for i in range(n_same, len(wanted)):
            self._paint(wanted[i], goes_on and i == n_same)
        out = np.empty_like(self._now)
        out[self._order] = self._now
        return out

    def _go_back(self, n: int) -> int:
        """Go back to the first n strokes, or to none if the weights below the next are not cached; return the
        number."""
        below = self._below[n]
        if below is None:
            n, below = 0, self._base
        self._painted, self._below, self._now = self._painted[:n], self._below[:n], below
        return n

    def _paint(self, stroke: Stroke, goes_on: bool) -> None:
        """Continue the newest stroke, or begin another."""
        n_done = 0
        if goes_on:
            n_done, self._painted = self._painted[-1].n_dabs, self._painted[:-1]
        else:
            self._below.append(self._now)
            if len(self._below) > MOST_BACK:
                self._below[-1 - MOST_BACK] = None
            self._coverage = np.zeros(len(self._base), np.float32)
        inner = min(stroke.hardness, HARDEST) * stroke.radius
        cover(
            self._points, self._low, self._high, BLOCK, np.array(stroke.array[n_done:]), stroke.radius, inner,
            self._coverage,
        )  # fmt: skip
        self._painted = (*self._painted, stroke)
        below, share = self._below[-1], np.float32(stroke.strength) * self._coverage
        assert below is not None
        self._now = np.asarray(below + share * (np.float32(stroke.value) - below), np.float32)


def _by_place(positions: Float32Array) -> NDArray[np.int64]:
    """An order (N,) in which points that are close in space are close in the list."""
    if not len(positions):
        return np.zeros(0, np.int64)
    low = positions.min(axis=0)
    extent = max(float(np.ptp(positions, axis=0).max()), 1e-30)
    x, y, z = np.minimum((positions - low) * (_CELLS / extent), _CELLS - 1).astype(np.int64).T
    return np.argsort((x * _CELLS + y) * _CELLS + z, kind="stable")
