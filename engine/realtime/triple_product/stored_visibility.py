"""Visibility in stored form: deflated bits.

Bits are better than wavelets here: 1,280 bytes a point hold every edge to 1.4 degrees, and deflated they are smaller
than 80 coefficients of one byte with their indices (docs/orbit.md), without any error.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayReader, UnsoundArrays
from engine.core.threads import on_threads
from engine.realtime.triple_product.visibility import Bits

_PART = 2048  # points
_LEVEL = 1


def deflate_bits(name: str, bits: Bits) -> dict[str, NDArray[np.generic]]:
    """Deflate bits (S, B) into arrays to be stored under names that begin with `name`."""
    # Transposed, so that the bits of neighbouring points, which see about the same, are adjacent.
    parts = on_threads(lambda at: zlib.compress(bits[at : at + _PART].T.tobytes(), _LEVEL), range(0, len(bits), _PART))
    ends = np.cumsum([0, *map(len, parts)], dtype=np.int64)
    return {f"{name}_data": np.frombuffer(b"".join(parts), np.uint8), f"{name}_starts": ends}


def inflate_bits(name: str, reader: ArrayReader, n_points: int, n_bytes: int) -> Bits:
    """Inflate what `deflate_bits` made of bits (S, B). Raises UnsoundArrays."""
    begins = range(0, n_points, _PART)
    reader.sizes[f"{name} parts"] = len(begins)
    starts = reader.runs(f"{name}_starts", f"{name} parts", f"{name} bytes")
    data = reader.take(f"{name}_data", np.uint8, f"{name} bytes").tobytes()
    bits = np.empty((n_points, n_bytes), np.uint8)

    def part(i: int) -> None:
        stop = min(begins[i] + _PART, n_points)
        size = (stop - begins[i]) * n_bytes
        found = zlib.decompressobj().decompress(data[starts[i] : starts[i + 1]], size + 1)
        if len(found) != size:
            raise UnsoundArrays(f"{name!r} has {len(found)} bytes in part {i}, expected {size}")
        bits[begins[i] : stop] = np.frombuffer(found, np.uint8).reshape(n_bytes, stop - begins[i]).T

    try:
        on_threads(part, range(len(begins)))
    except zlib.error as error:
        raise UnsoundArrays(f"{name!r}: {error}") from error
    return bits
