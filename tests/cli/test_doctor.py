"""``doctor`` reports what granufab runs on, and its self-check is a real one."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import granufab as package


def test_the_self_check_counts_an_isostatic_packing(granufab) -> None:
    done = granufab("doctor", "--json")
    report = json.loads(done.out)
    assert report["self_check"]["passed"] is True, report["self_check"]
    assert done.code == 0
    check = report["self_check"]
    assert check["grains_in_network"] > 30
    assert abs(check["contacts"] - (2 * check["grains_in_network"] - 1)) <= 2
    assert check["pressure"] == pytest.approx(1.0, abs=1e-3)
    assert report["versions"]["granufab"] == package.__version__
    assert report["threads"]["numba"] >= 1
    assert report["cpu"]["features"]
    assert report["compile_cache"]["folder"]


def test_a_wrong_answer_fails_the_check(granufab, monkeypatch: pytest.MonkeyPatch) -> None:
    compress = package.compress

    def half(*arguments, **options):
        packing = compress(*arguments, **options)
        keep = packing.contacts.pair[:, 0] % 2 == 0
        return replace(packing, contacts=packing.contacts.select(keep))

    monkeypatch.setattr(package, "compress", half)
    done = granufab("doctor")
    assert done.code == 1
    assert "passed" in done.out
