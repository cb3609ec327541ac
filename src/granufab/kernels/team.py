"""Threads that solve one step together: atomic counters and a barrier.

Every member runs the same kernel without the interpreter lock and knows its number; they meet at
barriers. Where the system can be asked to, a member that waits long gives its processor away, so
more members than processors are slow, not stuck.
"""

from __future__ import annotations

import os
from typing import Any

from llvmlite import ir
from numba import types

from granufab.kernels.options import inlined, intrinsic, part

__all__ = ["COUNTERS", "GIVE_UP", "given_up", "meet"]

COUNTERS = 32
"""Length of the array of counters (int64) that a team shares; the used ones lie far apart."""

ARRIVED, ROUND, GIVE_UP = 0, 16, 24
PATIENCE = 2000


def _counter(context: Any, builder: Any, kind: Any, array: Any, place: Any) -> Any:
    return builder.gep(context.make_array(kind)(context, builder, array).data, [place])


@intrinsic
def _read(typing_context, array, place):
    def code(context, builder, signature, values):
        pointer = _counter(context, builder, signature.args[0], *values)
        return builder.load_atomic(pointer, "seq_cst", 8)

    return types.int64(array, place), code


@intrinsic
def _write(typing_context, array, place, value):
    def code(context, builder, signature, values):
        pointer = _counter(context, builder, signature.args[0], *values[:2])
        builder.store_atomic(values[2], pointer, "seq_cst", 8)
        return context.get_dummy_value()

    return types.none(array, types.intp, types.int64), code


@intrinsic
def _increase(typing_context, array, place):
    """Add one; returns the value before."""

    def code(context, builder, signature, values):
        pointer = _counter(context, builder, signature.args[0], *values)
        one = ir.Constant(ir.IntType(64), 1)
        return builder.atomic_rmw("add", pointer, one, "seq_cst")

    return types.int64(array, place), code


if os.name == "posix":
    _yield_processor: Any = types.ExternalFunction("sched_yield", types.int32())
else:

    @inlined
    def _yield_processor():
        """No such call here: keep looking."""


@inlined
def given_up(counters):
    """Whether somebody wrote ``counters[GIVE_UP]``: a member is missing, the others are to end."""
    return _read(counters, GIVE_UP) != 0


@part
def meet(counters, members):
    """Wait until all members are here; what each wrote before is seen by all after.

    Nobody waits once the team has given up.
    """
    if members == 1:
        return
    now = _read(counters, ROUND)
    if _increase(counters, ARRIVED) == members - 1:
        _write(counters, ARRIVED, 0)
        _increase(counters, ROUND)
        return
    waited = 0
    while _read(counters, ROUND) == now and not given_up(counters):
        waited += 1
        if waited > PATIENCE:
            _yield_processor()
