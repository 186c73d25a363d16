"""A layer's transport in GPU memory, its upload in slices, and the accumulators to which its terms are added.

One coefficient is one layer of an array texture; its (p,3) numbers are stored as they come from the worker (see below),
so an upload copies and never rearranges nor converts: halves stay halves. They are numbers h with T = scale·h, one
scale for each coefficient (see ``engine.precompute.direct.bandstore``): a scale for each pixel would zero the weak
bands, none would overflow. The shader decodes every half exactly.

Reading one coefficient at a time leaves the choice of terms free; the packing is what makes it fast on a CPU. One layer
of 60,000 samples, llvmpipe (Mesa 22.3, LLVM 15) on two cores of an AMD EPYC, best of 25 while others used the machine;
one core of it reads memory at 20 GB/s, which would be 0.5 ms for 30 halves and 2.3 ms for 128::

    30 terms  128 terms   bytes/term and sample
     8.2 ms    40.2 ms     6   one sample a fragment, RGB16F array
     7.6 ms    35.6 ms     8   one sample a fragment, RGBA16F array
     7.5 ms    46.1 ms    16   one sample a fragment, RGBA32F array
     5.6 ms    13.8 ms     6   one sample a fragment, 8 consecutive coefficients a texel, three RGBA32UI a group of 8
     5.8 ms    18.8 ms     6   one sample a fragment, 4 consecutive coefficients a texel, three RGBA16F a group of 4
     7.6 ms    36.8 ms     6   2 samples a fragment, one RGB32UI texel, two targets
     4.3 ms    16.3 ms     6   8 samples a fragment, three RGBA32UI texels, eight targets      <- this one
     4.1 ms    16.2 ms     6   the same in a 2D atlas (too tall for large layers)
     3.8 ms    14.8 ms     6   the same in a buffer texture (moderngl has none)
     8.1 ms    31.6 ms    12   4 samples a fragment, three RGBA32F texels, four targets (float precision)

A texel fetch costs about the same whatever its width, so wide texels are best. Packing consecutive coefficients is as
fast for whole curves, but a few chosen terms are in many groups, and the numbers must be rearranged on upload. Blending
into the accumulator and a second one read and written in turn differ by less than the noise (0.3 ms of 7).

Accumulators, and the two passes that add terms to them.

`TermSum` first sums the chosen terms for groups of eight samples (increment.frag, eight targets), then adds each lane
to the accumulator with blending (scatter.frag). The sum of one step is rounded before it meets the picture, so small
edits to a bright picture lose nothing among themselves.

The transport's 16-bit numbers are stored as they come, eight to a texel of four 32-bit words; red, green and blue of
eight samples fill three texels exactly. A fragment of the increment pass therefore works on a *group* of eight
consecutive samples and has eight results, one per render target (a *lane*). An accumulator has the lanes side by side:
sample i of group q = i // 8 and lane j = i % 8 has column j·128 + q % 128 of row q // 128, so that a row is 1,024
samples in a row of the transport as well. ``shaders/common/sample_layout.glsl`` has the same numbers.
"""

from __future__ import annotations

import time

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.settings import Precision
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Passes, uniform

# ------------------------------------------------------------------------------------------------ the layout of samples


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
    (n_samples, n_given), whole = values.shape, len(values) // SAMPLES_PER_ROW
    texels = np.zeros((row_count(n_samples), GROUP_SIZE, GROUPS_PER_ROW, n_components), dtype=values.dtype)
    rows = [values[: whole * SAMPLES_PER_ROW]]
    if n_samples % SAMPLES_PER_ROW:
        rows.append(np.zeros((SAMPLES_PER_ROW, n_given), dtype=values.dtype))
        rows[1][: n_samples % SAMPLES_PER_ROW] = values[whole * SAMPLES_PER_ROW :]
    for first, part in zip((0, whole), rows, strict=False):
        lanes = part.reshape(-1, GROUPS_PER_ROW, GROUP_SIZE, n_given).swapaxes(1, 2)
        for i in range(n_given):  # one at a time is three times as fast as all three
            texels[first : first + len(lanes), ..., i] = lanes[..., i]
    return texels.reshape(-1, SAMPLES_PER_ROW, n_components)


def unpack_samples(texels: NDArray[np.generic], n_samples: int) -> NDArray[np.generic]:
    """The inverse of `pack_samples`: (rows, 1024, n) to (p,n)."""
    rows, _, n_components = texels.shape
    groups = texels.reshape(rows, GROUP_SIZE, GROUPS_PER_ROW, n_components).swapaxes(1, 2)
    return np.ascontiguousarray(groups).reshape(-1, n_components)[:n_samples]


# --------------------------------------------------------------------------------------------------------- accumulators


TERMS_PER_PASS = 128  # four uniform components each: half of the 1,024 that OpenGL 4.1 promises


class Accumulator:
    """B at the p samples of one layer: RGBA32F texels in sample layout, with a framebuffer to add to."""

    def __init__(self, memory: TextureMemory, n_samples: int) -> None:
        self.n_samples, self.rows = n_samples, row_count(n_samples)
        self._memory = memory
        self.texture = memory.texture((SAMPLES_PER_ROW, self.rows), 4, "f4")
        self.framebuffer = memory.framebuffer([self.texture])

    def write(self, radiance: NDArray[np.floating]) -> None:
        """Replace all by radiance (p,3)."""
        self.texture.write(pack_samples(radiance.astype(np.float32, copy=False), 4))

    def read(self) -> NDArray[np.float32]:
        """The radiance (p,3); waits for the GPU."""
        return unpack_samples(read_texture(self.texture, np.float32), self.n_samples)[:, :3].astype(np.float32)

    def release(self) -> None:
        self._memory.release_framebuffer(self.framebuffer)
        self._memory.release(self.texture)


class TermSum:
    """Adds Σ_k m_k·(stored numbers of k) to accumulators. Its scratch targets grow to the largest layer."""

    def __init__(self, passes: Passes, memory: TextureMemory) -> None:
        self._passes, self._memory = passes, memory
        self._lanes: list[moderngl.Texture] = []
        self._target: moderngl.Framebuffer | None = None

    def reserve(self, rows: int) -> None:
        """Make room for layers of this many rows; raises GraphicsError when there is none."""
        if self._lanes and self._lanes[0].height >= rows:
            return
        self._release_lanes()
        for _ in range(GROUP_SIZE):
            self._lanes.append(self._memory.texture((GROUPS_PER_ROW, rows), 4, "f4"))
        self._target = self._memory.framebuffer(self._lanes)

    def add(
        self,
        transport: TransportTexture,
        indices: NDArray[np.intp],
        multipliers: NDArray[np.float32],
        accumulator: Accumulator,
        *,
        replace: bool = False,
    ) -> None:
        """Add the terms `indices` (K,) times `multipliers` (K,3); with `replace` what was there before is dropped."""
        self.reserve(transport.rows)
        for first in range(0, max(1, len(indices)), TERMS_PER_PASS):
            chunk = slice(first, first + TERMS_PER_PASS)
            self._sum(transport, indices[chunk], multipliers[chunk], add=first > 0)
        self._scatter(accumulator, add=not replace)

    def _sum(
        self, transport: TransportTexture, indices: NDArray[np.intp], multipliers: NDArray[np.float32], add: bool
    ) -> None:
        assert self._target is not None and transport.texture is not None
        program = self._passes.full_screen("placement/increment.frag.glsl", HALF=int(transport.precision == "half"))
        terms = np.zeros((TERMS_PER_PASS, 4), dtype=np.float32)
        terms[: len(indices), :3] = multipliers
        terms[: len(indices), 3] = indices
        uniform(program, "terms").write(terms)
        box = (0, 0, GROUPS_PER_ROW, transport.rows)
        textures = {"transport": transport.texture}
        self._passes.draw(program, self._target, box, textures, add=add, n_terms=len(indices))

    def _scatter(self, accumulator: Accumulator, add: bool) -> None:
        program = self._passes.full_screen("placement/scatter.frag.glsl")
        for lane, increments in enumerate(self._lanes):
            column = lane * GROUPS_PER_ROW
            box = (column, 0, GROUPS_PER_ROW, accumulator.rows)
            textures = {"increments": increments}
            self._passes.draw(program, accumulator.framebuffer, box, textures, add=add, first_column=column)

    def _release_lanes(self) -> None:
        self._memory.release_framebuffer(self._target)
        self._target = None
        for lane in self._lanes:
            self._memory.release(lane)
        self._lanes = []

    def release(self) -> None:
        self._release_lanes()


# ---------------------------------------------------------------------------------------------- transport in GPU memory


_TEXELS_PER_GROUP = {"half": 3, "float": 6}
_PRECISIONS: dict[str, Precision] = {"float16": "half", "float32": "float"}
_MEAN_SAMPLES = 4096


class TransportTexture:
    """The numbers of J coefficients at p samples; true values are `scale` (J,3) times what is stored."""

    def __init__(self, memory: TextureMemory, n_coefficients: int, n_samples: int, precision: Precision) -> None:
        self.n_coefficients, self.n_samples, self.precision = n_coefficients, n_samples, precision
        self.rows = row_count(n_samples)
        self.scale = np.ones((n_coefficients, 3))
        self.means = np.zeros((n_coefficients, 3))
        self._memory = memory
        self._width = _TEXELS_PER_GROUP[precision] * GROUPS_PER_ROW
        dtype = "u4" if precision == "half" else "f4"
        self.texture: moderngl.TextureArray | None = memory.texture_array(
            (self._width, self.rows, n_coefficients), 4, dtype
        )

    def write(self, k: int, numbers: NDArray[np.floating]) -> None:
        """Store coefficient k's (p,3) numbers, float16 or float32 by the precision, C-contiguous."""
        assert self.texture is not None
        full = self.n_samples // SAMPLES_PER_ROW
        if full:
            self.texture.write(numbers[: full * SAMPLES_PER_ROW], viewport=(0, 0, k, self._width, full, 1))
        if full < self.rows:
            last = np.zeros((SAMPLES_PER_ROW, 3), dtype=numbers.dtype)
            last[: self.n_samples - full * SAMPLES_PER_ROW] = numbers[full * SAMPLES_PER_ROW :]
            self.texture.write(last, viewport=(0, full, k, self._width, 1, 1))

    def release(self) -> None:
        self._memory.release(self.texture)
        self.texture = None


class TransportUpload:
    """Uploads a (J,p,3) array into a TransportTexture, coefficient by coefficient, within time slices."""

    def __init__(
        self,
        memory: TextureMemory,
        transport: NDArray[np.floating],
        norms: NDArray[np.floating],
        scale: NDArray[np.floating] | None,
    ) -> None:
        n_coefficients, n_samples = _checked_shape(transport, norms, scale)
        self.norms = np.array(norms, dtype=np.float64)
        self._source = transport
        self._next = 0
        self.target = TransportTexture(memory, n_coefficients, n_samples, _PRECISIONS[transport.dtype.name])
        if scale is not None:
            self.target.scale[:] = np.asarray(scale, dtype=np.float64).reshape(n_coefficients, -1)

    @property
    def done(self) -> bool:
        return self._next == self.target.n_coefficients

    @property
    def fraction(self) -> float:
        return self._next / self.target.n_coefficients

    def advance(self, time_budget_s: float) -> bool:
        """Upload until the time is over, at least one coefficient; True when all are there.

        Raises GraphicsError when a number is not finite; the target is then incomplete and must be released.
        """
        end = time.perf_counter() + time_budget_s
        while not self.done:
            self._upload_next()
            if time.perf_counter() >= end:
                break
        return self.done

    def _upload_next(self) -> None:
        k, target = self._next, self.target
        numbers = np.ascontiguousarray(self._source[k])
        if not _all_finite(numbers):
            raise GraphicsError(f"transport coefficient {k} holds a number that is not finite; the old picture stays")
        target.write(k, numbers)
        target.means[k] = target.scale[k] * _mean(numbers)
        self._next += 1


def _checked_shape(
    transport: NDArray[np.floating],
    norms: NDArray[np.floating],
    scale: NDArray[np.floating] | None,
) -> tuple[int, int]:
    if transport.ndim != 3 or transport.shape[2] != 3 or transport.shape[0] < 1:
        raise GraphicsError(f"transport of shape {transport.shape}, expected (J, p, 3)")
    if transport.dtype.name not in _PRECISIONS:
        raise GraphicsError(f"transport of {transport.dtype.name}, expected {' or '.join(_PRECISIONS)}")
    n_coefficients, n_samples = transport.shape[:2]
    if norms.shape != (n_coefficients, 3) or not np.isfinite(norms).all():
        raise GraphicsError(f"norms of shape {norms.shape}, expected ({n_coefficients}, 3), all finite")
    if scale is not None and np.shape(scale) not in ((n_coefficients,), (n_coefficients, 1), (n_coefficients, 3)):
        raise GraphicsError(f"scale of shape {np.shape(scale)}, expected ({n_coefficients},) or ({n_coefficients}, 3)")
    return n_coefficients, n_samples


def _mean(numbers: NDArray[np.floating]) -> NDArray[np.float32]:
    """Mean (3,) of some thousand of the numbers: as a product, which is ten times as fast as numpy's own of halves."""
    some = numbers[:: max(1, len(numbers) // _MEAN_SAMPLES)].astype(np.float32)
    return np.full(len(some), 1.0 / max(1, len(some)), np.float32) @ some


def _all_finite(numbers: NDArray[np.floating]) -> bool:
    if numbers.dtype == np.float16:  # np.isfinite of halves is ten times slower than a test of the exponents
        return numbers.size == 0 or int((numbers.view(np.uint16) & 0x7FFF).max()) < 0x7C00
    return bool(np.isfinite(numbers).all())
