"""What the numbers were measured on: processor, instruction sets, versions."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from granufab.bench.reference import Reference
from granufab.io.provenance import cpu_name

__all__ = ["describe_machine", "describe_versions"]

PACKAGES = ("granufab", "numpy", "scipy", "numba", "llvmlite")
VECTOR_SETS = ("sse2", "sse4.2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")


def describe_machine() -> dict[str, Any]:
    """Processor, cores, and the vector instruction sets that numba compiles for."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    affinity = getattr(os, "sched_getaffinity", None)
    return {
        "processor": cpu_name(),
        "architecture": platform.machine(),
        "system": platform.system(),
        "cores": os.cpu_count(),
        "usable_cores": len(affinity(0)) if affinity else os.cpu_count(),
        "llvm_name": binding.get_host_cpu_name(),
        "vector_sets": [name for name in VECTOR_SETS if features.get(name)],
    }


def describe_versions(reference: Reference | None) -> dict[str, Any]:
    """Versions of granufab, Python, numerical packages, LLVM and the compiler of the reference."""
    found: dict[str, Any] = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    found["llvm"] = _llvm()
    found["compiler"] = reference.compiler if reference else None
    found["compiler_flags"] = " ".join(reference.flags) if reference else None
    return found


def _llvm() -> str:
    from llvmlite import binding

    return ".".join(str(number) for number in binding.llvm_version_info)
