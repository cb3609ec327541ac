"""The time, as kernels read it: for the profile of a step and to return now and then."""

from __future__ import annotations

import os
import time
from typing import Any

from numba import extending, types

from granufab.kernels.options import ARITHMETIC

__all__ = ["nanoseconds"]

_overload: Any = extending.overload


def nanoseconds(memory):
    """Time of a clock that only moves forward [ns]; 0 where the system has no such call.

    Args:
        memory: two numbers to write in (int64).
    """
    return time.monotonic_ns()


if os.name == "posix":
    _clock_gettime: Any = types.ExternalFunction(
        "clock_gettime", types.int32(types.int32, types.voidptr)
    )
    _CLOCK = time.CLOCK_MONOTONIC


@_overload(nanoseconds, jit_options=ARITHMETIC)
def _nanoseconds(memory):
    if os.name != "posix":
        return lambda memory: 0

    def read(memory):
        _clock_gettime(_CLOCK, memory.ctypes)
        return memory[0] * 1_000_000_000 + memory[1]

    return read
