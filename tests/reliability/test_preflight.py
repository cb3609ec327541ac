"""A run that cannot fit is refused before it starts; what is there is told from faked limits."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from granufab.cli import main
from granufab.errors import InvalidSettings
from granufab.reproduce import preflight
from granufab.reproduce.case_folder import run_into_folder
from granufab.reproduce.preflight import check_fits, disk_available, in_words
from granufab.simulate import Case, Record, Sample, Stage, available
from granufab.simulate.available import Room, memory_available
from granufab.simulate.demand import demand_of

SOURCE = Path(__file__).parents[2] / "src"
SMALL = Case(
    sample=Sample(grain_count=60, friction=0.3),
    path=(Stage(strain=0.004, inertial_number=3e-3), Stage(loading="isotropic")),
    record=Record(frame_interval=1e-3, series_interval=5e-4),
)


@pytest.fixture
def proc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with 8 GB free and no control groups."""
    (tmp_path / "proc" / "self").mkdir(parents=True)
    (tmp_path / "group").mkdir()
    (tmp_path / "proc" / "meminfo").write_text("MemTotal: 9000000 kB\nMemAvailable: 8000000 kB\n")
    monkeypatch.setattr(available, "PROC", tmp_path / "proc")
    monkeypatch.setattr(available, "CGROUP", tmp_path / "group")
    return tmp_path


def _size() -> int:
    room = memory_available()
    assert room is not None
    return room.size


def test_free_memory_of_the_machine(proc: Path) -> None:
    assert _size() == 8_000_000 * 1024


@pytest.mark.parametrize(
    ("line", "folder", "names"),
    [
        ("0::/job/step\n", "job/step", ("memory.max", "memory.current")),
        ("0::/job/step\n", "job", ("memory.max", "memory.current")),
        ("0::/elsewhere\n", ".", ("memory.max", "memory.current")),
        (
            "9:name=systemd:/\n4:memory:/job\n",
            "memory/job",
            ("memory.limit_in_bytes", "memory.usage_in_bytes"),
        ),
    ],
)
def test_the_limit_of_a_job_counts(
    proc: Path, line: str, folder: str, names: tuple[str, str]
) -> None:
    place = proc / "group" / folder
    place.mkdir(parents=True, exist_ok=True)
    (proc / "proc" / "self" / "cgroup").write_text(line)
    (place / names[0]).write_text("3000000000\n")
    (place / names[1]).write_text("1000000000\n")
    assert _size() == 2_000_000_000
    (place / "memory.stat").write_text("anon 5\ninactive_file 300000000\n")
    assert _size() == 2_300_000_000
    (place / names[0]).write_text("max\n")
    assert _size() == 8_000_000 * 1024


def test_the_limit_of_the_process_counts(proc: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (proc / "proc" / "self" / "status").write_text("VmSize: 1000 kB\nVmData: 500 kB\n")
    limits = {resource.RLIMIT_AS: 5_000_000, resource.RLIMIT_DATA: resource.RLIM_INFINITY}
    monkeypatch.setattr(resource, "getrlimit", lambda name: (limits[name], 0))
    room = memory_available()
    assert room is not None
    assert room.size == 5_000_000 - 1000 * 1024
    assert "ulimit -v" in room.source


def _refused(folder: Path, case: Case = SMALL, **given: Any) -> str:
    with pytest.raises(InvalidSettings) as caught:
        run_into_folder(case, folder, **given)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_too_little_memory_is_refused_with_both_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needed = demand_of(SMALL).memory
    monkeypatch.setattr(preflight, "memory_available", lambda: Room(needed - 1, "free memory"))
    text = _refused(tmp_path / "out")
    assert in_words(needed) in text
    assert in_words(needed - 1) in text
    assert list((tmp_path / "out").iterdir()) == []
    monkeypatch.setattr(preflight, "memory_available", lambda: Room(needed, "free memory"))
    assert check_fits(SMALL, tmp_path).memory == needed


def test_too_little_disk_is_refused_and_names_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needed = demand_of(SMALL).disk
    monkeypatch.setattr(preflight, "disk_available", lambda folder: Room(needed - 1, "disk"))
    text = _refused(tmp_path / "out")
    assert str(tmp_path / "out") in text
    assert in_words(needed) in text
    assert "record.frame_interval" in text
    assert list((tmp_path / "out").iterdir()) == []
    monkeypatch.setattr(preflight, "disk_available", lambda folder: Room(needed, "disk"))
    assert check_fits(SMALL, tmp_path).disk == needed
    half = demand_of(SMALL).frames // 2
    monkeypatch.setattr(preflight, "disk_available", lambda folder: Room(needed // 2 + 1, "disk"))
    assert check_fits(SMALL, tmp_path, frames=half + 1).disk == needed


def test_a_refused_run_keeps_the_results_that_force_would_replace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "run.h5").write_bytes(b"earlier")
    monkeypatch.setattr(preflight, "memory_available", lambda: Room(1000, "free memory"))
    _refused(out, force=True)
    assert (out / "run.h5").read_bytes() == b"earlier"


def test_a_hundred_million_grains_are_refused_in_one_line(
    tmp_path: Path, tell: Callable[..., None]
) -> None:
    """In a process that may have 4 GB, for real; nothing is allocated."""
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (2**32, 2**32)); "
        "from granufab.cli import main; main(sys.argv[1:])"
    )
    case = tmp_path / "case.toml"
    case.write_text("[sample]\ngrain_count = 100000000\n")
    done = subprocess.run(
        [sys.executable, "-c", program, "run", str(case)],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(SOURCE), "GRANUFAB_THREADS": "1"},
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "sample.grain_count = 100000000" in done.stderr
    assert "270 GB of memory" in done.stderr
    tell(grains=100_000_000, limit=2**32, needed="270 GB")
    assert "ulimit -v" in done.stderr
    assert not (tmp_path / "case" / "run.h5").exists()


def test_steps_and_records_are_those_of_the_run(tmp_path: Path, tell: Callable[..., None]) -> None:
    """And the disk is at least what the run leaves."""
    demand = demand_of(SMALL)
    run = run_into_folder(SMALL, tmp_path / "out")
    rest = next(f.statistics.steps for f in list(run.frames)[::-1])
    assert run.summary["steps"] - rest == pytest.approx(demand.steps, rel=0.02)
    assert len(run.frames) == demand.frames
    assert run.series.sizes["record"] == pytest.approx(demand.rows, abs=1)
    held = sum(path.stat().st_size for path in (tmp_path / "out").iterdir())
    tell(frames=demand.frames, held=held, expected=demand.disk)
    assert held <= demand.disk


def test_disk_of_a_folder_that_does_not_exist_yet(tmp_path: Path) -> None:
    room = disk_available(tmp_path / "a" / "b")
    assert room is not None
    assert room.size > 0


def test_dry_run_tells_and_does_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = tmp_path / "case.toml"
    case.write_text("[sample]\ngrain_count = 500\n")
    with pytest.raises(SystemExit) as ended:
        main(["run", str(case), "--dry-run"])
    out = capsys.readouterr().out
    assert ended.value.code == 0
    for word in ("steps", "frames", "memory", "disk", "time", "500", "20000"):
        assert word in out
    assert not (tmp_path / "case").exists()


def test_linear_programs_count_where_they_are_used() -> None:
    """Frictionless samples, or a wanted z, up to the size that the programs take."""

    def memory(**sample: Any) -> int:
        return demand_of(Case(sample=Sample(**sample))).memory

    rough, smooth = memory(grain_count=2000, friction=0.3), memory(grain_count=2000)
    assert smooth - rough == pytest.approx(2000 * 6000 * (2000 / 1500) ** 0.15, rel=1e-6)
    assert memory(grain_count=2000, coordination=3.5, friction=0.3) == smooth
    assert memory(grain_count=60_000) == memory(grain_count=60_000, friction=0.3)
    assert demand_of(Case(sample=Sample(grain_count=2000)), prepared=True).memory == rough


def test_the_guess_of_the_engines_limit_is_the_engines() -> None:
    from granufab.simulate import demand, jamming

    assert demand.PROGRAM_GRAINS == jamming.LARGEST
