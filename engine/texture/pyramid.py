"""An image at halved sizes, and look-ups in it that are filtered over any footprint.

Each level is the level below seen at half its size, every texel the mean of what it covers; of an odd number of texels
the weights run over three [Guthe05], so that the mean of an image is the mean of all its levels. Beyond its edges it
repeats, is mirrored or goes on as its edge; v grows upwards, rows downwards. What a pixel sees of an image is about an
ellipse: it is covered by look-ups along its longer axis, each as wide as the shorter one (after Feline,
[McCormack99]), so that a table seen at a slant is neither blurred nor does it shimmer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core import lanes
from engine.core.threads import even_parts, on_threads
from engine.material.layer_maps import IDENTITY_TRANSFORM, WRAPS, TextureTransform
from engine.texture import _pyramid_kernels as kernels

Float64Array = NDArray[np.float64]
MOST_PROBES = 16


@dataclass(frozen=True, eq=False)
class Pyramid:
    """texels (N, C) float32: those of all levels, row by row, the first as in the file, the last of one texel; shapes:
    (height, width) of each level. flat: all texels' numbers and `lanes.N_BEHIND` more, as the kernels take them.
    transform: where coordinates are looked up on it."""

    flat: NDArray[np.float32]
    n_channels: int
    shapes: tuple[tuple[int, int], ...]
    transform: TextureTransform = IDENTITY_TRANSFORM

    @property
    def texels(self) -> NDArray[np.float32]:
        """See above."""
        return self.flat[: -lanes.N_BEHIND].reshape(-1, self.n_channels)

    def with_transform(self, transform: TextureTransform) -> Pyramid:
        """The same image, and the same object each time, under another transform."""
        if transform == self.transform:
            return self
        return self._others.setdefault(transform, replace(self, transform=transform))

    @cached_property
    def _others(self) -> dict[TextureTransform, Pyramid]:
        return {}

    @property
    def levels(self) -> tuple[NDArray[np.float32], ...]:
        """The images (H, W, C)."""
        parts = np.split(self.texels, np.cumsum([height * width for height, width in self.shapes])[:-1])
        return tuple(part.reshape(*shape, -1) for part, shape in zip(parts, self.shapes, strict=True))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the finest level."""
        height, width = self.shapes[0]
        return width, height

    @property
    def mean(self) -> Float64Array:
        """Of all texels, (C,)."""
        return np.asarray(self.texels[-1], np.float64)

    @property
    def n_bytes(self) -> int:
        return self.texels.nbytes

    def at(self, uv: NDArray[np.floating], level: NDArray[np.floating] | float = 0.0) -> NDArray[np.float32]:
        """Values (N, C) at coordinates (N, 2), linear between texels and between levels (N,)."""
        out = np.empty((len(uv), self.n_channels), np.float32)
        depth = np.ascontiguousarray(np.broadcast_to(level, len(uv)), np.float64)
        depth.flags.writeable = False  # as those that are not copied: the kernel is compiled once
        kernels.fill_at(self._packed, np.ascontiguousarray(uv, np.float64), depth, out)
        return out

    def over(
        self, uv: NDArray[np.floating], across: NDArray[np.floating], down: NDArray[np.floating],
        most_probes: int = MOST_PROBES, repeats: tuple[float, float] = (1.0, 1.0), is_quick: bool = False,
    ) -> NDArray[np.float32]:  # fmt: skip
        """Means (N, C) over pixels at (N, 2) whose sides are across and down (N, 2), in texture coordinates before they
        are multiplied by repeats. is_quick: by the nearest level, which shows where that changes."""
        out, levels = np.empty((len(uv), self.n_channels), np.float32), self._packed
        middle, right, below = (np.ascontiguousarray(each, np.float64) for each in (uv, across, down))
        times = float(repeats[0]), float(repeats[1])

        def part(start: int, stop: int) -> None:
            kernels.fill_over(start, stop, levels, middle, right, below, times, most_probes, is_quick, out)

        on_threads(part, *even_parts(len(uv)))
        return out

    def level_of(self, share: Float64Array) -> Float64Array:
        """The level whose texels are as large as a share (N,) of the image's area."""
        width, height = self.size
        return np.asarray(0.5 * np.log2(np.maximum(share * width * height, 1.0)))

    @property
    def _packed(self) -> kernels.Levels:
        """As the kernels take it."""
        sizes = np.array(self.shapes, np.int64)
        (cosine, sine), (along_u, along_v) = self.transform.turn, self.transform.offset
        wraps = [WRAPS.index(wrap) for wrap in self.transform.wrap]
        first = np.cumsum(sizes.prod(axis=1)) - sizes.prod(axis=1)
        return kernels.Levels(self.flat, sizes, first, cosine, sine, along_u, along_v, *wraps)


def make_pyramid(image: NDArray[np.floating]) -> Pyramid:
    """The pyramid of an image (H, W, C)."""
    levels = [np.ascontiguousarray(image, np.float32)]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halve_axis(_halve_axis(levels[-1], 0), 1))
    flat = np.concatenate([*(level.ravel() for level in levels), np.zeros(lanes.N_BEHIND, np.float32)])
    return Pyramid(flat, image.shape[2], tuple((len(level), level.shape[1]) for level in levels))


def _halve_axis(image: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
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
