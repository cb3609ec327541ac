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

from granufab.bench.engine import Streams

__all__ = ["COMPILERS", "Reference", "reference"]

COMPILERS = ("c++", "g++", "clang++")
FLAGS = ("-O3", "-ffp-contract=fast", "-fno-math-errno", "-shared", "-fPIC", "-std=c++14")
NATIVE = (("-march=native",), ("-mcpu=native",), ())
SOURCE = Path(__file__).with_name("reference.cpp")
COMPILE_SECONDS = 120


class _Problem(ctypes.Structure):
    """Mirrors ``struct Problem`` of ``reference.cpp`` and :class:`Streams`, field by field."""

    _fields_ = [
        ("count", ctypes.c_int64),
        ("lag", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("first", "second", "normal", "length")),
        *(
            (name, ctypes.c_void_p)
            for name in ("offset_n", "offset_t", "mu", "inverse_n", "inverse_t")
        ),
        *((name, ctypes.c_double) for name in ("eps", "kappa", "w_cell")),
        *((name, ctypes.c_void_p) for name in ("motion", "impulse_n", "impulse_t")),
        *((name, ctypes.c_void_p) for name in ("before_n", "before_t")),
        ("beta", ctypes.c_double),
        ("dilation", ctypes.c_void_p),
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

    def sweep(self, streams: Streams, sweeps: int) -> float:
        """Make ``sweeps`` sweeps in place; returns the seconds they took."""
        problem = _Problem(*(x.ctypes.data if isinstance(x, np.ndarray) else x for x in streams))
        disks = streams.normal.shape[1] == 2
        function = self.library.sweep_2d if disks else self.library.sweep_3d
        began = time.perf_counter()
        function(ctypes.byref(problem), ctypes.c_int64(sweeps))
        return time.perf_counter() - began


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
