"""Functions that are compiled by being run: what they do to numbers is written down as it happens.

The text of a traced function is plain Python. Where a kernel calls it, it runs once, while the
kernel is compiled, on stand-ins for numbers, lanes and arrays, whose operators write instructions
into the kernel. So loops over the components of a vector unroll, one text serves two and three
dimensions, one contact and eight, and numba has nothing to infer: that takes a tenth of the time.
What a kernel decides while it runs is a matter for :func:`choose`, not for ``if``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, infer, infer_global, signature
from numba.extending import lower_builtin

from granufab.kernels import lanes
from granufab.kernels.standins import (
    Address,
    Real,
    Table,
    Truth,
    Whole,
    as_double,
    as_integer,
    is_lanes,
    number,
)

__all__ = [
    "choose",
    "floor",
    "greatest",
    "larger",
    "nearest",
    "root",
    "smaller",
    "spread",
    "summed",
    "traced",
    "whole",
]

F = TypeVar("F", bound=Callable[..., Any])


def _stand_in(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """What a traced function sees of an argument."""
    named = isinstance(kind, types.BaseNamedTuple)
    if isinstance(kind, types.BaseTuple):
        kinds: Any = kind
        values = cgutils.unpack_tuple(builder, value, len(kinds))
        items = [_stand_in(context, builder, *x) for x in zip(kinds, values, strict=True)]
        named = getattr(kind, "instance_class", None)
        return named(*items) if named else tuple(items)
    if isinstance(kind, types.Array):
        return Table(context, builder, value, kind)
    if isinstance(kind, types.CPointer):
        return Address(builder, value, kind.dtype)
    if isinstance(kind, types.Boolean):
        return Truth(builder, value)
    return number(builder, value, kind)


def _kind_of(result: Any) -> Any:
    """Numba type of what a traced function returned."""
    if isinstance(result, tuple):
        kinds = [_kind_of(part) for part in result]
        named = type(result) if hasattr(result, "_fields") else None
        return types.BaseTuple.from_types(kinds, named)
    if is_lanes(result):
        raise TypingError("lanes do not leave traced functions")
    if isinstance(result, Address):
        return types.CPointer(result.dtype)
    if result is None:
        return types.none
    if isinstance(result, (bool, Truth)):
        return types.boolean
    return types.int64 if isinstance(result, (int, Whole)) else types.float64


def _value_of(context: Any, builder: Any, result: Any, kind: Any) -> Any:
    if isinstance(result, tuple):
        parts = [_value_of(context, builder, part, k) for part, k in zip(result, kind, strict=True)]
        return context.make_tuple(builder, kind, parts)
    if result is None:
        return context.get_dummy_value()
    if isinstance(result, (Real, Whole, Truth, Address)):
        return result.value
    return context.get_constant(kind, result)


def _outlined(function: Callable[..., Any], kinds: tuple[Any, ...]) -> Any:
    """Type of the result: the function is run beside the kernel, and what it writes is dropped."""
    target: Any = cpu_target
    context = target.target_context
    shape = ir.FunctionType(ir.VoidType(), [context.get_value_type(kind) for kind in kinds])
    scratch = ir.Function(ir.Module(context=ir.Context()), shape, "scratch")
    builder = ir.IRBuilder(scratch.append_basic_block())
    pairs = zip(kinds, scratch.args, strict=True)
    return _kind_of(function(*(_stand_in(context, builder, *pair) for pair in pairs)))


def traced(function: F) -> F:
    """Let kernels call ``function``, which is run to compile it; called from Python it stays plain.

    Its arguments and results are doubles, integers, tuples and named tuples of them; arguments
    may be arrays and addresses too.
    """
    known: dict[tuple[Any, ...], Any] = {}

    @infer
    class _Typing(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            kinds = tuple(types.unliteral(kind) for kind in args)
            if kinds not in known:
                known[kinds] = signature(_outlined(function, kinds), *kinds)
            return known[kinds]

    infer_global(function, types.Function(_Typing))

    @lower_builtin(function, types.VarArg(types.Any))
    def _code(context: Any, builder: Any, of: Any, values: Any) -> Any:
        pairs = zip(of.args, values, strict=True)
        result = function(*(_stand_in(context, builder, *pair) for pair in pairs))
        return _value_of(context, builder, result, of.return_type)

    return function


@traced
def whole(x: Any) -> Any:
    """An integer as such, whatever array it comes from; of a double, what is before the point."""
    if isinstance(x, Real):
        return Whole(x.builder, x.builder.fptosi(x.value, lanes.SIZE))
    return x if isinstance(x, Whole) else int(x)


@traced
def choose(condition: Any, one: Any, two: Any) -> Any:
    """``one`` where the condition holds, else ``two``; both are computed."""
    if not isinstance(condition, Truth):
        return one if condition else two
    builder = condition.builder
    if all(isinstance(x, (int, Whole)) for x in (one, two)):
        return Whole(builder, builder.select(condition.value, as_integer(one), as_integer(two)))
    a, b = as_double(builder, one), as_double(builder, two)
    if condition.value.type != ir.IntType(1):
        a, b = lanes.spread(builder, a), lanes.spread(builder, b)
    return Real(builder, builder.select(condition.value, a, b))


@traced
def larger(a: Any, b: Any) -> Any:
    """The larger of two numbers, lane by lane."""
    return choose(a > b, a, b)


@traced
def smaller(a: Any, b: Any) -> Any:
    """The smaller of two numbers, lane by lane."""
    return choose(a < b, a, b)


@traced
def root(x: Any) -> Any:
    """Square root."""
    return x.call("sqrt") if isinstance(x, Real) else math.sqrt(x)


@traced
def floor(x: Any) -> Any:
    """Largest whole number that is not above x, as a double."""
    return x.call("floor") if isinstance(x, Real) else float(math.floor(x))


@traced
def nearest(x: Any) -> Any:
    """Nearest whole number, as a double; the even one of two."""
    return x.call("rint") if isinstance(x, Real) else float(round(x))


def spread(x: Any) -> Any:
    """The same number in every lane, while a function is traced."""
    return Real(x.builder, lanes.spread(x.builder, x.value))


def summed(x: Any) -> Any:
    """Sum over the lanes; a number as it is."""
    return _folded(x, lambda a, b: a + b) if is_lanes(x) else x


def greatest(x: Any) -> Any:
    """Maximum over the lanes; a number as it is."""
    return _folded(x, larger) if is_lanes(x) else x


def _folded(x: Real, join: Callable[[Real, Real], Real]) -> Real:
    builder = x.builder
    found = lanes.fold(
        builder, x.value, lambda a, b: join(Real(builder, a), Real(builder, b)).value
    )
    return Real(builder, found)
