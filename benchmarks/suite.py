"""The long benchmark: everything that ``granufab bench`` measures and more, over many sizes.

    python benchmarks/suite.py OUT [part …] [--sizes 5000 13000 …] [--steps 100] [--largest N]
    python benchmarks/pages.py benchmarks OUT

Parts: kernels, threads, problems (one step from a warm and from a cold start), consecutive (steps
from ε_q = 0.2), copies (one sample beside copies of a part), step (profile), curve (cost per
contact update), start, memory, figures. Each part's result is kept in OUT/benchmarks.json and not
measured again unless it is named; the states lie in OUT/states and serve the next version of the
engine too.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import commands
import numpy as np

import granufab
from granufab.bench.convergence import PLAIN_CAP, compare_solvers, profile_steps
from granufab.bench.kernel_speed import (
    isotropic_case,
    kernel_speed,
    thread_speed,
    update_costs,
)
from granufab.bench.machine import describe_machine, describe_versions
from granufab.bench.problems import (
    FRICTION,
    SHEARED_STRAIN,
    biaxial_loading,
    isotropic_state,
    sheared_state,
)
from granufab.bench.reference import reference
from granufab.fabric import stress_tensor
from granufab.history import Frame
from granufab.io import RunFileWriter, write_json
from granufab.packing import Packing
from granufab.simulate import Isotropic, Loading

SIZES = (5000, 13_000, 50_000, 200_000)
RESIDUALS = (1e-3, 1e-4, 1e-5, 1e-6)
CURVE = (1000, 2000, 5000, 13_000, 50_000, 200_000, 1_000_000)
MOST_SPHERES = 200_000
SOURCE = {"isotropic": 1300, "biaxial": 800}
FURTHER_STRAIN = 0.01


class Bench:
    """The options, the folder and the results so far."""

    def __init__(self, given: argparse.Namespace) -> None:
        self.out: Path = given.out
        self.sizes: list[int] = given.sizes
        self.steps: int = given.steps
        self.repetitions: int = given.repetitions
        self.largest: int = given.largest
        self.file = self.out / "benchmarks.json"
        self.results: dict[str, Any] = (
            json.loads(self.file.read_text()) if self.file.exists() else {}
        )

    def keep(self, part: str, result: Any) -> None:
        """Write the result of a part beside the others."""
        self.results[part] = result
        self.results["machine"] = describe_machine()
        self.results["versions"] = describe_versions(reference())
        write_json(self.results, self.file)

    def state(self, kind: str, grain_count: int) -> Packing:
        """An isotropic or biaxial state, made once."""
        path = self.out / "states" / f"{kind}-{grain_count}.h5"
        if not path.exists():
            make = isotropic_state if kind == "isotropic" else _sheared
            store(make(grain_count, source=SOURCE[kind]), kind, path)
        return granufab.read(path).frames[-1].packing


def _sheared(grain_count: int, *, source: int) -> Packing:
    return sheared_state(grain_count, source=source, further=FURTHER_STRAIN)


def store(packing: Packing, kind: str, path: Path) -> None:
    """Write one state as a run file."""
    strain = 0.0 if kind == "isotropic" else SHEARED_STRAIN
    with RunFileWriter(path, settings={"name": kind}) as writer:
        writer.frame(
            Frame(
                packing=packing,
                eps_q=strain,
                eps_q_total=strain,
                strain=np.zeros((2, 2)),
                stage=0,
                stress=stress_tensor(packing),
                inertial_number=0.0,
                direction=np.array([0.0, 1.0]),
            )
        )


def loading_of(kind: str, packing: Packing) -> Loading:
    """What drives a stored state on."""
    return Isotropic() if kind == "isotropic" else biaxial_loading(packing)


def kernels(bench: Bench) -> list[dict[str, Any]]:
    """Our kernels beside the C++ reference."""
    cases = (isotropic_case(13_000, 2), isotropic_case(10_000, 3))
    return [kernel_speed(case, reference(), repetitions=bench.repetitions) for case in cases]


def threads(bench: Bench) -> list[dict[str, Any]]:
    """One thread beside two."""
    return [
        thread_speed(isotropic_case(count, 2), repetitions=bench.repetitions)
        for count in (13_000, 200_000)
    ]


def problems(bench: Bench) -> list[dict[str, Any]]:
    """One step of each stored state to each residual, from its forces and from none."""
    rows = []
    for kind in ("isotropic", "biaxial"):
        for count in bench.sizes:
            warm = bench.state(kind, count)
            for start, packing in (("warm", warm), ("cold", replace(warm, contacts=None))):
                rows += _rows(kind, start, packing, steps=1)
    return rows


def _rows(kind: str, start: str, packing: Packing, steps: int) -> list[dict[str, Any]]:
    rows = []
    for tolerance in RESIDUALS:
        row = compare_solvers(
            packing, loading_of(kind, packing),
            friction=FRICTION, tolerance=tolerance, steps=steps, cap=PLAIN_CAP,
        )  # fmt: skip
        rows.append({"state": kind, "start": start, **row})
        print(kind, start, row["grains"], tolerance, row["sweeps_ratio"], flush=True)
    return rows


def consecutive(bench: Bench) -> list[dict[str, Any]]:
    """Consecutive steps from ε_q = 0.2 to each residual."""
    rows = []
    for count in bench.sizes:
        rows += _rows("biaxial", "consecutive", bench.state("biaxial", count), bench.steps)
    return rows


def copies(bench: Bench) -> list[dict[str, Any]]:
    """The same number of disks sheared as one sample, and as copies of a quarter of it."""
    rows = []
    for source in (1200, 300):
        packing = _sheared(1200, source=source)
        row = compare_solvers(
            packing, biaxial_loading(packing),
            friction=FRICTION, tolerance=1e-5, steps=20, cap=PLAIN_CAP,
        )  # fmt: skip
        rows.append({"source": source, **row})
    return rows


def step(bench: Bench) -> list[dict[str, Any]]:
    """Where the time of a step goes."""
    rows = []
    for count in bench.sizes:
        packing = bench.state("biaxial", count)
        for tolerance in (1e-4, 1e-5):
            rows.append(
                profile_steps(
                    packing, biaxial_loading(packing),
                    friction=FRICTION, tolerance=tolerance, steps=bench.steps,
                )
            )  # fmt: skip
    return rows


def curve(bench: Bench) -> list[dict[str, Any]]:
    """Cost of a contact update against the number of grains."""
    rows = []
    for dimension, limit in ((2, bench.largest), (3, min(bench.largest, MOST_SPHERES))):
        cases = [isotropic_case(count, dimension) for count in CURVE if count <= limit]
        rows += update_costs(cases, repetitions=bench.repetitions)
    return rows


def start(bench: Bench) -> dict[str, float]:
    """Start-up times."""
    return commands.start_up()


def memory(bench: Bench) -> list[dict[str, Any]]:
    """Peak memory against the number of grains."""
    return [commands.memory(count) for count in CURVE[2:] if count <= bench.largest]


def figures(bench: Bench) -> list[dict[str, Any]]:
    """The main command."""
    return [commands.figure(["--quick"]), commands.figure([])]


PARTS: dict[str, Callable[[Bench], Any]] = {
    part.__name__: part
    for part in (
        kernels,
        threads,
        start,
        curve,
        memory,
        step,
        problems,
        consecutive,
        copies,
        figures,
    )
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], metavar="part")
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--repetitions", type=int, default=41)
    parser.add_argument("--largest", type=int, default=CURVE[-1])
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    bench = Bench(given)
    for name in given.parts or [part for part in PARTS if part not in bench.results]:
        print(f"== {name}", flush=True)
        bench.keep(name, PARTS[name](bench))


if __name__ == "__main__":
    main()
