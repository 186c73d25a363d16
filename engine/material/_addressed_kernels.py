"""Compiled reads of tables by address: quotient parameters are numbers, and a table's address is one of them."""

from __future__ import annotations

import ctypes

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from engine.material._kernels import _is_interpreted


@intrinsic
def _float_compiled(typingctx, address, index):  # type: ignore[no-untyped-def]
    """The index-th float32 from an address on."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = builder.inttoptr(arguments[0], ir.FloatType().as_pointer())
        return builder.load(builder.gep(pointer, [arguments[1]]))

    return types.float32(types.int64, types.int64), generate


def _float_plain(address: int, index: int) -> float:
    """For interpreted kernels."""
    return float(ctypes.c_float.from_address(address + 4 * index).value)


float_at = _float_plain if _is_interpreted else _float_compiled
