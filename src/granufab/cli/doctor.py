"""``granufab doctor``: what granufab runs on, and whether it computes what it should."""

from __future__ import annotations

import os
import platform
import time
from pathlib import Path
from typing import Annotated, Any

import typer

__all__ = ["doctor"]

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "h5py", "xarray", "matplotlib", "pydantic")
CHECK_GRAINS = 40
PRESSURE_ERROR_ALLOWED = 1e-3
CONTACT_ERROR_ALLOWED = 2


def doctor(
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
) -> None:
    """Print versions, threads, CPU features and compile cache, and run a short self-check."""
    from granufab.cli.output import print_json, print_pairs

    report = {
        "versions": _versions(),
        "platform": platform.platform(),
        "threads": _threads(),
        "cpu": _cpu(),
        "compile_cache": _compile_cache(),
        "self_check": _self_check(),
    }
    if json:
        print_json(report)
    else:
        for title, values in report.items():
            pairs = values if isinstance(values, dict) else {"": values}
            print_pairs(title.replace("_", " "), [(f"  {k}", _words(v)) for k, v in pairs.items()])
    if not report["self_check"]["passed"]:
        raise typer.Exit(1)


def _words(value: Any) -> Any:
    return " ".join(value) if isinstance(value, list) else value


def _versions() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    import granufab

    found = {"granufab": granufab.__version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    return found


def _threads() -> dict[str, Any]:
    from numba.core import config

    return {
        "cores": os.cpu_count(),
        "usable": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None,
        "numba": vars(config)["NUMBA_NUM_THREADS"],
    }


def _cpu() -> dict[str, Any]:
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    return {
        "name": binding.get_host_cpu_name(),
        "features": sorted(name for name, present in features.items() if present),
    }


def _compile_cache() -> dict[str, Any]:
    """Where numba keeps compiled kernels, and what lies there."""
    from granufab.kernels.options import cache_folder

    folder = Path(cache_folder())
    compiled = list(folder.rglob("*.nbc")) if folder.is_dir() else []
    return {
        "folder": str(folder),
        "set_by": "NUMBA_CACHE_DIR" if os.environ.get("NUMBA_CACHE_DIR") else "default",
        "writable": os.access(_existing(folder), os.W_OK),
        "compiled": len(compiled),
        "megabytes": sum(path.stat().st_size for path in compiled) / 1e6,
    }


def _existing(folder: Path) -> Path:
    return folder if folder.exists() or folder == folder.parent else _existing(folder.parent)


def _self_check() -> dict[str, Any]:
    """Compact a few frictionless disks and count their contacts.

    A packing without friction that can only dilate is isostatic:
    N_c = 2 N_b − 2 + 1 contacts among N_b grains that carry force, at mean stress p.
    """
    import granufab
    from granufab.errors import GranufabError
    from granufab.fabric import select_network, stress_tensor

    began = time.perf_counter()
    try:
        packing = granufab.compress(granufab.random_sample(CHECK_GRAINS, seed=7), friction=0.0)
        network = select_network(packing, criterion="force", z_definition="z_backbone")
        pressure = float(stress_tensor(packing).trace()) / packing.dimension
    except GranufabError as error:
        return {"passed": False, "error": str(error), "seconds": time.perf_counter() - began}
    contacts, expected = network.contacts.count, 2 * network.grain_count - 1
    isostatic = abs(contacts - expected) <= CONTACT_ERROR_ALLOWED
    return {
        "passed": isostatic and abs(pressure - 1.0) < PRESSURE_ERROR_ALLOWED,
        "what": f"frictionless compaction of {CHECK_GRAINS} disks at p = 1",
        "grains_in_network": network.grain_count,
        "contacts": contacts,
        "contacts_expected": expected,
        "pressure": pressure,
        "seconds": time.perf_counter() - began,
    }
