"""Wall times and memory of commands, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

LEAST_GROWTH = 1e7  # bytes; less says nothing beside what compiling took before
COMMAND = "from granufab.cli import main; main()"
FIRST_USE = """
import granufab.simulate as g
sample = g.compress(g.random_sample(50, seed=1), friction=0.3)
g.shear(sample, strain=1e-3, inertial_number=1e-2)
"""
STEPPING = """
import json, resource, sys
from granufab.bench.engine import Marching
from granufab.bench.problems import FRICTION, isotropic_state
from granufab.simulate import Isotropic
def peak():
    try:  # getrusage counts what the parent held when it started this process
        for line in open("/proc/self/status"):
            if line.startswith("VmHWM"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size * (1 if sys.platform == "darwin" else 1024)
warm = isotropic_state(80, source=20)
Marching(warm, Isotropic(), friction=FRICTION, tolerance=1e-4).step()
before = peak()
packing = isotropic_state(int(sys.argv[1]))
marching = Marching(packing, Isotropic(), friction=FRICTION, tolerance=1e-3)
for _ in range(3):
    cost = marching.step()
print(json.dumps({"contacts": cost.contacts, "peak": peak(), "before": before,
                  "grains": packing.grains.count}))
"""


def seconds_of(program: str, *arguments: str, cache: str | None = None) -> float:
    """Wall time of a Python program; ``cache`` is where numba keeps compiled kernels."""
    environment = dict(os.environ) if cache is None else {**os.environ, "NUMBA_CACHE_DIR": cache}
    began = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", program, *arguments],
        check=True, env=environment, capture_output=True,
    )  # fmt: skip
    return time.perf_counter() - began


def start_up() -> dict[str, float]:
    """``granufab --help``; 50 disks compacted and sheared with an empty compile cache and after."""
    with tempfile.TemporaryDirectory() as cache:
        first = seconds_of(FIRST_USE, cache=cache)
        cached = min(seconds_of(FIRST_USE, cache=cache) for _ in range(3))
    seconds_of(COMMAND, "--help")
    return {
        "help_seconds": min(seconds_of(COMMAND, "--help") for _ in range(3)),
        "import_seconds": min(seconds_of("import granufab.simulate") for _ in range(3)),
        "first_use_seconds": first,
        "cached_use_seconds": cached,
    }


def memory(grain_count: int) -> dict[str, Any]:
    """Peak memory of a process that steps a tiled isotropic state of disks."""
    done = subprocess.run(
        [sys.executable, "-c", STEPPING, str(grain_count)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    found = json.loads(done.stdout)
    grown = found["peak"] - found["before"]
    return {
        "grains": found["grains"],
        "contacts": found["contacts"],
        "peak_megabytes": found["peak"] / 1e6,
        "bytes_per_grain": grown / found["grains"] if grown > LEAST_GROWTH else None,
    }


def figure(arguments: list[str]) -> dict[str, Any]:
    """``granufab reproduce fig7`` with these arguments, compiled kernels at hand."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "fig7"
        seconds = seconds_of(COMMAND, "reproduce", "fig7", *arguments, "--out", str(out))
        solver = json.loads((out / "fig7.json").read_text())["solver"]
    names = ("residual_max", "tolerance", "nonconverged_steps", "contact_updates")
    return {
        "command": " ".join(["granufab reproduce fig7", *arguments]),
        "seconds": seconds,
        **{name: solver[name] for name in (*names, "inertial_number")},
    }
