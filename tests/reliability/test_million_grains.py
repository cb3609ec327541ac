"""Memory of many grains: what a million disks take, and that the preflight promises no less."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from granufab.simulate.demand import FIXED_BYTES, GRAIN_BYTES

SOURCE = Path(__file__).parents[2] / "src"
COMPACTION = """
import re, sys
from granufab.simulate import Isotropic, Material, Simulation, Solver, random_sample
from granufab.simulate.preparation import RATE_CAP

def peak():
    return 1024 * int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])

def compacted(count, dimension, steps):
    fast = Solver(tolerance=1e-3, stiffness=float("inf"), time_step=0.1, max_sweeps=3000)
    simulation = Simulation(
        random_sample(count, dimension=dimension, seed=1),
        Isotropic(pressure=1.0, dimension=dimension),
        material=Material(friction=0.3),
        solver=fast,
    )
    simulation.rate_cap = RATE_CAP / simulation.scales.time
    made = 0
    while made < steps:
        made += len(simulation.advance(min(50, steps - made)))
    return simulation

count, dimension, steps = map(int, sys.argv[1:])
compacted(200, dimension, 5)
base = peak()
simulation = compacted(count, dimension, steps)
print(base, peak(), simulation.candidates.count / count, simulation.searches)
"""


def _peak(count: int, dimension: int, steps: int, tell: Callable[..., None]) -> float:
    """Memory of a grain at the largest moment, above that of the process before [bytes]."""
    done = subprocess.run(
        [sys.executable, "-c", COMPACTION, str(count), str(dimension), str(steps)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(SOURCE), "GRANUFAB_THREADS": "1"},
    )
    base, peak, pairs, searches = map(float, done.stdout.split())
    grain = (peak - base) / count
    tell(grains=count, dimension=dimension, steps=steps, bytes=grain, base=base, searches=searches)
    assert pairs > 1
    return grain


needs_proc = pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="memory is read from /proc"
)


@needs_proc
@pytest.mark.parametrize(("dimension", "count"), [(2, 20_000), (3, 6_000)])
def test_the_preflight_promises_no_less_than_compaction_takes(
    dimension: int, count: int, tell: Callable[..., None]
) -> None:
    grain = _peak(count, dimension, 60, tell)
    assert grain * count < FIXED_BYTES + GRAIN_BYTES[dimension] * count
    assert grain > 300, "less than positions, contacts and slots can take"


@pytest.mark.slow
@needs_proc
def test_a_million_disks_stay_under_1200_bytes_a_grain(tell: Callable[..., None]) -> None:
    assert _peak(1_000_000, 2, 200, tell) < 1200


@pytest.mark.slow
@needs_proc
def test_a_hundred_thousand_spheres_stay_within_what_the_preflight_promises(
    tell: Callable[..., None],
) -> None:
    assert _peak(100_000, 3, 200, tell) < GRAIN_BYTES[3]
