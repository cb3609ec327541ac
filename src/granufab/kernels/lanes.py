"""Eight contacts at once: vectors of doubles in LLVM's language, and how they meet memory.

Kernels are written for numbers; handed lanes instead, the same text updates eight contacts with
one instruction each (LLVM maps eight doubles to one AVX-512 or two AVX2 registers). The functions
here write instructions; :mod:`granufab.kernels.tracing` decides which.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba.core import cgutils

__all__ = [
    "DOUBLE",
    "LANES",
    "WIDTH",
    "fold",
    "gather",
    "item_of",
    "load_lanes",
    "move_on",
    "prefetch",
    "rows_of",
    "scatter",
    "spread",
    "store_lanes",
]

WIDTH = 8
DOUBLE, SIZE = ir.DoubleType(), ir.IntType(64)
LANES = ir.VectorType(DOUBLE, WIDTH)


def _shuffle(builder: Any, one: Any, two: Any, order: Sequence[int]) -> Any:
    indices = ir.Constant(ir.VectorType(ir.IntType(32), len(order)), list(order))
    return builder.shuffle_vector(one, two, indices)


def spread(builder: Any, value: Any) -> Any:
    """The same number in every lane; lanes as they are."""
    if isinstance(value.type, ir.VectorType):
        return value
    empty = ir.Constant(LANES, ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    return _shuffle(builder, first, empty, [0] * WIDTH)


def _halves(builder: Any, value: Any, width: int) -> tuple[Any, Any]:
    half = width // 2
    empty = ir.Constant(value.type, ir.Undefined)
    low = _shuffle(builder, value, empty, range(half))
    return low, _shuffle(builder, value, empty, range(half, width))


def fold(builder: Any, value: Any, emit: Callable[[Any, Any], Any]) -> Any:
    """Halve the lanes until one number is left."""
    width = WIDTH
    while width > 1:
        low, high = _halves(builder, value, width)
        value, width = emit(low, high), width // 2
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))


def item_of(builder: Any, address: Any, place: Any) -> Any:
    """Pointer to an item behind an address."""
    return builder.gep(address, [place])


def _wide(builder: Any, pointer: Any, width: int) -> Any:
    return builder.bitcast(pointer, ir.VectorType(DOUBLE, width).as_pointer())


def load_lanes(builder: Any, address: Any, place: Any) -> Any:
    """Eight neighbouring items of a line of numbers."""
    return builder.load(_wide(builder, item_of(builder, address, place), WIDTH), align=8)


def store_lanes(builder: Any, address: Any, place: Any, value: Any) -> None:
    """Write eight neighbouring items of a line of numbers."""
    builder.store(value, _wide(builder, item_of(builder, address, place), WIDTH), align=8)


def move_on(builder: Any, now: Any, before: Any, width: int, factor: Any, flags: Any) -> None:
    """now ← now + factor·(now − before), before ← now, for ``width`` neighbouring items."""
    now, before = _wide(builder, now, width), _wide(builder, before, width)
    value = builder.load(now, align=8)
    share = ir.Constant(value.type, ir.Undefined)
    share = builder.insert_element(share, factor, ir.Constant(ir.IntType(32), 0))
    share = _shuffle(builder, share, share, [0] * width)
    step = builder.fsub(value, builder.load(before, align=8), flags=flags)
    step = builder.fmul(share, step, flags=flags)
    builder.store(builder.fadd(value, step, flags=flags), now, align=8)
    builder.store(value, before, align=8)


def rows_of(builder: Any, table: Any, index: Any, place: Any, width: int) -> list[Any]:
    """Pointers to the rows that eight neighbouring entries of an index name."""
    first = item_of(builder, index, place)
    pointers = []
    for lane in range(WIDTH):
        entry = builder.load(item_of(builder, first, ir.Constant(SIZE, lane)))
        row = builder.mul(builder.zext(entry, SIZE), ir.Constant(SIZE, width))
        pointers.append(_wide(builder, item_of(builder, table, row), width))
    return pointers


def prefetch(builder: Any, pointer: Any) -> None:
    """Ask for the cache line of an address that is going to be changed."""
    number, byte = ir.IntType(32), ir.IntType(8).as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    hints = [ir.Constant(number, hint) for hint in (1, 3, 1)]
    builder.call(function, [builder.bitcast(pointer, byte), *hints])


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


def gather(builder: Any, pointers: Sequence[Any]) -> list[Any]:
    """Columns of eight rows of 4 or 8 numbers, each as lanes."""
    rows = [builder.load(pointer, align=8) for pointer in pointers]
    if rows[0].type.count == 4:
        rows = [_shuffle(builder, rows[k], rows[k + 4], range(WIDTH)) for k in range(4)]
    return _turn(builder, rows)


def scatter(builder: Any, pointers: Sequence[Any], columns: list[Any]) -> None:
    """Write what :func:`gather` reads; rows named twice must get the same numbers."""
    rows = _turn(builder, columns)
    if len(columns) == 4:
        parts = [_halves(builder, row, WIDTH) for row in rows]
        rows = [low for low, _ in parts] + [high for _, high in parts]
    for pointer, row in zip(pointers, rows, strict=True):
        builder.store(row, pointer, align=8)
