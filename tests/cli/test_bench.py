"""``bench`` writes all its ratios, with a compiler and without."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from granufab.bench import reference as module
from granufab.bench.reference import reference
from granufab.bench.suite import HEADLINES

PROMISED = {
    *("kernel_2d_ratio", "kernel_3d_ratio", "fast_2d_ratio", "fast_3d_ratio"),
    *("sweeps_ratio_1e-5", "time_ratio_1e-5", "outside_sweeps_fraction"),
    *("threads_ratio_25k", "threads_ratio_400k"),
}


def test_the_file_holds_all_ratios_and_where_they_come_from(granufab, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    done = granufab("bench", "--tiny", "--json", file)
    assert done.code == 0, done.err
    report = json.loads(file.read_text(encoding="utf-8"))
    assert set(HEADLINES) == PROMISED
    assert set(report) >= PROMISED
    assert {row["dimension"] for row in report["kernels"]} == {2, 3}
    assert report["sweeps_ratio_1e-5"] > 1
    assert 0 < report["outside_sweeps_fraction"] < 1
    assert report["machine"]["processor"]
    assert report["versions"]["numba"]
    assert (report["kernel_2d_ratio"] is None) == (reference() is None)
    for name in PROMISED:
        assert name in done.out


def test_without_a_compiler_the_ratios_are_null(granufab, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "COMPILERS", ())
    monkeypatch.delenv("CXX", raising=False)
    reference.cache_clear()
    try:
        done = granufab("bench", "--tiny", "--json", "-")
    finally:
        reference.cache_clear()
    assert done.code == 0, done.err
    report = json.loads(done.out)
    assert report["kernel_2d_ratio"] is None
    assert report["kernel_3d_ratio"] is None
    assert report["versions"]["compiler"] is None
    assert report["kernels"][0]["scalar_ns"] > 0


def test_a_file_that_exists_is_kept(granufab, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    file.write_text("mine", encoding="utf-8")
    done = granufab("bench", "--tiny", "--json", file)
    assert done.code == 2
    assert done.err == f"granufab: {file}: exists already; choose another name, or --force\n"
    assert file.read_text(encoding="utf-8") == "mine"
