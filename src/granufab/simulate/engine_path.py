"""Which engine made some bits: version, text of the kernels, processor, width of the sweep."""

from __future__ import annotations

import hashlib
from importlib import metadata

from llvmlite import binding

from granufab.kernels.options import kernels_hash
from granufab.simulate.contact_solver import wide_by_default

__all__ = ["engine_path"]


def engine_path() -> dict[str, str]:
    """What two runs must share to give the same bits; the number of threads is no part of it.

    Returns:
        By name: versions of granufab, numba and llvmlite, hash of the kernels' text, the processor
        that the kernels are compiled for, and whether eight contacts are updated at once.
    """
    features = binding.get_host_cpu_features().flatten()
    return {
        "granufab": _version("granufab"),
        "numba": _version("numba"),
        "llvmlite": _version("llvmlite"),
        "kernels": kernels_hash(),
        "cpu": f"{binding.get_host_cpu_name()} {hashlib.sha256(features.encode()).hexdigest()[:8]}",
        "lanes": "8" if wide_by_default() else "1",
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
