"""The same campaign on Dask: two worker processes, one of them killed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import counted_case
import pytest
import xarray as xr

from granufab.campaign import gather, run_campaign
from granufab.campaign.dask_pool import check_dask
from granufab.errors import InvalidSettings, MissingData
from granufab.simulate.team import core_count


def without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(package: str) -> Any:
        raise ImportError(package)

    monkeypatch.setattr("granufab.campaign.dask_pool.import_module", nothing)


def test_a_missing_extra_is_one_line_and_nothing_is_run(
    tmp_path: Path, small: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    without_dask(monkeypatch)
    with pytest.raises(MissingData, match=r"distributed; install granufab\[sweep\]"):
        run_campaign(small(0.2), tmp_path / "out", dask="local")
    assert not list((tmp_path / "out").glob("cases/*"))


def test_an_address_without_a_port_is_refused() -> None:
    pytest.importorskip("distributed", reason="Dask is not installed (extra sweep)")
    with pytest.raises(InvalidSettings, match="allowed local, slurm, pbs, sge, or an address"):
        check_dask("lsf")


@pytest.mark.slow
def test_a_killed_dask_worker_costs_no_case_and_changes_no_number(
    tmp_path: Path, small: Callable[..., Any], tell: Callable[..., None]
) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed (extra sweep)")
    if core_count() < 2:
        pytest.skip("two worker processes need two cores")
    sweep = small(0.1, 0.2, 0.4, 0.8, seeds=6)
    killer = counted_case.Killer(after=8)
    summary = run_campaign(
        sweep,
        tmp_path / "dask",
        dask="local",
        workers=2,
        progress=killer,
        run_case=counted_case.counted,
    )
    assert (summary["done"], summary["cases"], summary["failed"]) == (24, 24, 0)
    ended = Counter(name for name, _ in counted_case.lines("end"))
    assert len(ended) == 24
    assert set(ended.values()) == {1}
    assert killer.victim is not None
    begun = Counter(name for name, _ in counted_case.lines("begin"))
    assert begun[killer.victim] == 2
    results = gather(tmp_path / "dask")
    assert len(set(results["case"].values.tolist())) == 24
    run_campaign(sweep, tmp_path / "local")
    xr.testing.assert_identical(results, gather(tmp_path / "local"))
    tell(cases=24, ended=sum(ended.values()))


@pytest.mark.slow
def test_a_campaign_on_dask_stops_and_goes_on(tmp_path: Path, small: Callable[..., Any]) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed (extra sweep)")
    sweep, folder = small(0.2, 0.5, seeds=3), tmp_path / "out"

    def stop_later(ledger: Any) -> None:
        if ledger.count()["done"] >= 1:
            raise KeyboardInterrupt

    options: dict[str, Any] = {"dask": "local", "workers": 1, "run_case": counted_case.counted}
    first = run_campaign(sweep, folder, progress=stop_later, **options)
    assert first["stopped"]
    assert first["running"] == 0
    assert 1 <= first["done"] < 6
    assert run_campaign(sweep, folder, **options)["done"] == 6
