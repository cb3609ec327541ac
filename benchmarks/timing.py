"""Wall times of the main command and cost of a contact update; prints Markdown and JSON.

    python benchmarks/timing.py [--full] [--json FILE]

``--full`` adds the 5,000-disk figure. Each figure runs in its own process; the first one with an
empty compile cache, as a new user meets it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any


def time_figure(arguments: list[str], cache: str) -> dict[str, Any]:
    """Run ``granufab reproduce fig7`` in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "fig7"
        command = [sys.executable, "-c", "from granufab.cli import main; main()"]
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
        began = time.perf_counter()
        subprocess.run(
            [*command, "reproduce", "fig7", *arguments, "--out", str(out)],
            check=True,
            env=environment,
            capture_output=True,
        )
        seconds = time.perf_counter() - began
        data = json.loads((out / "fig7.json").read_text())
    solver = data["solver"]
    return {
        "command": "granufab reproduce fig7 " + " ".join(arguments),
        "seconds": seconds,
        "residual_max": solver["residual_max"],
        "tolerance": solver["tolerance"],
        "nonconverged_steps": solver["nonconverged_steps"],
        "inertial_number": solver["inertial_number"],
        "contact_updates": solver["contact_updates"],
    }


def cost_of_a_step(grains: int, strain: float = 0.02) -> dict[str, Any]:
    """Where the time of a shear step goes, on one core."""
    import granufab.simulate as g

    sample = g.compress(g.random_sample(grains, seed=1), friction=0.3)
    g.shear(sample, strain=1e-3)
    summary = g.shear(sample, strain=strain).summary
    seconds = summary["seconds_by_stage"]
    total = sum(seconds.values())
    return {
        "grains": grains,
        "ms_per_step": 1e3 * total / summary["steps"],
        "sweeps": summary["sweeps_mean"],
        "ns_per_contact_update": 1e9 * seconds["solve"] / summary["contact_updates"],
        "outside_solve": 1 - seconds["solve"] / total,
    }


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        figures = [time_figure(["--quick"], cache), time_figure(["--quick"], cache)]
        if given.full:
            figures.append(time_figure([], cache))
    figures[0]["command"] += " (empty compile cache)"
    steps = [cost_of_a_step(grains) for grains in (1000, 5000)]
    data = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python "
        f"{platform.python_version()}",
        "figures": figures,
        "steps": steps,
    }
    if given.json:
        given.json.write_text(json.dumps(data, indent=1))
    print(data["machine"])
    print(
        "| command | seconds | worst residual | tolerance | unconverged | I |\n" + "|---" * 6 + "|"
    )
    for f in figures:
        print(
            f"| `{f['command']}` | {f['seconds']:.0f} | {f['residual_max']:.1e} | "
            f"{f['tolerance']:.0e} | {f['nonconverged_steps']} | {f['inertial_number']:.0e} |"
        )
    print(
        "\n| disks | ms/step | sweeps | ns per contact update | outside the solve |\n"
        + "|---" * 5
        + "|"
    )
    for s in steps:
        print(
            f"| {s['grains']} | {s['ms_per_step']:.2f} | {s['sweeps']:.0f} | "
            f"{s['ns_per_contact_update']:.1f} | {100 * s['outside_solve']:.0f} % |"
        )


if __name__ == "__main__":
    main()
