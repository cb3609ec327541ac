"""The table of docs/performance.md from docs/benchmarks.json and docs/peers.json."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks_page import machine, ratio, table

sys.path.insert(0, str(Path(__file__).resolve().parent / "peers"))

Result = dict[str, Any]
DETAIL, PEERS = "[how fast it is](benchmarks.md)", "[beside other programs](peers.md)"


def page(benchmarks: Result, peers: Result) -> str:
    """What it ran on, and one row for each question."""
    rows = [*_kernels(benchmarks), *_solver(benchmarks), *_steps(benchmarks), *_whole(benchmarks)]
    lines = [(*row, DETAIL) for row in rows] + [(*row, PEERS) for row in _peers(peers)]
    return f"{machine(benchmarks)}\n\n" + table(("", "measured", "more"), lines)


def _kernels(data: Result) -> list[tuple[str, str]]:
    out = []
    for row in data["kernels"]:
        what = f"one contact update, {row['dimension']}D, {row['contacts']:,} contacts"
        beside = f"{ratio(row['fast_ratio'])} of plain C++"
        out.append((what, f"{row['fast_ns']:.1f} ns, {beside}"))
    largest = max(data["curve"], key=lambda row: (row["dimension"] == 2, row["grains"]))
    what = f"the same with {largest['grains']:,} disks"
    told = f"{largest['ns']:.1f} ns, {ratio(largest['relative'])} times that of 1,000"
    out.append((what, told))
    for row in data["threads"]:
        what = f"two threads, {row['contacts']:,} contacts"
        out.append((what, f"{ratio(row['ratio'])} times as fast as one"))
    return out


def _solver(data: Result) -> list[tuple[str, str]]:
    largest = max(row["grains"] for row in data["consecutive"])
    out = []
    for row in data["consecutive"]:
        if row["grains"] == largest and row["tolerance"] in (1e-4, 1e-5):
            plain, ours = row["plain"]["sweeps_mean"], row["accelerated"]["sweeps_mean"]
            what = f"sweeps a step to residual {row['tolerance']:.0e}, {largest:,} disks"
            gain = f"{row['sweeps_ratio']:.2f} times fewer"
            out.append((what, f"{ours:.0f}; Gauss–Seidel without momentum {plain:.0f} ({gain})"))
    return out


def _steps(data: Result) -> list[tuple[str, str]]:
    return [
        (
            f"a step of {row['grains']:,} disks to residual {row['tolerance']:.0e}, one thread",
            f"{row['ms_per_step']:.1f} ms, "
            f"{100 * row['outside_sweeps_fraction']:.0f} % of it outside the sweeps",
        )
        for row in data["step"]
        if row["tolerance"] == 1e-4
    ]


def _whole(data: Result) -> list[tuple[str, str]]:
    memory, start = max(data["memory"], key=lambda row: row["grains"]), data["start"]
    per = memory["bytes_per_grain"]
    out = [
        (f"memory with {memory['grains']:,} disks", f"{per:,.0f} bytes a grain"),
        ("`granufab --help`", f"{start['help_seconds']:.2f} s"),
        (
            "50 disks compacted and sheared, kernels not yet compiled",
            f"{start['first_use_seconds']:.1f} s; the same, compiled before, "
            f"{start['cached_use_seconds']:.1f} s",
        ),
    ]
    for row in data["figures"]:
        steps = f"{row['nonconverged_steps']} unconverged steps"
        out.append((f"`{row['command']}`", f"{row['seconds']:.0f} s, {steps}"))
    return out


def _peers(data: Result) -> list[tuple[str, str]]:
    compared: Callable[[Result, float], tuple[float, float] | None] = _Compared(data)
    out = []
    for row in data["present"]:
        if row["seed"] != 1:
            continue
        kappa = 1e5 if row["role"] else 1e4
        found = compared(row, kappa)
        if found is None:
            continue
        faster, apart = found
        setting = "defaults" if row["role"] else f"κ = {row['kappa']:.0e}"
        setting += f", residual {row['residual']:.0e}, h = {row['time_step_setting']:g}"
        job = f"biaxial job of {row['grains']:,} disks, {setting}"
        out.append(
            (
                f"{job}, beside LAMMPS at κ = {kappa:.0e}",
                f"{faster:.1f} times as fast, z {apart:+.3f} (one sample, one timing)",
            )
        )
    return out


class _Compared:
    """Finds the LAMMPS row of the same sample."""

    def __init__(self, data: Result) -> None:
        self.theirs = [row for row in data["rows"] if row["program"] == "LAMMPS"]

    def __call__(self, row: Result, kappa: float) -> tuple[float, float] | None:
        job = ("grains", "rate", "strain", "seed")
        for other in self.theirs:
            if other["kappa"] == kappa and all(other[key] == row[key] for key in job):
                apart = row["z_backbone"] - other["z_backbone"]
                return other["cpu_seconds"] / row["cpu_seconds"], apart
        return None
