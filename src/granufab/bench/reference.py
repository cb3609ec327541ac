"""The C++ reference sweep: compiled on the spot where a compiler is, called through ctypes."""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from granufab.bench.engine import Case

__all__ = ["COMPILERS", "Reference", "reference"]

COMPILERS = ("c++", "g++", "clang++")
FLAGS = ("-O3", "-ffp-contract=fast", "-fno-math-errno", "-shared", "-fPIC", "-std=c++14")
NATIVE = (("-march=native",), ("-mcpu=native",), ())
SOURCE = Path(__file__).with_name("reference.cpp")
COMPILE_SECONDS = 120


class _Problem(ctypes.Structure):
    """Mirrors ``struct Problem`` of ``reference.cpp``."""

    _fields_ = [
        ("count", ctypes.c_int64),
        ("lag", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("first", "second", "normal", "length")),
        *((name, ctypes.c_void_p) for name in ("offset_n", "offset_t", "mu")),
        *((name, ctypes.c_double) for name in ("eps", "kappa", "w_cell")),
        *((name, ctypes.c_void_p) for name in ("motion", "impulse_n", "impulse_t", "dilation")),
    ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """The compiled reference.

    Attributes:
        library: what ctypes loaded.
        compiler: first line of the compiler's ``--version``.
        flags: what it was called with.
    """

    library: Any
    compiler: str
    flags: tuple[str, ...]

    def sweep(self, case: Case, sweeps: int) -> float:
        """Make ``sweeps`` sweeps of a case in place; returns the seconds they took."""
        problem, keep = _problem(case)
        function = self.library.sweep_2d if case.dimension == 2 else self.library.sweep_3d
        began = time.perf_counter()
        function(ctypes.byref(problem), ctypes.c_int64(sweeps))
        seconds = time.perf_counter() - began
        np.fill_diagonal(case.state.rate, keep[-1])
        return seconds


def _problem(case: Case) -> tuple[_Problem, list[np.ndarray]]:
    """The case as the reference reads it, and the arrays that must outlive the call."""
    p, s = case.problem, case.state
    if p.coupled:
        raise ValueError("the reference sweeps problems whose only free component is the dilation")
    bodies = [np.ascontiguousarray(index, dtype=np.int32) for index in (p.first, p.second)]
    streams = [p.normal, p.length, p.offset_n, p.offset_t, p.mu]
    changed = [s.motion, s.impulse_n, s.impulse_t, np.array([s.rate[0, 0]])]
    arrays = [*bodies, *streams, *changed]
    if not all(array.flags.c_contiguous for array in arrays):
        raise ValueError("the reference reads contiguous arrays")
    address = [array.ctypes.data for array in arrays]
    numbers = (p.softness, p.spin_factor, p.dilation_weight)
    count = len(p.length)
    return _Problem(count, case.lag, *address[:7], *numbers, *address[7:]), arrays


@cache
def reference() -> Reference | None:
    """Compile and load the reference, once in a process; None where no compiler can.

    ``$CXX`` is tried first, then the usual names.
    """
    for command in _compilers():
        for native in NATIVE:
            flags = (*FLAGS[:1], *native, *FLAGS[1:])
            library = _compile(command, flags)
            if library is not None:
                return Reference(library=library, compiler=_version(command), flags=flags)
    return None


def _compilers() -> list[list[str]]:
    given = shlex.split(os.environ.get("CXX", ""))
    wanted = [given] if given else []
    wanted += [[name] for name in COMPILERS]
    return [command for command in wanted if shutil.which(command[0])]


def _compile(command: list[str], flags: tuple[str, ...]) -> Any:
    with tempfile.TemporaryDirectory(
        prefix="granufab-bench-", ignore_cleanup_errors=True
    ) as folder:
        target = Path(folder) / "reference.so"
        try:
            done = subprocess.run(
                [*command, *flags, str(SOURCE), "-o", str(target)],
                capture_output=True,
                timeout=COMPILE_SECONDS,
            )
            if done.returncode != 0:
                return None
            library = ctypes.CDLL(str(target))
        except (OSError, subprocess.TimeoutExpired):
            return None
    for name in ("sweep_2d", "sweep_3d"):
        getattr(library, name).restype = ctypes.c_double
    return library


def _version(command: list[str]) -> str:
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=30)
    return (done.stdout or " ".join(command)).strip().splitlines()[0]
