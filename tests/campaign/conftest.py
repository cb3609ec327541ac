"""A small campaign: 40 grains, strain 0.01, a hundred steps a case."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import counted_case

from granufab.campaign import Sweep, parse_sweep, run_campaign

CASE: dict[str, Any] = {
    "sample": {"grain_count": 40},
    "path": [{"strain": 0.01, "inertial_number": 3e-3}],
    "record": {"series_interval": 1e-4},
}


@pytest.fixture
def small() -> Callable[..., Sweep]:
    """Makes a campaign over the friction (or what is given)."""

    def make(*frictions: float, **changes: Any) -> Sweep:
        parameter = [{"key": "material.friction", "values": list(frictions)}] if frictions else []
        return parse_sweep({"name": "small", "case": CASE, "parameter": parameter, **changes})

    return make


@pytest.fixture(autouse=True)
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the stand-ins leave their lines; a thread for each worker."""
    path = tmp_path / "lines.txt"
    monkeypatch.setenv(counted_case.LOG, str(path))
    monkeypatch.delenv("GRANUFAB_THREADS", raising=False)
    return path


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign of two frictions and two seeds, done."""
    folder = tmp_path_factory.mktemp("finished") / "out"
    data = {
        "name": "small",
        "seeds": 2,
        "case": CASE,
        "parameter": [{"key": "material.friction", "values": [0.1, 0.6]}],
    }
    summary = run_campaign(parse_sweep(data), folder, workers=1, threads=1)
    assert summary["done"] == 4
    return folder
