"""The example of docs/campaigns.md runs as written, save for fewer grains and less strain."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from granufab.cli import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "campaigns.md"
SMALLER = {
    "grain_count = 300": "grain_count = 40",
    "strain = 0.2": "strain = 0.01",
    "seeds = 3": "seeds = 2",
    "[0.1, 0.2, 0.4, 0.8]": "[0.2, 0.8]",
}


def _blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def _granufab(line: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(shlex.split(line)[1:])
    assert ended.value.code == 0, line


def test_the_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GRANUFAB_THREADS", raising=False)
    (text,) = _blocks("toml")
    for full, small in SMALLER.items():
        assert full in text
        text = text.replace(full, small)
    text += "\n[case.record]\nseries_interval = 1e-4\n"
    Path("friction.toml").write_text(text, encoding="utf-8")
    for line in _blocks("sh")[0].splitlines():
        _granufab(line)
    assert Path("friction.png").stat().st_size > 10_000
    capsys.readouterr()
    (code,) = _blocks("python")
    exec(compile(code, PAGE.name, "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["µ = 0.2", "µ = 0.8"]
    values = [float(re.findall(r"z\* = ([\d.]+)", line)[0]) for line in lines]
    assert 4.2 > values[0] > values[1] > 2.5  # friction lets fewer contacts carry
    write = _blocks("sh")[1].splitlines()
    _granufab(write[0])
    _granufab(write[2])
    assert len(Path("friction/manifest.csv").read_text().splitlines()) == 5
