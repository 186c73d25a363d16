"""Vectors of four float32 for sums over red, green and blue. Numba alone keeps each number in its own register and
takes three times as long.

A colour has three channels, and the fourth lane has no meaning. For colours side by side in memory it holds the next
number, so an array must have one more number behind its last colour (`N_BEHIND` if there may be fewer).
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

from engine.core.fast_math import FAST

_intrinsic: Any = intrinsic
_FLAGS = tuple(sorted(FAST))
_INT = ir.IntType(32)
_FLOATS, _WORDS = ir.VectorType(ir.FloatType(), 4), ir.VectorType(_INT, 4)
_NONE = ir.Constant(_FLOATS, ir.Undefined)


class _Lanes(types.Type):
    def __init__(self) -> None:
        super().__init__("Lanes")


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _FLOATS)


_LANES = _Lanes()
N_BEHIND = 3


@_intrinsic
def zeros(typingctx):  # type: ignore[no-untyped-def]
    """Four zeros."""
    return _LANES(), lambda context, builder, signature, arguments: ir.Constant(_FLOATS, [0.0] * 4)


@_intrinsic
def of(typingctx, red, green, blue):  # type: ignore[no-untyped-def]
    """A vector of three numbers."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        made = _NONE
        for i, value in enumerate(arguments):
            made = builder.insert_element(made, value, ir.Constant(_INT, i))
        return made

    return _LANES(*[types.float32] * 3), generate


@_intrinsic
def even(typingctx, value):  # type: ignore[no-untyped-def]
    """One number in all four lanes."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        first = builder.insert_element(_NONE, arguments[0], ir.Constant(_INT, 0))
        return builder.shuffle_vector(first, _NONE, ir.Constant(_WORDS, [0] * 4))

    return _LANES(types.float32), generate


@_intrinsic
def floats(typingctx, array, at):  # type: ignore[no-untyped-def]
    """Loads four consecutive numbers of a float32 array in C order, from index `at` on."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.load(_four(context, builder, signature, arguments, _FLOATS), align=4)

    return _LANES(array, at), generate


@_intrinsic
def halves(typingctx, array, at):  # type: ignore[no-untyped-def]
    """The same for bfloat16 stored as uint16."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        four = _four(context, builder, signature, arguments, ir.VectorType(ir.IntType(16), 4))
        words = builder.zext(builder.load(four, align=2), _WORDS)
        return builder.bitcast(builder.shl(words, ir.Constant(_WORDS, [16] * 4)), _FLOATS)

    return _LANES(array, at), generate


@_intrinsic
def store(typingctx, array, at, lanes):  # type: ignore[no-untyped-def]
    """Stores all four lanes to a float32 array in C order, from index `at` on."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        builder.store(arguments[2], _four(context, builder, signature, arguments, _FLOATS), align=4)
        return context.get_dummy_value()

    return types.void(array, at, _LANES), generate


def _four(context: Any, builder: Any, signature: Any, arguments: Any, kind: ir.VectorType) -> Any:
    """A pointer to four consecutive numbers in the first argument."""
    data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    return builder.bitcast(builder.gep(data, [arguments[1]]), kind.as_pointer())


@_intrinsic
def plus_product(typingctx, sums, one, two):  # type: ignore[no-untyped-def]
    """sums + one × two."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        product = builder.fmul(arguments[1], arguments[2], flags=_FLAGS)
        return builder.fadd(arguments[0], product, flags=_FLAGS)

    return _LANES(_LANES, _LANES, _LANES), generate


@_intrinsic
def minus(typingctx, one, two):  # type: ignore[no-untyped-def]
    """one − two."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.fsub(*arguments, flags=_FLAGS)

    return _LANES(_LANES, _LANES), generate


@_intrinsic
def larger(typingctx, one, two):  # type: ignore[no-untyped-def]
    """The maximum of each lane."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.select(builder.fcmp_ordered(">", *arguments), *arguments)

    return _LANES(_LANES, _LANES), generate


@_intrinsic
def total(typingctx, lanes):  # type: ignore[no-untyped-def]
    """The sum of red, green and blue."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        red, green, blue = (builder.extract_element(arguments[0], ir.Constant(_INT, i)) for i in range(3))
        return builder.fadd(builder.fadd(red, green), blue)

    return types.float32(_LANES), generate
