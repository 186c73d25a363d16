"""An image pyramid, and look-ups that are filtered over any footprint.

Each level has half the size of the level below, every texel the mean of the area that it covers; for an odd number of
texels the weights extend over three [Guthe05], so that the mean of an image is the mean of all its levels. Beyond its
edges an image repeats, is mirrored or extends its edge; v grows upwards, rows downwards. A pixel's footprint on an
image is approximately an ellipse: probes along its major axis cover it, each as wide as the minor axis (after Feline,
[McCormack99]), so that a table seen at a grazing angle is neither blurred nor shimmers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from engine.core import lanes
from engine.core.threads import even_parts, on_threads
from engine.material.layer_maps import IDENTITY_TRANSFORM, WRAPS, TextureTransform
from engine.texture import _kernels as kernels

Float64Array = NDArray[np.float64]
MOST_PROBES = 16


@dataclass(frozen=True, eq=False)
class Pyramid:
    """texels (N, C) float32: those of all levels, row by row, the first as in the file, the last of one texel; shapes:
    (height, width) of each level. flat: all texels' numbers and `lanes.N_BEHIND` more, as the kernels take them.
    transform: the mapping of coordinates."""

    flat: NDArray[np.float32]
    n_channels: int
    shapes: tuple[tuple[int, int], ...]
    transform: TextureTransform = IDENTITY_TRANSFORM

    @property
    def texels(self) -> NDArray[np.float32]:
        """See the class."""
        return self.flat[: -lanes.N_BEHIND].reshape(-1, self.n_channels)

    def with_transform(self, transform: TextureTransform) -> Pyramid:
        """The same image under another transform; equal transforms return the same object."""
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
        """Mean of all texels, (C,)."""
        return np.asarray(self.texels[-1], np.float64)

    @property
    def n_bytes(self) -> int:
        return self.texels.nbytes

    def at(
        self, uv: NDArray[np.floating], level: NDArray[np.floating] | float = 0.0,
        repeats: tuple[float, float] = (1.0, 1.0),
    ) -> NDArray[np.float32]:  # fmt: skip
        """Values (N, C) at coordinates (N, 2 K) in K sets, multiplied by repeats, linear between texels and between
        levels (N,)."""
        out, uv = np.empty((len(uv), self.n_channels), np.float32), self.in_own_set(uv) * np.array(repeats)
        depth = np.ascontiguousarray(np.broadcast_to(level, len(uv)), np.float64)
        depth.flags.writeable = False  # as if it had been copied: the kernel is compiled for one type
        kernels.fill_at(self._packed, np.ascontiguousarray(uv, np.float64), depth, out)
        return out

    def over(
        self, uv: NDArray[np.floating], across: NDArray[np.floating], down: NDArray[np.floating],
        most_probes: int = MOST_PROBES, repeats: tuple[float, float] = (1.0, 1.0), is_quick: bool = False,
    ) -> NDArray[np.float32]:  # fmt: skip
        """Means (N, C) over pixels at (N, 2 K) whose sides are across and down (N, 2 K), in K sets of texture
        coordinates before the multiplication by repeats. is_quick: from the nearest level, with visible
        transitions."""
        out, levels = np.empty((len(uv), self.n_channels), np.float32), self._packed
        sides = (self.in_own_set(each) for each in (uv, across, down))
        middle, right, below = (np.ascontiguousarray(each, np.float64) for each in sides)
        times = float(repeats[0]), float(repeats[1])

        def part(start: int, stop: int) -> None:
            kernels.fill_over(start, stop, levels, middle, right, below, times, most_probes, is_quick, out)

        on_threads(part, *even_parts(len(uv)))
        return out

    def in_own_set(self, uv: NDArray[np.floating]) -> NDArray[np.floating]:
        """Of coordinates (..., 2 K) in K sets those (..., 2) that the image is mapped by."""
        first = min(2 * self.transform.uv_set, uv.shape[-1] - 2)
        return uv[..., first : first + 2]

    def level_of(self, share: Float64Array) -> Float64Array:
        """The level whose texels have this share (N,) of the image's area."""
        width, height = self.size
        return np.asarray(0.5 * np.log2(np.maximum(share * width * height, 1.0)))

    @property
    def _packed(self) -> kernels.Levels:
        """The pyramid in the kernels' form."""
        sizes = np.array(self.shapes, np.int64)
        (cosine, sine), (along_u, along_v) = self.transform.turn, self.transform.offset
        wraps = [WRAPS.index(wrap) for wrap in self.transform.wrap]
        first = np.cumsum(sizes.prod(axis=1)) - sizes.prod(axis=1)
        return kernels.Levels(self.flat, sizes, first, cosine, sine, along_u, along_v, *wraps)


def make_pyramid(image: NDArray[np.floating]) -> Pyramid:
    """Make the pyramid of an image (H, W, C)."""
    levels = [np.ascontiguousarray(image, np.float32)]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halve_axis(_halve_axis(levels[-1], 0), 1))
    flat = np.concatenate([*(level.ravel() for level in levels), np.zeros(lanes.N_BEHIND, np.float32)])
    return Pyramid(flat, image.shape[2], tuple((len(level), level.shape[1]) for level in levels))


def _halve_axis(image: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Halve the number of texels along an axis, each the mean of the area that it covers."""
    n = image.shape[axis]
    if n == 1:
        return image
    rows = np.moveaxis(image, axis, 0)
    m = n // 2
    if n % 2 == 0:
        found = 0.5 * (rows[0::2] + rows[1::2])
    else:
        # Texel i of m covers [i n/m, (i+1) n/m]: its three texels have the weights (m - i), m and (i + 1), out of n.
        i = np.arange(m, dtype=np.float32).reshape(-1, *[1] * (rows.ndim - 1))
        found = ((m - i) * rows[0:-1:2] + m * rows[1::2] + (i + 1) * rows[2::2]) / np.float32(n)
    return np.moveaxis(np.asarray(found, np.float32), 0, axis)
