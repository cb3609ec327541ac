"""The example on the page about states runs on a CSV."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "states.md"


def test_example_fits_a_csv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    strain = np.linspace(0.0, 0.3, 121)
    decay = np.exp(-strain / 0.01)
    low, high = 3.0 + 0.3 * decay, 3.8 - 0.5 * decay
    z, a = (low + high) / 2, 2 * (high - low) / (high + low)
    np.savetxt(
        tmp_path / "series.csv",
        np.column_stack([strain, z, a]),
        delimiter=",",
        header="eps_q,z,a",
        comments="",
    )
    monkeypatch.chdir(tmp_path)
    example = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    names: dict = {}
    exec(compile(example, PAGE.name, "exec"), names)
    assert names["fit"].z_min.value == pytest.approx(3.0, abs=1e-3)
    assert names["fit"].z_max.value == pytest.approx(3.8, abs=1e-3)


def test_example_walks_a_dense_sample_through_a_reversal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = PAGE.with_name("evolution.md")
    example = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)[0]
    exec(compile(example, page.name, "exec"), {})
    peak, last = (float(word) for word in capsys.readouterr().out.split())
    a_star = 2 * (3.65 - 2.73) / (3.65 + 2.73)
    assert peak > a_star + 0.03
    assert last == pytest.approx(-a_star, abs=0.01)
