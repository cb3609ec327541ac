"""Progress off a terminal: a line now and then, with the time that is left."""

from __future__ import annotations

import pytest

from granufab.cli import progress


def test_lines_come_every_few_seconds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    with progress.show_progress() as report:
        for step in range(11):
            report("shearing", 0.1 * step)
            clock[0] += 1.0
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "shearing: 50 %, about 5 s left",
        "shearing: 100 %, about 0 s left",
    ]


def test_a_new_part_of_the_work_starts_its_own_clock(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    with progress.show_progress() as report:
        report("compacting", 0.9)
        clock[0] = 20.0
        report("shearing", 0.0)
        clock[0] = 30.0
        report("shearing", 0.5)
    assert capsys.readouterr().err.splitlines()[-1] == "shearing: 50 %, about 10 s left"
