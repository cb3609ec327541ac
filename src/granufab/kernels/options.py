"""How every kernel is compiled.

``contract`` lets LLVM fuse multiply–add, ``nsz`` and ``nnan`` free the branch-free minimum and
maximum; so no kernel may rely on NaN: states are checked for it outside (``simulate.stepping``).
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

__all__ = ["ARITHMETIC", "cache_folder", "inlined", "intrinsic", "kernel", "part"]

F = TypeVar("F", bound=Callable[..., Any])
ARITHMETIC: dict[str, Any] = {"fastmath": {"contract", "nsz", "nnan"}, "error_model": "numpy"}


def cache_folder() -> str:
    """Where compiled kernels lie: in NUMBA_CACHE_DIR or a user cache folder.

    The folder's name holds a hash of the kernels' text.

    Numba notices a change only in the file that holds a function, not in those it inlines, so
    a new version of the package must never meet kernels compiled from an older one.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    base = Path(home) if home else Path.home() / ".cache"
    base = Path(os.environ.get("NUMBA_CACHE_DIR") or base / "granufab")
    text = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        text.update(path.read_bytes())
    name = f"kernels-{text.hexdigest()[:16]}"
    try:
        (base / name).mkdir(parents=True, exist_ok=True)
    except OSError:  # no home to write in: the kernels are then compiled once per machine start
        return str(Path(tempfile.gettempdir()) / "granufab" / name)
    return str(base / name)


config.CACHE_DIR = cache_folder()  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile ``function`` with the package's options, cached on disk, releasing the GIL."""
    compiled: Any = njit(cache=True, nogil=True, no_cfunc_wrapper=True, **ARITHMETIC)(function)
    return compiled


def part(function: F) -> F:
    """Compile ``function`` where kernels call it; called from Python it stays plain text."""
    return _part(**ARITHMETIC)(function)


def inlined(function: F) -> F:
    """Compile ``function`` into the kernels that call it; called from Python it stays plain text."""
    return _part(**ARITHMETIC, forceinline=True)(function)


def _part(**options: Any) -> Any:
    register: Any = extending.register_jitable
    return register(no_cfunc_wrapper=True, nogil=True, **options)


intrinsic: Any = extending.intrinsic
"""A function of kernels written in LLVM's language."""
