"""Stand-ins for numbers, lanes, addresses and arrays, whose operators write instructions.

A traced function (:mod:`granufab.kernels.tracing`) is run on them while a kernel is compiled.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError

from granufab.kernels import lanes
from granufab.kernels.lanes import DOUBLE, LANES, SIZE, WIDTH
from granufab.kernels.options import ARITHMETIC

__all__ = [
    "Address",
    "Real",
    "Rows",
    "Table",
    "Truth",
    "Whole",
    "as_double",
    "as_integer",
    "is_lanes",
    "number",
]

_FLAGS = tuple(sorted(ARITHMETIC["fastmath"]))


class Real:
    """Stands for a double, or for eight."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    @property
    def wide(self) -> bool:
        """Whether it stands for lanes."""
        return self.value.type == LANES

    def _pair(self, other: Any) -> tuple[Any, Any]:
        mine, their = self.value, as_double(self.builder, other)
        if LANES in (mine.type, their.type):
            return lanes.spread(self.builder, mine), lanes.spread(self.builder, their)
        return mine, their

    def _with(self, name: str, other: Any, *, turned: bool = False) -> Real:
        one, two = self._pair(other)
        if turned:
            one, two = two, one
        return Real(self.builder, getattr(self.builder, name)(one, two, flags=_FLAGS))

    def _compare(self, sign: str, other: Any) -> Truth:
        one, two = self._pair(other)
        return Truth(self.builder, self.builder.fcmp_ordered(sign, one, two, flags=_FLAGS))

    def call(self, name: str) -> Real:
        """LLVM's own function of that name."""
        kind = self.value.type
        suffix = f"v{WIDTH}f64" if self.wide else "f64"
        function = cgutils.get_or_insert_function(
            self.builder.module, ir.FunctionType(kind, [kind]), f"llvm.{name}.{suffix}"
        )
        return Real(self.builder, self.builder.call(function, [self.value], fastmath=_FLAGS))

    def __add__(self, other: Any) -> Real:
        return self._with("fadd", other)

    def __radd__(self, other: Any) -> Real:
        if isinstance(other, int) and other == 0:  # where sum() begins
            return self
        return self._with("fadd", other, turned=True)

    def __sub__(self, other: Any) -> Real:
        return self._with("fsub", other)

    def __rsub__(self, other: Any) -> Real:
        return self._with("fsub", other, turned=True)

    def __mul__(self, other: Any) -> Real:
        return self._with("fmul", other)

    def __rmul__(self, other: Any) -> Real:
        return self._with("fmul", other, turned=True)

    def __truediv__(self, other: Any) -> Real:
        return self._with("fdiv", other)

    def __rtruediv__(self, other: Any) -> Real:
        return self._with("fdiv", other, turned=True)

    def __pow__(self, power: int) -> Real:
        if power != 2:
            raise TypingError("traced functions know squares only")
        return self * self

    def __neg__(self) -> Real:
        return Real(self.builder, self.builder.fneg(self.value, flags=_FLAGS))

    def __abs__(self) -> Real:
        return self.call("fabs")

    def __lt__(self, other: Any) -> Truth:
        return self._compare("<", other)

    def __le__(self, other: Any) -> Truth:
        return self._compare("<=", other)

    def __gt__(self, other: Any) -> Truth:
        return self._compare(">", other)

    def __ge__(self, other: Any) -> Truth:
        return self._compare(">=", other)


class Truth:
    """Stands for a truth value, or for eight; an ``if`` cannot ask it."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def __bool__(self) -> bool:
        raise TypingError("a traced function cannot branch on its numbers: use choose")


class Whole:
    """Stands for an integer."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def __add__(self, other: Any) -> Whole:
        if isinstance(other, Real):
            return NotImplemented
        return Whole(self.builder, self.builder.add(self.value, as_integer(other)))

    def __mul__(self, other: Any) -> Whole:
        if isinstance(other, Real):
            return NotImplemented
        return Whole(self.builder, self.builder.mul(self.value, as_integer(other)))

    __radd__, __rmul__ = __add__, __mul__

    def _compare(self, sign: str, other: Any) -> Truth:
        answer = self.builder.icmp_signed(sign, self.value, as_integer(other))
        return Truth(self.builder, answer)

    def __lt__(self, other: Any) -> Truth:
        return self._compare("<", other)

    def __gt__(self, other: Any) -> Truth:
        return self._compare(">", other)


class Address:
    """Stands for the place where the numbers of an array begin."""

    __slots__ = ("builder", "dtype", "value")

    def __init__(self, builder: Any, value: Any, dtype: Any) -> None:
        self.builder, self.value, self.dtype = builder, value, dtype

    def __getitem__(self, place: Any) -> Any:
        return _loaded(self.builder, self._item(place), self.dtype)

    def __setitem__(self, place: Any, value: Any) -> None:
        self.builder.store(as_double(self.builder, value), self._item(place))

    def _item(self, place: Any) -> Any:
        return lanes.item_of(self.builder, self.value, as_integer(place))

    def lanes(self, place: Any) -> Real:
        """Eight neighbouring numbers."""
        return Real(self.builder, lanes.load_lanes(self.builder, self.value, as_integer(place)))

    def put_lanes(self, place: Any, value: Real) -> None:
        """Write eight neighbouring numbers."""
        lanes.store_lanes(self.builder, self.value, as_integer(place), value.value)

    def move_on(self, before: Address, place: Any, width: int, factor: Any) -> None:
        """See :func:`lanes.move_on`."""
        factor = as_double(self.builder, factor)
        lanes.move_on(self.builder, self._item(place), before._item(place), width, factor, _FLAGS)

    def rows(self, index: Address, place: Any, width: int) -> Rows:
        """The eight rows of this table that an index names at ``place``."""
        found = lanes.rows_of(self.builder, self.value, index.value, as_integer(place), width)
        return Rows(self.builder, found)

    def prefetch(self, place: Any) -> None:
        """Ask for the cache line of an item."""
        lanes.prefetch(self.builder, self._item(place))


class Rows:
    """Stands for eight rows of a table."""

    __slots__ = ("builder", "pointers")

    def __init__(self, builder: Any, pointers: list[Any]) -> None:
        self.builder, self.pointers = builder, pointers

    def gather(self) -> tuple[Real, ...]:
        """Their columns, see :func:`lanes.gather`."""
        columns = lanes.gather(self.builder, self.pointers)
        return tuple(Real(self.builder, column) for column in columns)

    def scatter(self, columns: tuple[Real, ...]) -> None:
        """Write what :meth:`gather` read."""
        lanes.scatter(self.builder, self.pointers, [column.value for column in columns])

    def prefetch(self) -> None:
        """Ask for what :meth:`gather` reads, ahead of its use."""
        for pointer in self.pointers:
            lanes.prefetch(self.builder, pointer)


class Table:
    """Stands for an array."""

    __slots__ = ("array", "builder", "context", "kind")

    def __init__(self, context: Any, builder: Any, value: Any, kind: Any) -> None:
        self.context, self.builder, self.kind = context, builder, kind
        self.array = context.make_array(kind)(context, builder, value)

    def _item(self, key: Any) -> Any:
        places = [as_integer(k) for k in (key if isinstance(key, tuple) else (key,))]
        return cgutils.get_item_pointer(
            self.context, self.builder, self.kind, self.array, places, wraparound=False
        )

    def __getitem__(self, key: Any) -> Any:
        return _loaded(self.builder, self._item(key), self.kind.dtype)

    def __setitem__(self, key: Any, value: Any) -> None:
        self.builder.store(as_double(self.builder, value), self._item(key))

    def reshape(self, shape: int) -> Address:
        """One line of numbers."""
        if self.kind.layout != "C" or shape != -1:
            raise TypingError("an address is of an array whose rows follow one another")
        return Address(self.builder, self.array.data, self.kind.dtype)


def as_double(builder: Any, x: Any) -> Any:
    """The double, or eight, behind a number."""
    if isinstance(x, Real):
        return x.value
    if isinstance(x, Whole):
        return builder.sitofp(x.value, DOUBLE)
    return ir.Constant(DOUBLE, float(x))


def as_integer(x: Any) -> Any:
    """The integer behind a number."""
    return x.value if isinstance(x, Whole) else ir.Constant(SIZE, int(x))


def _loaded(builder: Any, pointer: Any, dtype: Any) -> Any:
    return number(builder, builder.load(pointer), dtype)


def number(builder: Any, value: Any, kind: Any) -> Any:
    """Stand-in of a number of a numba type."""
    if kind == types.float64:
        return Real(builder, value)
    if isinstance(kind, types.Integer):
        if value.type.width < SIZE.width:
            value = (builder.zext if kind in types.unsigned_domain else builder.sext)(value, SIZE)
        return Whole(builder, value)
    raise TypingError(f"a traced function takes doubles and integers, not {kind}")


def is_lanes(x: Any) -> bool:
    """Whether x stands for eight numbers."""
    return isinstance(x, Real) and x.wide
