"""Eight contacts at once: a number type for kernels that holds one value per lane.

Kernels are written for numbers; handed lanes instead, the same text updates eight contacts with
one instruction each (LLVM maps eight doubles to one AVX-512 or two AVX2 registers). Nothing else
in the package knows about vector instructions. Lanes exist only in compiled code.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.errors import TypingError
from numba.extending import lower_builtin, register_model, type_callable

from granufab.kernels.options import ARITHMETIC, intrinsic

__all__ = [
    "LANES",
    "MASK",
    "WIDTH",
    "address_of",
    "choose_lanes",
    "gather_4",
    "gather_8",
    "largest",
    "load_lanes",
    "prefetch_4",
    "prefetch_8",
    "prefetch_line",
    "read_item",
    "scatter_4",
    "scatter_8",
    "spread",
    "store_lanes",
    "total",
    "write_item",
]

WIDTH = 8
_FLAGS = tuple(sorted(ARITHMETIC["fastmath"]))
_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)


class _Lanes(types.Type):
    """Numba type of eight doubles."""


class _Mask(types.Type):
    """Numba type of eight truth values."""


LANES, MASK = _Lanes("lanes"), _Mask("mask")


@register_model(_Lanes)
class _LanesModel(PrimitiveModel):
    def __init__(self, manager: Any, numba_type: Any) -> None:
        super().__init__(manager, numba_type, _VECTOR)


@register_model(_Mask)
class _MaskModel(PrimitiveModel):
    def __init__(self, manager: Any, numba_type: Any) -> None:
        super().__init__(manager, numba_type, _BITS)


def _indices(order: Sequence[int]) -> ir.Constant:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(order)), list(order))


def _shuffle(builder: Any, one: Any, two: Any, order: Sequence[int]) -> Any:
    return builder.shuffle_vector(one, two, _indices(order))


def _spread(builder: Any, value: Any) -> Any:
    """The same number in every lane; lanes as they are."""
    if value.type == _VECTOR:
        return value
    empty = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    return _shuffle(builder, first, empty, [0] * WIDTH)


def _of_lanes(*operands: Any) -> bool:
    return LANES in operands and all(x in (LANES, types.float64) for x in operands)


def _binary(function: Any, result: Any, emit: Callable[..., Any]) -> None:
    """Teach ``function(a, b)`` to take lanes, or lanes and a number, which is spread."""

    @type_callable(function)
    def typing(context):
        def kind(a, b):
            return result if _of_lanes(a, b) else None

        return kind

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return emit(builder, *(_spread(builder, value) for value in values))

    for operands in ((LANES, LANES), (LANES, types.float64), (types.float64, LANES)):
        lower_builtin(function, *operands)(code)


def _unary(function: Any, emit: Callable[..., Any]) -> None:
    """Teach ``function(a)`` to take lanes."""

    @type_callable(function)
    def typing(context):
        def kind(a):
            return LANES if a == LANES else None

        return kind

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return emit(builder, values[0])

    lower_builtin(function, LANES)(code)


def _pick(comparison: str) -> Callable[..., Any]:
    def emit(builder: Any, a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered(comparison, a, b, flags=_FLAGS), a, b)

    return emit


def _math(name: str) -> Callable[..., Any]:
    def emit(builder: Any, a: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64")
        return builder.call(function, [a], fastmath=_FLAGS)

    return emit


_binary(operator.add, LANES, lambda b, x, y: b.fadd(x, y, flags=_FLAGS))
_binary(operator.sub, LANES, lambda b, x, y: b.fsub(x, y, flags=_FLAGS))
_binary(operator.mul, LANES, lambda b, x, y: b.fmul(x, y, flags=_FLAGS))
_binary(operator.truediv, LANES, lambda b, x, y: b.fdiv(x, y, flags=_FLAGS))
_binary(operator.lt, MASK, lambda b, x, y: b.fcmp_ordered("<", x, y, flags=_FLAGS))
_binary(operator.le, MASK, lambda b, x, y: b.fcmp_ordered("<=", x, y, flags=_FLAGS))
_binary(operator.gt, MASK, lambda b, x, y: b.fcmp_ordered(">", x, y, flags=_FLAGS))
_binary(operator.ge, MASK, lambda b, x, y: b.fcmp_ordered(">=", x, y, flags=_FLAGS))
_binary(min, LANES, _pick("<"))
_binary(max, LANES, _pick(">"))
_unary(operator.neg, lambda b, x: b.fneg(x, flags=_FLAGS))
_unary(abs, _math("fabs"))
_unary(math.sqrt, _math("sqrt"))


@intrinsic
def choose_lanes(typing_context, mask, one, two):
    """``one`` where the mask holds, else ``two``, lane by lane."""

    def code(context, builder, signature, values):
        return builder.select(values[0], _spread(builder, values[1]), _spread(builder, values[2]))

    return LANES(mask, one, two), code


def _halves(builder: Any, value: Any, width: int) -> tuple[Any, Any]:
    half = width // 2
    empty = ir.Constant(value.type, ir.Undefined)
    low = _shuffle(builder, value, empty, range(half))
    return low, _shuffle(builder, value, empty, range(half, width))


def _fold(emit: Callable[..., Any]) -> Callable[..., Any]:
    """Halve the lanes until one number is left."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        value, width = values[0], WIDTH
        while width > 1:
            low, high = _halves(builder, value, width)
            value, width = emit(builder, low, high), width // 2
        return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))

    return code


@intrinsic
def total(typing_context, a):
    """Sum over the lanes."""
    return types.float64(LANES), _fold(lambda b, x, y: b.fadd(x, y, flags=_FLAGS))


@intrinsic
def largest(typing_context, a):
    """Maximum over the lanes."""
    return types.float64(LANES), _fold(_pick(">"))


@intrinsic
def spread(typing_context, a):
    """The same number in every lane."""
    return LANES(types.float64), lambda c, builder, signature, values: _spread(builder, values[0])


def _wide(builder: Any, pointer: Any, width: int) -> Any:
    return builder.bitcast(pointer, ir.VectorType(_DOUBLE, width).as_pointer())


@intrinsic
def address_of(typing_context, array):
    """Where the numbers of an array begin: unlike the array, it is not counted when passed on."""
    if array.layout != "C":
        raise TypingError("an address is of an array whose rows follow one another")

    def code(context, builder, signature, values):
        return context.make_array(signature.args[0])(context, builder, values[0]).data

    return types.CPointer(array.dtype)(array), code


@intrinsic
def read_item(typing_context, address, place):
    """One number behind an address."""

    def code(context, builder, signature, values):
        return builder.load(builder.gep(values[0], [values[1]]))

    return address.dtype(address, place), code


@intrinsic
def write_item(typing_context, address, place, value):
    """Write one number behind an address."""

    def code(context, builder, signature, values):
        builder.store(values[2], builder.gep(values[0], [values[1]]))
        return context.get_dummy_value()

    return types.none(address, place, address.dtype), code


@intrinsic
def load_lanes(typing_context, address, place):
    """Eight neighbouring items of a line of numbers."""

    def code(context, builder, signature, values):
        pointer = builder.gep(values[0], [values[1]])
        return builder.load(_wide(builder, pointer, WIDTH), align=8)

    return LANES(address, place), code


@intrinsic
def store_lanes(typing_context, address, place, value):
    """Write eight neighbouring items of a line of numbers."""

    def code(context, builder, signature, values):
        pointer = builder.gep(values[0], [values[1]])
        builder.store(values[2], _wide(builder, pointer, WIDTH), align=8)
        return context.get_dummy_value()

    return types.none(address, place, value), code


def _rows(builder: Any, values: Any, width: int) -> list[Any]:
    """Pointers to the rows that eight neighbouring entries of an index name."""
    table, index, place = values[:3]
    first, size = builder.gep(index, [place]), ir.IntType(64)
    pointers = []
    for lane in range(WIDTH):
        entry = builder.load(builder.gep(first, [ir.Constant(size, lane)]))
        row = builder.mul(builder.zext(entry, size), ir.Constant(size, width))
        pointers.append(_wide(builder, builder.gep(table, [row]), width))
    return pointers


def _prefetch(builder: Any, pointer: Any) -> None:
    """Ask for the cache line of an address that is going to be changed."""
    number, byte = ir.IntType(32), ir.IntType(8).as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    hints = [ir.Constant(number, hint) for hint in (1, 3, 1)]
    builder.call(function, [builder.bitcast(pointer, byte), *hints])


def _announcing(width: int) -> Callable[..., Any]:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        for pointer in _rows(builder, values, width):
            _prefetch(builder, pointer)
        return context.get_dummy_value()

    return code


@intrinsic
def prefetch_4(typing_context, table, index, place):
    """Ask for the rows that :func:`gather_4` reads, ahead of their use."""
    return types.none(table, index, place), _announcing(4)


@intrinsic
def prefetch_8(typing_context, table, index, place):
    """Ask for the rows that :func:`gather_8` reads, ahead of their use."""
    return types.none(table, index, place), _announcing(8)


@intrinsic
def prefetch_line(typing_context, address, place):
    """Ask for the cache line that holds one item."""

    def code(context, builder, signature, values):
        _prefetch(builder, builder.gep(values[0], [values[1]]))
        return context.get_dummy_value()

    return types.none(address, place), code


def _interleave(builder: Any, values: list[Any], span: int) -> list[Any]:
    """One stage of a transposition: swap blocks of ``span`` lanes between pairs of vectors."""
    result = list(values)
    for k in range(len(values)):
        if k & span:
            continue
        one, two = values[k], values[k + span]
        low = [i if not i & span else WIDTH + i - span for i in range(WIDTH)]
        high = [i + span if not i & span else WIDTH + i for i in range(WIDTH)]
        result[k] = _shuffle(builder, one, two, low)
        result[k + span] = _shuffle(builder, one, two, high)
    return result


def _turn(builder: Any, values: list[Any]) -> list[Any]:
    """Transpose blocks of size len(values): 4 rows of two, or 8 rows of one."""
    span = 1
    while span < len(values):
        values = _interleave(builder, values, span)
        span *= 2
    return values


def _join(builder: Any, low: Any, high: Any) -> Any:
    return _shuffle(builder, low, high, range(WIDTH))


def _gathering(width: int) -> Callable[..., Any]:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows = [builder.load(p, align=8) for p in _rows(builder, values, width)]
        if width == 4:
            rows = [_join(builder, rows[k], rows[k + 4]) for k in range(4)]
        return context.make_tuple(builder, signature.return_type, _turn(builder, rows))

    return code


def _scattering(width: int) -> Callable[..., Any]:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointers = _rows(builder, values, width)
        columns = cgutils.unpack_tuple(builder, values[3], width)
        rows = _turn(builder, columns)
        if width == 4:
            parts = [_halves(builder, row, WIDTH) for row in rows]
            rows = [low for low, _ in parts] + [high for _, high in parts]
        for pointer, row in zip(pointers, rows, strict=True):
            builder.store(row, pointer, align=8)
        return context.get_dummy_value()

    return code


@intrinsic
def gather_4(typing_context, table, index, place):
    """Columns of the rows table[index[place : place + 8]] of four numbers, each as lanes."""
    return types.UniTuple(LANES, 4)(table, index, place), _gathering(4)


@intrinsic
def gather_8(typing_context, table, index, place):
    """Columns of the rows table[index[place : place + 8]] of eight numbers, each as lanes."""
    return types.UniTuple(LANES, 8)(table, index, place), _gathering(8)


@intrinsic
def scatter_4(typing_context, table, index, place, columns):
    """Write what :func:`gather_4` reads; rows named twice must get the same numbers."""
    return types.none(table, index, place, columns), _scattering(4)


@intrinsic
def scatter_8(typing_context, table, index, place, columns):
    """Write what :func:`gather_8` reads; rows named twice must get the same numbers."""
    return types.none(table, index, place, columns), _scattering(8)
