"""What a campaign gives: fits of each case and over its seeds, as dataset and as figure."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from granufab.campaign import gather
from granufab.errors import InvalidSettings, MissingData
from granufab.io import read
from granufab.plots import parameter_curves
from granufab.reproduce.series_fit import fit_series
from granufab.reproduce.symmetry import described_series


@pytest.fixture(scope="module")
def results(finished: Path) -> xr.Dataset:
    return gather(finished)


def test_parameters_are_coordinates(results: xr.Dataset) -> None:
    assert results.sizes == {"case": 4}
    assert results["friction"].values.tolist() == [0.1, 0.1, 0.6, 0.6]
    assert results["friction"].attrs["long_name"] == "material.friction"
    assert results["seed"].values.tolist() == [1, 2, 1, 2]
    assert results["point"].values.tolist() == [0, 0, 1, 1]
    assert set(results["note"].values.tolist()) == {""}


def test_each_case_is_fitted_as_by_the_verb_fit(results: xr.Dataset, finished: Path) -> None:
    for name in results["case"].values.tolist():
        run = read(finished / "cases" / name / "run.h5")
        fit, _ = fit_series([described_series(run)])
        row = results.sel(case=name)
        for quantity in ("z_star", "a_star", "z_min", "z_max"):
            one = getattr(fit, quantity)
            got = [float(row[f"{quantity}{part}"]) for part in ("", "_low", "_high")]
            assert got == [one.value, one.low, one.high]
        assert float(row["z_0"]) == run.summary["z_0"]
        steps = run.summary["steps"]
        assert float(row["nonconverged_share"]) == run.summary["nonconverged_steps"] / steps


def test_seeds_are_averaged_and_widen_the_interval(results: xr.Dataset) -> None:
    for name in ("z_star", "q_over_p_star", "phi_star"):
        own = results[name].values.reshape(2, 2)
        over = results[f"{name}_seeds"].values.reshape(2, 2)
        np.testing.assert_allclose(over, np.mean(own, axis=1, keepdims=True) + 0 * own, rtol=1e-9)
        low, high = (results[f"{name}_seeds_{end}"].values.reshape(2, 2) for end in ("low", "high"))
        assert (low <= own.min(axis=1, keepdims=True) + 1e-9).all()
        assert (high >= own.max(axis=1, keepdims=True) - 1e-9).all()


def test_the_file_holds_the_dataset(results: xr.Dataset, finished: Path) -> None:
    with xr.open_dataset(finished / "results.nc", engine="scipy") as found:
        assert set(found.data_vars) == set(results.data_vars)
        for name in (*results.data_vars, "friction", "seed", "point"):
            np.testing.assert_array_equal(found[name].values, results[name].values)
        assert found["case"].values.tolist() == results["case"].values.tolist()


def test_a_damaged_run_is_said_and_the_others_stay(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished, tmp_path / "out")
    name = gather(finished)["case"].values.tolist()[0]
    (tmp_path / "out" / "cases" / name / "run.h5").write_bytes(b"nothing")
    found = gather(tmp_path / "out")
    assert "run.h5" in str(found["note"].values[0])
    assert np.isnan(found["z_star"].values).tolist() == [True, False, False, False]
    assert not np.isnan(found["z_star_seeds"].values).any()


def test_a_folder_without_a_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingData, match=r"holds no campaign \(no campaign.json\)"):
        gather(tmp_path)


def test_a_figure_shows_what_the_dataset_holds(results: xr.Dataset) -> None:
    panels = parameter_curves(results, "friction")
    assert [panel.get_ylabel() for panel in panels][:2] == ["$z^*$ [-]", "$a^*$ [-]"]
    assert panels[-1].get_xlabel() == r"$\mu$"
    (line,) = panels[0].lines
    assert list(line.get_xdata()) == [0.1, 0.6]
    assert list(line.get_ydata()) == results["z_star_seeds"].values[[0, 2]].tolist()
    assert len(panels[0].collections) == 1


def test_a_second_parameter_gives_a_line_each(results: xr.Dataset) -> None:
    (panel,) = parameter_curves(results, "material.friction", by="seed", quantities=["phi_star"])
    legend = panel.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["1", "2"]
    (one,) = parameter_curves(results, "friction", quantities=["z_0"], where={"friction": "0.6"})
    assert list(one.lines[0].get_xdata()) == [0.6, 0.6]


@pytest.mark.parametrize(
    ("against", "options", "words"),
    [
        ("nothing", {}, "unknown parameter nothing, allowed friction, seed"),
        ("friction", {"quantities": ["z"]}, "unknown quantity z, allowed z_star"),
        ("friction", {"where": {"friction": "x"}}, "friction = x: expected a number"),
        ("friction", {"by": "mu"}, "unknown parameter mu"),
    ],
)
def test_bad_figures_are_refused(
    against: str, options: dict, words: str, results: xr.Dataset
) -> None:
    with pytest.raises(InvalidSettings, match=words):
        parameter_curves(results, against, **options)


def test_nothing_to_draw_is_said(results: xr.Dataset) -> None:
    with pytest.raises(MissingData, match="no finished case has friction = 7"):
        parameter_curves(results, "friction", where={"friction": 7})
