"""The runner beside other programs: its input, its readers and its tables, without LAMMPS."""

from __future__ import annotations

import importlib.util
import json
import math
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "peers"
sys.path.insert(0, str(FOLDER))

import lammps_run  # noqa: E402
import lammps_script  # noqa: E402
import peers_table  # noqa: E402
from biaxial_job import Job, Start, late_means, run_once, start_of  # noqa: E402
from granufab_run import Choice, run_granufab  # noqa: E402


def _runner() -> ModuleType:
    spec = importlib.util.spec_from_file_location("peers_runner", FOLDER / "__main__.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def lattice() -> Start:
    """Nine disks of radius 1 that touch on a square lattice."""
    x, y = np.meshgrid(np.arange(3), np.arange(3))
    position = 2.0 * np.column_stack([x.ravel(), y.ravel()]) + 1.0
    return Start(position, np.ones(9), np.array([6.0, 6.0]))


def _lattice_contacts(force_x: float, force_y: float) -> list[list[float]]:
    rows = []
    for k in range(9):
        x, y = k % 3, k // 3
        rows.append([k + 1, 3 * y + (x + 1) % 3 + 1, -2.0, 0.0, force_x])
        rows.append([k + 1, 3 * ((y + 1) % 3) + x + 1, 0.0, -2.0, force_y])
    return rows


def _dump(frames: list[list[list[float]]]) -> str:
    text = ""
    for index, rows in enumerate(frames):
        text += f"ITEM: TIMESTEP\n{index}\nITEM: NUMBER OF ENTRIES\n{len(rows)}\n"
        text += "ITEM: BOX BOUNDS pp pp pp\n0 6\n0 6\n-0.5 0.5\nITEM: ENTRIES a b c d e\n"
        text += "".join(" ".join(f"{v:g}" for v in row) + "\n" for row in rows)
    return text


@pytest.mark.parametrize("kappa", [1e3, 1e5])
def test_the_schedule_walks_the_strain_in_stable_steps(lattice: Start, kappa: float) -> None:
    job = Job(grains=9, rate=2e-4, strain=0.1, states=40)
    plan = lammps_script.Schedule.of(job, lattice, kappa)
    assert plan.shear * plan.step * lattice.axial_rate(job) == pytest.approx(0.1, rel=1e-12)
    assert plan.shear == 40 * plan.every
    assert plan.step <= lammps_script.STEP_SHARE / math.sqrt(kappa)  # m_min = 1
    assert plan.rest * plan.step >= lammps_script.REST_TIME


def test_the_axial_rate_is_the_inertial_number_over_the_inertial_time() -> None:
    start = Start(np.zeros((2, 2)), np.array([1.0, 3.0]), np.ones(2))  # masses 1 and 9
    assert start.axial_rate(Job(rate=1e-3)) == pytest.approx(1e-3 / math.sqrt(5))


def test_the_script_compresses_along_y_and_holds_x(lattice: Start) -> None:
    job = Job(grains=9, friction=0.37)
    script = lammps_script.script_text(job, lattice, 1e4, tangential=0.5)
    rest, _, shear = script.partition("reset_timestep 0")
    laws = re.findall(r"pair_style gran/hooke/history (\S+) (\S+) \S+ \S+ (\S+) 1", script)
    assert [tuple(map(float, law)) for law in laws] == [(1e4, 5e3, 0.0), (1e4, 5e3, 0.37)]
    assert "nph/sphere iso 1.0 1.0" in rest
    assert "nph/sphere x 1.0 1.0" in shear
    rate = re.search(r"deform 1 y trate (\S+) remap x", shear)
    assert rate is not None
    assert float(rate[1]) == pytest.approx(-lattice.axial_rate(job))
    plan = lammps_script.Schedule.of(job, lattice, 1e4)
    assert re.findall(r"^run (\d+)$", script, re.M) == [str(plan.rest), str(plan.shear)]


def test_the_data_file_holds_the_sample(lattice: Start) -> None:
    head, _, body = lammps_script.data_text(lattice).partition("Atoms # sphere\n\n")
    atoms = np.array([line.split() for line in body.splitlines()], dtype=float)
    assert "9 atoms" in head
    assert "0 6 ylo yhi" in head
    assert atoms[:, 4:6] == pytest.approx(lattice.position)
    assert atoms[:, 2] == pytest.approx(2.0)
    area_mass = atoms[:, 3] * np.pi * (atoms[:, 2] / 2) ** 2
    assert area_mass == pytest.approx(lattice.mass)


def test_every_frame_of_a_dump_is_read(tmp_path: Path) -> None:
    path = tmp_path / "contacts.dump"
    path.write_text(_dump([_lattice_contacts(1.0, 1.0), [], _lattice_contacts(1.0, 2.0)[:5]]))
    frames = list(lammps_run.read_contacts(path))
    assert [len(frame) for frame in frames] == [18, 0, 5]
    assert frames[2][1].tolist() == [1, 4, 0, -2, 2]


def test_pushing_contacts_of_a_lattice_give_its_fabric() -> None:
    both = lammps_run.measure_contacts(np.array(_lattice_contacts(1.0, 1.0)), 9)
    assert (both["z"], both["z_backbone"]) == (4.0, 4.0)
    assert both["a"] == pytest.approx(0.0, abs=1e-12)
    columns = lammps_run.measure_contacts(np.array(_lattice_contacts(-1.0, 1.0)), 9)
    assert (columns["z"], columns["rattler_fraction"]) == (2.0, 0.0)
    assert columns["a_signed"] == pytest.approx(2.0)  # all normals along the compression


LOG_TEXT = """LAMMPS (1 Jan 2000)
Loop time of 99 on 1 procs for 7 steps with 9 atoms
print "shear begins"
shear begins
run 20
   Step          Pxx            Pyy            Lx             Ly           KinEng
         0   1.0            1.0           6              6              0
        10   0.5            1.5           6              5.4            1e-05
        20   1.0            3.0           6.6            5.0            2e-05
Loop time of 12.5 on 1 procs for 20 steps with 9 atoms
80.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Neighbor list builds = 3
"""


def test_the_log_gives_the_seconds_of_the_shear_alone() -> None:
    times, rows = lammps_run.read_log(LOG_TEXT)
    assert times == {"seconds": 12.5, "cpu_seconds": 10.0, "neighbour_builds": 3.0}
    assert rows[:, 0].tolist() == [0, 10, 20]
    with pytest.raises(ValueError, match="did not finish"):
        lammps_run.read_log(LOG_TEXT.partition("Loop time of 12.5")[0])


def test_states_carry_logarithmic_strain_and_stress(tmp_path: Path, lattice: Start) -> None:
    (tmp_path / lammps_script.LOG).write_text(LOG_TEXT)
    (tmp_path / lammps_script.CONTACTS).write_text(_dump([_lattice_contacts(1.0, 1.0)] * 3))
    rows, _ = lammps_run.measure_run(tmp_path, Job(grains=9), lattice)
    assert rows[2]["strain"] == pytest.approx(math.log(6 / 5))
    assert rows[2]["eps_q"] == pytest.approx(math.log(6 / 5) + math.log(1.1))
    assert [row["q_over_p"] for row in rows] == pytest.approx([0.0, 0.5, 0.5])
    assert rows[1]["phi"] == pytest.approx(9 * math.pi / (6 * 5.4))
    assert rows[2]["z"] == 4.0


def test_means_are_taken_late() -> None:
    measures = ("z", "z_backbone", "rattler_fraction", "a", "a_signed", "q_over_p", "phi")
    strains = np.linspace(0.02, 0.2, 10)
    rows = [{"strain": s, "eps_q": 2 * s, **dict.fromkeys(measures, s)} for s in strains]
    found = late_means(rows, Job(strain=0.2))
    assert found["states"] == 3
    assert found["z"] == pytest.approx(0.18)
    assert found["eps_q_end"] == pytest.approx(0.4)
    with pytest.raises(ValueError, match=r"no state beyond strain 0\.7"):
        late_means(rows, Job(strain=1.0))


def test_a_row_timed_again_keeps_its_least_cpu_seconds(tmp_path: Path) -> None:
    path = tmp_path / "row.json"
    seconds = iter((3.0, 2.0, 4.0))

    def make() -> dict[str, Any]:
        return {"cpu_seconds": next(seconds)}

    assert run_once(path, make)["timings"] == [3.0]
    assert run_once(path, make)["timings"] == [3.0]  # kept, not run
    run_once(path, make, again=True)
    row = run_once(path, make, again=True)
    assert (row["cpu_seconds"], row["timings"]) == (2.0, [3.0, 2.0, 4.0])
    assert run_once(path, make) == row


def _row(program: str, kappa: float | str, seed: int, seconds: float, z: float) -> dict[str, Any]:
    ours = program == "granufab"
    return {
        "program": program, "kappa": kappa, "seed": seed, "grains": 9, "rate": 1e-4, "strain": 0.2,
        "residual": 1e-4 if ours else None, "time_step": 0.05, "sweeps": 30.0 if ours else None,
        "unconverged": 0.0 if ours else None, "z_backbone": z, "z": z - 0.4, "a": 0.25,
        "rattler_fraction": 0.1, "q_over_p": 0.3, "lateral_stress": 1.0, "lateral_scatter": 0.01,
        "cpu_seconds": seconds, "seconds": 2 * seconds, "load_before": 1.0, "eps_q_end": 0.42,
        "timings": [seconds],
    }  # fmt: skip


def test_rows_are_compared_sample_by_sample() -> None:
    theirs = [_row("LAMMPS", 1e5, 1, 400.0, 3.22), _row("LAMMPS", 1e5, 2, 600.0, 3.20)]
    ours = [_row("granufab", 1e5, 1, 20.0, 3.24), _row("granufab", 1e5, 2, 60.0, 3.23)]
    assert peers_table.ratio(theirs, ours) == pytest.approx((20 + 10) / 2)
    assert peers_table.difference(theirs, ours, "z_backbone") == pytest.approx(0.025)
    assert peers_table.ratio(theirs, [_row("granufab", 1e5, 3, 1.0, 3.0)]) is None
    text = peers_table.report(
        [*ours, *theirs, _row("granufab", "rigid", 1, 40.0, 3.21)], [1e4, 1e5]
    )
    lines = text.splitlines()
    assert "axial I = 0.0001 (I_q ≈ 0.0002)" in lines[0]
    assert "(ε_q to 0.42)" in lines[0]
    assert [line.split(" | ")[0] for line in lines[4:]] == ["| LAMMPS", "| granufab", "| granufab"]
    assert "3.235 ± 0.005" in lines[5]
    assert lines[5].endswith("| +0.025, 15 × |")
    assert lines[6].endswith("| -0.010, 10 × |")
    assert lines[6].startswith("| granufab | rigid | 1e-4 |")
    assert "LAMMPS 1e4" not in text  # was not run


def test_granufab_runs_without_lammps_and_rows_are_not_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    runner = _runner()
    monkeypatch.setattr(runner, "pin", lambda core: core)
    monkeypatch.setenv("GRANUFAB_THREADS", "1")
    words = f"--out {tmp_path} --grains 40 --rate 1e-2 --strain 0.01 --kappa 1e3 --residuals 1e-2"
    words += " --no-default --lammps /nowhere/lmp"
    assert runner.main(words.split()) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == lammps_run.MISSING
    row = json.loads(next(tmp_path.glob("row-*.json")).read_text())
    assert (row["program"], row["grains"], row["states"]) == ("granufab", 40, 60)
    assert 3.0 < row["z_backbone"] < 5.0
    assert row["lateral_stress"] == pytest.approx(1.0, abs=0.05)
    assert (tmp_path / "peers.md").read_text().count("| granufab |") == 1

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a finished row was run again")

    monkeypatch.setattr(runner, "run_granufab", refuse)
    assert runner.main(words.split()) == 0


@pytest.mark.slow
def test_lammps_and_granufab_agree_on_a_short_job(tmp_path: Path) -> None:
    executable = lammps_run.find_lammps()
    if executable is None:
        pytest.skip(lammps_run.MISSING)
    pairs = []
    for seed in (1, 2, 3):
        job = Job(grains=300, rate=1e-3, strain=0.05, states=50, seed=seed)
        start = start_of(job, tmp_path)
        ours = run_granufab(job, start, Choice(kappa=1e3, residual=1e-5, time_step=0.05))
        pairs.append((lammps_run.run_lammps(executable, job, start, 1e3), ours))
    names = ("lateral_stress", "z_backbone", "a_signed", "phi")
    theirs, ours = ({k: np.mean([p[side][k] for p in pairs]) for k in names} for side in (0, 1))
    assert theirs["lateral_stress"] == pytest.approx(1.0, abs=0.1)
    assert theirs["z_backbone"] == pytest.approx(ours["z_backbone"], abs=0.1)
    assert theirs["a_signed"] == pytest.approx(ours["a_signed"], abs=0.12)
    assert theirs["phi"] == pytest.approx(ours["phi"], abs=0.01)
