"""What a result needs beside its settings to be made again: versions and machine."""

from __future__ import annotations

import platform
from importlib import metadata
from pathlib import Path

__all__ = ["cpu_name", "provenance"]

_PACKAGES = ("granufab", "numpy", "numba", "scipy", "h5py", "xarray")


def cpu_name() -> str:
    """The processor's name, or its architecture where the system does not tell."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    for line in text.splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model") and value.strip():
            return value.strip()
    return platform.processor() or platform.machine()


def provenance() -> dict[str, str]:
    """Versions of granufab, Python and the packages below it, platform and processor."""
    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return {
        **versions,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu": cpu_name(),
    }
