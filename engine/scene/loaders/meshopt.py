"""Decodes buffer views that EXT_meshopt_compression and KHR_meshopt_compression compress: streams of vertices (versions
0 and 1), triangles and indices, and the filters of unit vectors, quaternions, exponents and colours.

No package of a decoder serves all of them on all systems; this one follows the extension's text (Khronos,
KHR_meshopt_compression, appendices A and B), of which the older extension is a part.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from engine.scene.loaders._meshopt_kernels import (
    BAD_CODE,
    LEFT_OVER,
    TRUNCATED,
    decode_indices,
    decode_triangles,
    decode_vertices,
)

Bytes = npt.NDArray[np.uint8]

_HEADERS = {"ATTRIBUTES": (0xA0, 0xA1), "TRIANGLES": (0xE1,), "INDICES": (0xD1,)}
_FAULTS = {
    TRUNCATED: ("cut off", "a whole stream"),
    LEFT_OVER: ("bytes left over", "a stream that ends with its elements"),
    BAD_CODE: ("a code without a meaning", "codes of the format"),
}


class CodecError(Exception):
    """A stream that cannot be decoded: the property at fault, its value, and what was expected."""

    def __init__(self, what: str, value: object, expected: str) -> None:
        super().__init__(what)
        self.what, self.value, self.expected = what, value, expected


def decode_meshopt(source: Bytes, count: int, stride: int, mode: str, filtering: str) -> Bytes:
    """The bytes (count · stride,) of a compressed view; raises CodecError. source (N,): its stream."""
    headers = _HEADERS.get(mode)
    if headers is None:
        raise CodecError("mode", mode, f"one of {', '.join(_HEADERS)}")
    is_vertices = mode == "ATTRIBUTES"
    if stride % 4 if is_vertices else stride not in (2, 4):
        raise CodecError("byteStride", stride, "a multiple of 4" if is_vertices else "2 or 4")
    if mode == "TRIANGLES" and count % 3:
        raise CodecError("count", count, "a multiple of 3")
    if source[0] not in headers:
        raise CodecError("first byte", hex(int(source[0])), " or ".join(map(hex, headers)))
    strides, decode_filter = _FILTERS.get(filtering, ((), None))
    if filtering != "NONE" and (decode_filter is None or not is_vertices):
        raise CodecError("filter", filtering, f"NONE, or one of {', '.join(_FILTERS)} for ATTRIBUTES")
    if strides and stride not in strides:
        raise CodecError("byteStride", stride, f"{' or '.join(map(str, strides))} with the filter {filtering}")
    source = np.ascontiguousarray(source)
    if is_vertices:
        target = np.empty(count * stride, np.uint8)
        fault = decode_vertices(source, count, stride, target)
    else:
        indices = np.empty(count, np.uint32)
        fault = decode_triangles(source, indices) if mode == "TRIANGLES" else decode_indices(source, indices)
        target = indices.astype("<u4" if stride == 4 else "<u2").view(np.uint8)
    if fault:
        raise CodecError("stream", *_FAULTS[fault])
    return target if decode_filter is None else decode_filter(target, stride).view(np.uint8).reshape(-1)


def _decode_octahedral(target: Bytes, stride: int) -> npt.NDArray:
    """Unit vectors from octahedral ones (x, y, 1, free), in numbers of stride / 4 bytes."""
    values = target.view(f"<i{stride // 4}").reshape(-1, 4).copy()
    most = float(np.iinfo(values.dtype).max)
    one = np.where(values[:, 2] == 0, 1, values[:, 2]).astype(np.float64)
    x, y = values[:, 0] / one, values[:, 1] / one
    z = 1.0 - np.abs(x) - np.abs(y)
    below = np.maximum(-z, 0.0)
    x, y = x - np.copysign(below, x), y - np.copysign(below, y)
    scale = most / np.maximum(np.sqrt(x * x + y * y + z * z), 1e-300)
    values[:, :3] = _rounded(np.stack([x, y, z], axis=1) * scale[:, None], -most - 1.0, most)
    return values


def _decode_quaternion(target: Bytes, stride: int) -> npt.NDArray:
    """Quaternions from their three smaller components, times √2, and a code of 1 and of which is the largest."""
    values = target.view("<i2").reshape(-1, 4).astype(np.int64)
    largest, one = values[:, 3] & 3, (values[:, 3] | 3).astype(np.float64)
    smaller = values[:, :3] * (math.sqrt(0.5) / one)[:, None]
    w = np.sqrt(np.maximum(1.0 - (smaller**2).sum(axis=1), 0.0))
    found, rows = np.empty(values.shape, "<i2"), np.arange(len(values))
    for k, part in enumerate((w, *smaller.T)):
        found[rows, (largest + k) % 4] = _rounded(part * 32767.0, -32768.0, 32767.0)
    return found


def _decode_exponential(target: Bytes, stride: int) -> npt.NDArray:
    """Floats m · 2^e from signed mantissas of 24 bits and signed exponents of 8, which are clamped to ±100."""
    values = target.view("<i4")
    exponent, mantissa = np.clip(values >> 24, -100, 100), values << 8 >> 8
    return np.ldexp(mantissa.astype(np.float32), exponent).astype("<f4")


def _decode_colour(target: Bytes, stride: int) -> npt.NDArray:
    """Colours from luma and chroma (Y, Co, Cg) and an alpha whose highest bit tells the number of bits."""
    unsigned = target.view(f"<u{stride // 4}").reshape(-1, 4)
    luma, alpha = (unsigned[:, k].astype(np.int64) for k in (0, 3))
    co, cg = (target.view(f"<i{stride // 4}").reshape(-1, 4)[:, k].astype(np.int64) for k in (1, 2))
    _, n_bits = np.frexp(np.maximum(alpha, 1).astype(np.float64))
    most = (1 << n_bits.astype(np.int64)) - 1
    rest = alpha & most >> 1
    colour = np.stack([luma + co - cg, luma + cg, luma - co - cg, rest << 1 | rest & 1], axis=1)
    full = float(np.iinfo(unsigned.dtype).max)
    return _rounded(colour * (full / most)[:, None], 0.0, full).astype(unsigned.dtype)


def _rounded(values: npt.NDArray[np.float64], low: float, high: float) -> npt.NDArray[np.float64]:
    """The nearest integers, halves away from zero, within a range."""
    return np.clip(np.trunc(values + np.copysign(0.5, values)), low, high)


_FILTERS: dict[str, tuple[tuple[int, ...], Callable[[Bytes, int], npt.NDArray]]] = {
    "OCTAHEDRAL": ((4, 8), _decode_octahedral),
    "QUATERNION": ((8,), _decode_quaternion),
    "EXPONENTIAL": ((), _decode_exponential),
    "COLOR": ((4, 8), _decode_colour),
}
