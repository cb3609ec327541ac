"""Where ``reproduce`` and ``run`` may write, what they replace, and what they refuse."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic_run import reproduce_synthetic, synthetic_run

from granufab.errors import GranufabError, InvalidSettings
from granufab.io import read
from granufab.reproduce import reproduce, run_into_folder
from granufab.reproduce.case_folder import RUN_FILES
from granufab.reproduce.out_folder import prepare_out_folder
from granufab.simulate.settings import Case, Sample, load_case


@pytest.fixture
def earlier(tmp_path: Path, single: Any) -> Path:
    """A folder as ``reproduce fig7`` leaves it."""
    return Path(shutil.copytree(single[0], tmp_path / "earlier"))


def test_an_earlier_result_is_replaced(earlier: Path) -> None:
    assert prepare_out_folder("fig7", ["fig7"], earlier) == earlier
    assert list(earlier.iterdir()) == []


def test_foreign_files_need_force_and_stay(earlier: Path) -> None:
    (earlier / "notes.txt").write_text("mine")
    before = sorted(earlier.rglob("*"))
    with pytest.raises(InvalidSettings, match=r"notes\.txt.*force"):
        prepare_out_folder("fig7", ["fig7"], earlier)
    assert sorted(earlier.rglob("*")) == before
    prepare_out_folder("fig7", ["fig7"], earlier, force=True)
    assert [entry.name for entry in earlier.iterdir()] == ["notes.txt"]


def test_the_default_folder_is_replaced_but_never_what_is_not_ours(
    earlier: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    default = earlier.rename(tmp_path / "granufab-fig7")
    (default / "notes.txt").write_text("mine")
    (default / "runs" / "dense" / "drawing.svg").write_text("mine")
    prepare_out_folder("fig7", ["fig7"], None)
    assert sorted(entry.name for entry in default.iterdir()) == ["notes.txt", "runs"]
    assert (default / "runs" / "dense" / "drawing.svg").read_text() == "mine"


def test_the_result_of_another_figure_is_foreign(earlier: Path) -> None:
    with pytest.raises(InvalidSettings, match=r"holds fig7"):
        prepare_out_folder("fig5", ["fig5"], earlier)


def test_a_runs_folder_of_someone_else_is_not_touched(tmp_path: Path) -> None:
    theirs = tmp_path / "out" / "runs" / "a" / "data.bin"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("mine")
    with pytest.raises(InvalidSettings, match="holds runs"):
        reproduce_synthetic("fig7", tmp_path / "out")
    assert theirs.read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"figure": "fig9"}, "fig9.*known: fig1, fig2, .*fig8, all"),
        ({"figure": "fig7", "grains": 0}, "grains must be at least 1, got 0"),
        ({"figure": "fig7", "seeds": 0}, "seeds must be at least 1, got 0"),
        ({"figure": "fig7", "seed": -1}, "seed must be at least 0, got -1"),
    ],
)
def test_bad_input_is_one_clear_line(tmp_path: Path, options: Any, words: str) -> None:
    with pytest.raises(InvalidSettings, match=words) as caught:
        reproduce(out=tmp_path / "out", run_case=synthetic_run, **options)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_said_before_computing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InvalidSettings, match="file"):
            reproduce_synthetic("fig7", out)
        with pytest.raises(InvalidSettings, match="cannot be written"):
            run_into_folder(Case(), out, run_case=_never)


def _never(*_: Any, **__: Any) -> Any:
    raise AssertionError("nothing may be computed")


def test_a_run_folder_can_be_read_back_and_is_not_overwritten(tmp_path: Path) -> None:
    case = Case(name="one", sample=Sample(grain_count=100, coordination=3.5, seed=7))
    run = run_into_folder(case, tmp_path / "one", run_case=synthetic_run)
    assert {entry.name for entry in (tmp_path / "one").iterdir()} == set(RUN_FILES)
    assert load_case(tmp_path / "one" / "settings.toml") == case
    stored = read(tmp_path / "one" / "run.h5")
    np.testing.assert_array_equal(stored.series["z_backbone"], run.series["z_backbone"])
    assert json.loads((tmp_path / "one" / "summary.json").read_text())["z_0"] == 3.5
    before = (tmp_path / "one" / "run.h5").read_bytes()
    with pytest.raises(InvalidSettings, match=r"run\.h5.*force"):
        run_into_folder(case, tmp_path / "one", run_case=_never)
    assert (tmp_path / "one" / "run.h5").read_bytes() == before
    run_into_folder(case, tmp_path / "one", run_case=synthetic_run, force=True)


def test_an_unforeseen_error_in_a_worker_is_one_line_too(tmp_path: Path) -> None:
    with pytest.raises(GranufabError, match="path dense: AssertionError: nothing may be") as caught:
        reproduce("fig7", out=tmp_path / "out", run_case=_never, workers=1)
    assert "\n" not in str(caught.value)
