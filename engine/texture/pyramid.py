"""An image at halved sizes, and look-ups in it that are filtered over any footprint.

Each level is the level below seen at half its size, every texel the mean of what it covers; of an odd number of texels
the weights run over three [Guthe05], so that the mean of an image is the mean of all its levels. Texture coordinates
repeat; v grows upwards, rows downwards. What a pixel sees of an image is about an ellipse: it is covered by look-ups
along its longer axis, each as wide as the shorter one (after Feline, [McCormack99]), so that a table seen at a slant is
neither blurred nor does it shimmer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
MOST_PROBES = 16
_LONGEST = 1e6  # texels: beyond, a footprint is the whole image anyway


@dataclass(frozen=True, eq=False)
class Pyramid:
    """levels: images (H, W, C) float32, the first as in the file, the last of one texel."""

    levels: tuple[NDArray[np.float32], ...]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the finest level."""
        height, width, _ = self.levels[0].shape
        return width, height

    @property
    def mean(self) -> Floats:
        """Of all texels, (C,)."""
        return np.asarray(self.levels[-1][0, 0], np.float64)

    @property
    def n_bytes(self) -> int:
        return sum(level.nbytes for level in self.levels)

    def at(self, uv: NDArray[np.floating], level: NDArray[np.floating] | float = 0.0) -> NDArray[np.float32]:
        """Values (N, C) at coordinates (N, 2), linear between texels and between levels (N,)."""
        depth = np.clip(np.broadcast_to(level, len(uv)), 0.0, len(self.levels) - 1.0)
        lower = np.minimum(depth.astype(np.int64), max(len(self.levels) - 2, 0))
        share = (depth - lower).astype(np.float32)[:, None]
        out = np.empty((len(uv), self.levels[0].shape[2]), np.float32)
        for i in np.unique(lower):
            rows = np.flatnonzero(lower == i)
            found = _between_texels(self.levels[i], uv[rows])
            blended = rows[share[rows, 0] > 0.0]
            out[rows] = found
            if len(blended):
                coarser = _between_texels(self.levels[i + 1], uv[blended])
                out[blended] += share[blended] * (coarser - out[blended])
        return out

    def over(self, uv: NDArray[np.floating], across: NDArray[np.floating], down: NDArray[np.floating]) -> Floats:
        """Means (N, C) over pixels at (N, 2) whose sides are across and down (N, 2), in texture coordinates."""
        size = np.array(self.size, np.float64)
        major, longer, shorter = _axes(across * size, down * size)
        n_probes = np.clip(np.ceil(longer / np.maximum(shorter, 1.0) - 1e-3), 1, MOST_PROBES).astype(np.int64)
        level = np.log2(np.maximum(np.maximum(shorter, longer / MOST_PROBES), 1.0))
        total = np.zeros((len(uv), self.levels[0].shape[2]))
        for i in range(int(n_probes.max(initial=0))):
            rows = np.flatnonzero(n_probes > i)
            place = (i + 0.5) / n_probes[rows] - 0.5
            total[rows] += self.at(uv[rows] + place[:, None] * major[rows] / size, level[rows])
        return total / n_probes[:, None]


def make_pyramid(image: NDArray[np.floating]) -> Pyramid:
    """The pyramid of an image (H, W, C)."""
    levels = [np.ascontiguousarray(image, np.float32)]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(_halved(levels[-1], 0), 1))
    return Pyramid(tuple(levels))


def _halved(image: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Half as many texels along an axis, each the mean of what it covers."""
    n = image.shape[axis]
    if n == 1:
        return image
    rows = np.moveaxis(image, axis, 0)
    m = n // 2
    if n % 2 == 0:
        found = 0.5 * (rows[0::2] + rows[1::2])
    else:
        # Texel i of m covers [i n/m, (i+1) n/m]: of its three texels the shares (m - i), m and (i + 1), of n in all.
        i = np.arange(m, dtype=np.float32).reshape(-1, *[1] * (rows.ndim - 1))
        found = ((m - i) * rows[0:-1:2] + m * rows[1::2] + (i + 1) * rows[2::2]) / np.float32(n)
    return np.moveaxis(np.asarray(found, np.float32), 0, axis)


def _between_texels(level: NDArray[np.float32], uv: NDArray[np.floating]) -> NDArray[np.float32]:
    """Bilinear, repeating; texels have their values at their middles."""
    height, width, _ = level.shape
    u, v = np.asarray(uv[:, 0], np.float64), np.asarray(uv[:, 1], np.float64)
    x, y = (u - np.floor(u)) * width - 0.5, (1.0 - (v - np.floor(v))) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    fx, fy = ((x - left).astype(np.float32)[:, None], (y - top).astype(np.float32)[:, None])
    x0, y0 = left.astype(np.int64) % width, top.astype(np.int64) % height
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    upper = level[y0, x0] + fx * (level[y0, x1] - level[y0, x0])
    lower = level[y1, x0] + fx * (level[y1, x1] - level[y1, x0])
    return np.asarray(upper + fy * (lower - upper), np.float32)


def _axes(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats]:
    """Of ellipses with conjugate diameters a, b (N, 2): the longer diameter (N, 2), and the lengths of both (N,)."""
    a, b = _bounded(a), _bounded(b)
    xx, yy, xy = a[:, 0] ** 2 + b[:, 0] ** 2, a[:, 1] ** 2 + b[:, 1] ** 2, a[:, 0] * a[:, 1] + b[:, 0] * b[:, 1]
    spread = np.hypot(0.5 * (xx - yy), xy)
    longer = np.sqrt(np.maximum(0.5 * (xx + yy) + spread, 0.0))
    shorter = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.maximum(longer, 1e-30)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return longer[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), longer, shorter


def _bounded(vectors: Floats) -> Floats:
    """Of no more than so many texels: at the horizon of a plane a pixel sees no end of it."""
    return np.clip(np.nan_to_num(vectors, nan=_LONGEST, posinf=_LONGEST, neginf=-_LONGEST), -_LONGEST, _LONGEST)
