"""How every kernel is compiled.

``contract`` lets LLVM fuse multiply–add, ``nsz`` and ``nnan`` free the branch-free minimum and
maximum; so no kernel may rely on NaN: states are checked for it outside (``state_check``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

__all__ = ["ARITHMETIC", "kernel"]

F = TypeVar("F", bound=Callable[..., Any])
ARITHMETIC: dict[str, Any] = {"fastmath": {"contract", "nsz", "nnan"}, "error_model": "numpy"}


def kernel(function: F) -> F:
    """Compile ``function`` with the package's options, cached on disk, releasing the GIL."""
    return njit(cache=True, nogil=True, **ARITHMETIC)(function)
