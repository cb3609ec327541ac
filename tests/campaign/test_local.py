"""Campaigns on this machine: killed workers, failures, continuation, the table on disk."""

from __future__ import annotations

import csv
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import counted_case
import pytest
from hypothesis import given
from hypothesis import strategies as st

from granufab.campaign import case_work, run_campaign
from granufab.campaign.case_work import Outcome, Task, do_task
from granufab.campaign.engine import plan_workers
from granufab.campaign.expansion import expand
from granufab.campaign.ledger import read_table
from granufab.errors import CorruptFile, InvalidSettings
from granufab.io import RunLock
from granufab.simulate.team import core_count

TWO = min(2, core_count())


def states(folder: Path) -> Counter[str]:
    return Counter(row.state for row in read_table(folder / "cases.csv"))


@pytest.mark.parametrize(
    ("frictions", "seeds"),
    [((0.2, 0.5), 3), pytest.param((0.1, 0.2, 0.4, 0.8), 6, marks=pytest.mark.slow)],
)
def test_a_killed_worker_costs_no_case(
    frictions: tuple[float, ...],
    seeds: int,
    tmp_path: Path,
    small: Callable[..., Any],
    tell: Callable[..., None],
) -> None:
    killer = counted_case.Killer(after=len(frictions))
    summary = run_campaign(
        small(*frictions, seeds=seeds),
        tmp_path / "out",
        workers=TWO,
        progress=killer,
        run_case=counted_case.counted,
    )
    total = len(frictions) * seeds
    assert (summary["done"], summary["cases"], summary["failed"]) == (total, total, 0)
    ended = Counter(name for name, _ in counted_case.lines("end"))
    begun = Counter(name for name, _ in counted_case.lines("begin"))
    assert len(ended) == total
    assert set(ended.values()) == {1}
    assert killer.victim is not None
    assert begun.pop(killer.victim) == 2
    assert set(begun.values()) == {1}
    tell(cases=total, ended=sum(ended.values()))


def test_a_case_that_kills_its_workers_fails_and_the_others_go_on(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    summary = run_campaign(
        small(seeds=[1, 2]), tmp_path / "out", workers=1, run_case=counted_case.deadly
    )
    assert (summary["done"], summary["failed"]) == (1, 1)
    ((name, reason),) = summary["failures"].items()
    assert "seed1" in name
    assert "ended abruptly 3 times" in reason
    assert len([1 for case, _ in counted_case.lines("begin") if case == name]) == 3


def test_failed_cases_say_why_and_are_run_again_only_on_request(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    def go(**options: Any) -> dict[str, Any]:
        return run_campaign(
            small(seeds=[1, 2]),
            tmp_path / "out",
            workers=1,
            run_case=counted_case.odd_seeds_fail,
            **options,
        )

    first = go()
    assert (first["done"], first["failed"]) == (1, 1)
    assert list(first["failures"].values()) == ["z_0 = 9 was not reached"]
    assert go()["failed"] == 1
    assert len(counted_case.lines("begin")) == 2
    (tmp_path / "mended").touch()
    again = go(retry=True)
    assert (again["done"], again["failed"]) == (2, 0)
    assert len(counted_case.lines("begin")) == 3


@pytest.mark.slow
def test_a_stopped_campaign_goes_on_and_redoes_nothing(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    sweep, folder = small(0.2, 0.5, seeds=2), tmp_path / "out"

    def stop_later(ledger: Any) -> None:
        if ledger.count()["done"] >= 1:
            raise KeyboardInterrupt

    first = run_campaign(
        sweep, folder, workers=1, progress=stop_later, run_case=counted_case.counted
    )
    assert first["stopped"]
    assert first["results"] is None
    assert 1 <= states(folder)["done"] < 4
    assert not states(folder)["running"]
    kept = {row.id for row in read_table(folder / "cases.csv") if row.state == "done"}
    second = run_campaign(sweep, folder, workers=1, run_case=counted_case.counted)
    assert (second["done"], second["stopped"]) == (4, False)
    ended = Counter(name for name, _ in counted_case.lines("end"))
    assert {ended[name] for name in kept} == {1}


def test_a_changed_campaign_adds_cases_and_keeps_the_others(
    tmp_path: Path, small: Callable[..., Any], finished: Path
) -> None:
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)
    before = {row.id: row for row in read_table(folder / "cases.csv")}
    size = {"key": "sample.grain_count", "values": [40]}
    changed = small(seeds=2, parameter=[size, {"key": "material.friction", "values": [0.6, 0.9]}])
    summary = run_campaign(changed, folder, gather_only=True)
    rows = {row.id: row for row in read_table(folder / "cases.csv")}
    assert set(before) < set(rows)
    assert (summary["cases"], summary["done"], summary["waiting"]) == (4, 2, 2)
    assert set(summary["unwanted"]) == {one for one in before if "friction0.1" in one}
    assert {rows[one].reason for one in summary["unwanted"]} == {"no longer in SWEEP.toml"}
    assert {rows[one].state for one in before} == {"done"}


def test_a_folder_with_other_settings_is_not_done(
    tmp_path: Path, small: Callable[..., Any], finished: Path
) -> None:
    folder = tmp_path / "out"
    shutil.copytree(finished, folder)
    name = read_table(folder / "cases.csv")[0].id
    file = folder / "cases" / name / "settings.toml"
    file.write_text(file.read_text().replace("grain_count = 40", "grain_count = 41"))
    summary = run_campaign(small(0.1, 0.6, seeds=2), folder, gather_only=True)
    assert (summary["done"], summary["interrupted"]) == (3, 1)


def test_a_case_is_continued_in_its_folder(
    tmp_path: Path, small: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []

    class Ended:
        summary = {"interrupted": True}  # noqa: RUF012

    def stand_in(case: Any, folder: Path, **options: Any) -> Any:
        calls.append((case.name, folder, options["resume"], os.environ["GRANUFAB_THREADS"]))
        return Ended()

    monkeypatch.setattr(case_work, "run_into_folder", stand_in)
    monkeypatch.setenv("GRANUFAB_THREADS", "1")
    (member,) = expand(small())
    task = Task(id=member.id, case=member.case, folder=tmp_path, start=tmp_path, threads=2)
    outcome = do_task(task, lambda text, share: None)
    assert calls == [(member.id, tmp_path, True, "2")]
    assert outcome.state == "interrupted"


def test_a_case_that_is_done_is_left_alone_when_it_is_handed_out_again(
    finished: Path, small: Callable[..., Any]
) -> None:
    member = expand(small(0.1, 0.6, seeds=2))[0]
    folder = finished / "cases" / member.id
    before = (folder / "run.h5").stat().st_mtime_ns
    task = Task(id=member.id, case=member.case, folder=folder, start=folder)
    assert do_task(task, lambda text, share: None, counted_case.counted).state == "done"
    assert (folder / "run.h5").stat().st_mtime_ns == before
    assert not counted_case.lines("begin")


def test_a_second_campaign_in_the_folder_is_refused(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    with RunLock(folder), pytest.raises(InvalidSettings, match=str(os.getpid())):
        run_campaign(small(0.2), folder)
    assert not (folder / "cases").exists()


@pytest.mark.parametrize(
    ("error", "state", "reason"),
    [
        (KeyboardInterrupt(), "interrupted", ""),
        (MemoryError(), "failed", "not enough memory"),
        (OSError(28, "No space left on device"), "failed", "OSError: [Errno 28] No space"),
        (ZeroDivisionError("a\nb"), "failed", "ZeroDivisionError: a b"),
    ],
)
def test_every_end_of_a_case_is_one_line(
    error: BaseException,
    state: str,
    reason: str,
    tmp_path: Path,
    small: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stand_in(*given: Any, **options: Any) -> Any:
        raise error

    monkeypatch.setattr(case_work, "run_into_folder", stand_in)
    monkeypatch.setenv("GRANUFAB_THREADS", "1")
    (member,) = expand(small())
    task = Task(id=member.id, case=member.case, folder=tmp_path, start=tmp_path)
    outcome: Outcome = do_task(task, lambda text, share: None)
    assert outcome.state == state
    assert outcome.reason.startswith(reason)
    assert "\n" not in outcome.reason


def test_no_core_is_given_two_things_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("granufab.campaign.engine.core_count", lambda: 8)
    assert plan_workers(100, None, None) == (8, 1)
    assert plan_workers(3, None, None) == (3, 2)
    assert plan_workers(100, None, 4) == (2, 4)
    assert plan_workers(100, 3, None) == (3, 2)
    with pytest.raises(InvalidSettings, match="3 workers of 3 threads need 9 cores"):
        plan_workers(100, 3, 3)
    assert plan_workers(100, 30, 3, limited=False) == (30, 3)


@given(st.data())
def test_a_mangled_table_is_read_or_refused(data: st.DataObject) -> None:
    whole = "id,friction,seed,state,reason,seconds\nx-1,0.1,1,done,,2.5\ny-2,0.2,1,failed,no,1\n"
    at = data.draw(st.integers(0, len(whole)))
    cut = data.draw(st.integers(0, 6))
    text = whole[:at] + data.draw(st.text(max_size=4)) + whole[at + cut :]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cases.csv"
        path.write_text(text, encoding="utf-8", newline="")
        try:
            rows = read_table(path)
        except CorruptFile as error:
            assert str(path) in str(error)
        else:
            assert all(row.id and "/" not in row.id for row in rows)


def test_the_table_holds_what_was_promised(finished: Path) -> None:
    with (finished / "cases.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["id", "friction", "seed", "state", "reason", "seconds"]
    assert [(row["friction"], row["seed"], row["state"]) for row in rows] == [
        ("0.1", "1", "done"), ("0.1", "2", "done"), ("0.6", "1", "done"), ("0.6", "2", "done"),
    ]  # fmt: skip
    for row in rows:
        assert (finished / "cases" / row["id"] / "run.h5").exists()
        assert float(row["seconds"]) > 0
