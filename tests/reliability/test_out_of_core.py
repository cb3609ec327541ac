"""Measures of a run file read one frame after the other: memory does not grow with its length."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lattice_runs import frame_bytes, write_lattice_run

import granufab as gf
from granufab.campaign.frame_workers import frame_workers
from granufab.cli import main
from granufab.errors import InvalidSettings
from granufab.fabric import balance_run, measure_run
from granufab.fabric.balance_run import balance_intervals, follow_run
from granufab.history import Run

SOURCE = Path(__file__).parents[2] / "src"
PEAK = """
import re, sys
from granufab.cli import main
try:
    main([sys.argv[1], sys.argv[2], "--json"])
except SystemExit as ended:
    assert ended.code == 0
print(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1], file=sys.stderr)
"""
"""Of this program alone: getrusage counts what its parent held when it was started."""


def _peak(verb: str, path: Path) -> float:
    """Most memory that a verb held [bytes]."""
    done = subprocess.run(
        [sys.executable, "-c", PEAK, verb, str(path)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        timeout=600,
        env={**os.environ, "PYTHONPATH": str(SOURCE), "OMP_NUM_THREADS": "1"},
        check=True,
    )
    return float(done.stderr.splitlines()[-1]) * 1024


def _grows_by_less_than_four_frames(
    folder: Path, side: int, frames: int, tell: Callable[..., None]
) -> None:
    short, long = folder / "short.h5", folder / "long.h5"
    size = frame_bytes(write_lattice_run(short, side, 4))
    write_lattice_run(long, side, frames)
    for verb in ("measure", "balance"):
        growth = _peak(verb, long) - _peak(verb, short)
        megabytes = long.stat().st_size / 1e6
        tell(verb=verb, frames=frames, megabytes=megabytes, grown_frames=growth / size)
        assert growth < 4 * size < (frames - 4) * size / 2


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_a_longer_run_takes_no_more_memory(tmp_path: Path, tell: Callable[..., None]) -> None:
    _grows_by_less_than_four_frames(tmp_path, 140, 24, tell)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_a_run_file_of_300_megabytes_takes_no_more_memory(
    tmp_path: Path, tell: Callable[..., None]
) -> None:
    _grows_by_less_than_four_frames(tmp_path, 220, 90, tell)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    path = tmp_path_factory.mktemp("lattice") / "run.h5"
    write_lattice_run(path, 12, 17, stages=(5, 6, 13))
    return gf.read(path)


@pytest.mark.parametrize("every", [1, 2, 3, 4])
@pytest.mark.parametrize("keep", [None, 0.02])
def test_the_balance_read_as_it_comes_is_that_of_all_frames(
    run: Run, every: int, keep: float | None
) -> None:
    """Over several stages, also with contacts that are kept from frame to frame."""
    together = balance_intervals(follow_run(run, keep=keep), every=every)
    streamed = balance_run(run, every=every, keep=keep)
    assert streamed.identical(together)
    assert streamed.sizes["interval"] == {1: 16, 2: 7, 3: 4, 4: 3}[every]


def _assert_same_bits(run: Run, each: object) -> None:
    one, other = (
        measure_run(run, forces=True, **given)
        for given in ({}, {"each": each})  # type: ignore[arg-type]
    )
    assert one.identical(other)
    for given in ({}, {"keep": 0.02, "z_definition": "z_backbone"}):
        one, other = balance_run(run, **given), balance_run(run, each=each, **given)  # type: ignore[arg-type]
        assert one.identical(other)
        assert np.array_equal(one["gain"].values, other["gain"].values)


def test_two_processes_give_the_same_bits(run: Run) -> None:
    with frame_workers(2) as each:
        _assert_same_bits(run, each)


def test_two_dask_workers_give_the_same_bits(run: Run) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed (extra sweep)")
    with frame_workers(2, "local") as each:
        _assert_same_bits(run, each)


def test_frames_in_memory_are_not_sent_to_workers(run: Run) -> None:
    held = Run(
        series_source=run.series,
        frames=[run.frames[k % 17] for k in range(120)],
        settings=run.settings,
    )
    with frame_workers(2) as each, pytest.raises(InvalidSettings, match="granufab import"):
        measure_run(held, each=each)


def test_the_verbs_share_frames(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(run.frames.path)  # type: ignore[union-attr]
    for verb in ("measure", "balance"):
        told = []
        for workers in ("1", "2"):
            with pytest.raises(SystemExit) as ended:
                main([verb, path, "--json", "--workers", workers])
            assert ended.value.code == 0
            told.append(capsys.readouterr().out)
        assert told[0] == told[1]
        assert len(told[0]) > 1000


@pytest.mark.parametrize("given", [["--workers", "0"], ["--dask", "nowhere"]])
def test_bad_workers_end_in_one_line(
    run: Run, given: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["measure", str(run.frames.path), *given])  # type: ignore[union-attr]
    told = capsys.readouterr().err
    assert ended.value.code == 2
    assert told.count("\n") == 1


@pytest.mark.slow
def test_seconds_of_two_workers(tmp_path: Path, tell: Callable[..., None]) -> None:
    """Told, not asserted: it depends on who else uses the machine."""
    path = tmp_path / "run.h5"
    write_lattice_run(path, 200, 40)
    opened, seconds = gf.read(path), []
    for workers in (1, 2):
        with frame_workers(workers) as each:
            measure_run(opened, each=each)  # workers have started
            began = time.perf_counter()
            measure_run(opened, each=each)
            seconds.append(time.perf_counter() - began)
    tell(frames=40, grains=40_000, one=seconds[0], two=seconds[1])
    assert min(seconds) > 0
