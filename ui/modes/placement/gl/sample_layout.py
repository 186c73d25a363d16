"""The layout of a layer's samples in its textures.

The transport's 16-bit numbers are stored as they come, eight to a texel of four 32-bit words; red, green and blue of
eight samples fill three texels exactly. A fragment of the increment pass therefore works on a *group* of eight
consecutive samples and has eight results, one per render target (a *lane*). An accumulator has the lanes side by side:
sample i of group q = i // 8 and lane j = i % 8 has column j·128 + q % 128 of row q // 128, so that a row is 1,024
samples in a row of the transport as well. ``shaders/common/sample_layout.glsl`` has the same numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GROUP_SIZE = 8
GROUPS_PER_ROW = 128
SAMPLES_PER_ROW = GROUP_SIZE * GROUPS_PER_ROW


def row_count(n_samples: int) -> int:
    """Rows of a texture for this many samples; never a power of two (see `not_a_power_of_two`)."""
    return not_a_power_of_two(-(-n_samples // SAMPLES_PER_ROW))


def not_a_power_of_two(rows: int) -> int:
    """`rows`, at least three, or one more: llvmpipe compiles shaders anew for textures with a power of two of them,
    which would be a stall of 50 to 100 ms at the next object that happens to have as many."""
    rows = max(rows, 3)
    return rows + 1 if rows & (rows - 1) == 0 else rows


def sample_addresses(samples: NDArray[np.integer]) -> NDArray[np.int32]:
    """Linear texel address (row · 1024 + column) of each sample index; any shape."""
    i = np.asarray(samples, dtype=np.int32)
    return (i & ~np.int32(1023)) | ((i & 7) << 7) | ((i >> 3) & 127)


def pack_samples(values: NDArray[np.generic], n_components: int) -> NDArray[np.generic]:
    """Values (p,n) per sample as texels (rows, 1024, n_components), padded with 0."""
    n_samples, n_given = values.shape
    rows = row_count(n_samples)
    padded = np.zeros((rows * SAMPLES_PER_ROW, n_components), dtype=values.dtype)
    padded[:n_samples, :n_given] = values
    lanes = padded.reshape(rows, GROUPS_PER_ROW, GROUP_SIZE, n_components).swapaxes(1, 2)
    return np.ascontiguousarray(lanes).reshape(rows, SAMPLES_PER_ROW, n_components)


def unpack_samples(texels: NDArray[np.generic], n_samples: int) -> NDArray[np.generic]:
    """The inverse of `pack_samples`: (rows, 1024, n) to (p,n)."""
    rows, _, n_components = texels.shape
    groups = texels.reshape(rows, GROUP_SIZE, GROUPS_PER_ROW, n_components).swapaxes(1, 2)
    return np.ascontiguousarray(groups).reshape(-1, n_components)[:n_samples]
