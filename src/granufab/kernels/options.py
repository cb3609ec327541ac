"""How every kernel is compiled.

``contract`` lets LLVM fuse multiply–add, ``nsz`` and ``nnan`` free the branch-free minimum and
maximum; so no kernel may rely on NaN: states are checked for it as integers
(``kernels.outcome``).
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from numba import extending, njit
from numba.core import config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

__all__ = [
    "ARITHMETIC",
    "cache_folder",
    "inlined",
    "intrinsic",
    "kernel",
    "kernels_hash",
    "part",
    "steady",
]

F = TypeVar("F", bound=Callable[..., Any])
ARITHMETIC: dict[str, Any] = {"fastmath": {"contract", "nsz", "nnan"}, "error_model": "numpy"}


def kernels_hash() -> str:
    """Hash of the kernels' text."""
    text = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        text.update(path.read_bytes())
    return text.hexdigest()[:16]


def cache_folder() -> str:
    """Where compiled kernels lie: in NUMBA_CACHE_DIR or a user cache folder.

    The folder's name holds a hash of the kernels' text.

    Numba notices a change only in the file that holds a function, not in those it inlines, so
    a new version of the package must never meet kernels compiled from an older one.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    base = Path(home) if home else Path.home() / ".cache"
    base = Path(os.environ.get("NUMBA_CACHE_DIR") or base / "granufab")
    name = f"kernels-{kernels_hash()}"
    try:
        (base / name).mkdir(parents=True, exist_ok=True)
    except OSError:  # no home to write in: the kernels are then compiled once per machine start
        return str(Path(tempfile.gettempdir()) / "granufab" / name)
    return str(base / name)


config.CACHE_DIR = cache_folder()  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile ``function`` with the package's options, cached on disk, releasing the GIL."""
    compiled: Any = njit
    return compiled(cache=True, nogil=True, no_cfunc_wrapper=True, **ARITHMETIC)(function)


def part(function: F) -> F:
    """Compile ``function`` where kernels call it; called from Python it stays plain text."""
    register: Any = extending.register_jitable
    return register(nogil=True, no_cfunc_wrapper=True, pipeline_class=_PartCompiler, **ARITHMETIC)(
        function
    )


def inlined(function: F) -> F:
    """As :func:`part`, and the kernels that call it hold a copy."""
    register: Any = extending.register_jitable
    return register(
        nogil=True,
        no_cfunc_wrapper=True,
        pipeline_class=_PartCompiler,
        forceinline=True,
        **ARITHMETIC,
    )(function)


class _NoEnvironment:
    """Parts have no entry point of their own, so none of what Python would need there."""

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing to set."""


class _PartLibrary(JITCodeLibrary):
    """Code that is optimised and made to run only in the kernels it is linked into.

    Numba does both for every function on its own first, and throws it away.
    """

    codegen = _NoEnvironment()  # type: ignore[assignment]

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """None: only kernels call it."""
        self._ensure_finalized()
        return 0


class _PartCompiler(Compiler):
    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing, target, _PartLibrary(target.codegen(), "part"), *rest)


intrinsic: Any = extending.intrinsic
"""A function of kernels written in LLVM's language."""


def steady(function: F) -> F:
    """As :func:`kernel`, for functions that allocate nothing: no references are counted."""
    compiled: Any = njit
    return compiled(cache=True, nogil=True, no_cfunc_wrapper=True, _nrt=False, **ARITHMETIC)(
        function
    )
