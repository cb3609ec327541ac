"""Series as CSV, datasets as CSV and NetCDF, JSON: round trips and bad input."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from random_frames import random_row

import granufab.io as gio
from granufab.errors import CorruptFile, InvalidSettings, MissingData, UnknownFormat
from granufab.history import SERIES_UNITS, series_dataset

COLUMNS = (
    "path,eps_q,eps_q_total,z,z_backbone,z_mechanical,rattler_fraction,a,a_signed,theta_c,"
    "q_over_p,phi,p,residual,sweeps,overlap,inertial_number"
)


def _series(count: int = 20, name: str = "dense") -> xr.Dataset:
    rng = np.random.default_rng(1)
    return series_dataset([random_row(rng, name) for _ in range(count)], {"path": name})


def _only(folder: Path, *names: str) -> None:
    assert sorted(item.name for item in folder.iterdir()) == sorted(names)


def test_a_series_comes_back_to_ten_digits(tmp_path: Path) -> None:
    series = _series()
    series["theta_c"][3] = np.nan
    gio.write_series(series, tmp_path / "series.csv", "dense")
    assert (tmp_path / "series.csv").read_text().splitlines()[0] == COLUMNS
    got = gio.read_series(tmp_path / "series.csv")
    for name, (units, _) in SERIES_UNITS.items():
        np.testing.assert_allclose(got[name], series[name], rtol=1e-9)
        assert got[name].attrs["units"] == units
    assert set(got["path"].values) == {"dense"}
    assert got.attrs["path"] == "dense"
    _only(tmp_path, "series.csv")


def test_joined_series_keep_each_path_name(tmp_path: Path) -> None:
    paths = []
    for name in ("dense, fast", 'loose "a"'):
        gio.write_series(_series(3, name), tmp_path / "one.csv")
        paths.append(gio.read_series(tmp_path / "one.csv"))
    gio.write_series(xr.concat(paths, "record"), tmp_path / "both.csv")
    got = gio.read_series(tmp_path / "both.csv")
    assert list(got["path"].values) == ["dense, fast"] * 3 + ['loose "a"'] * 3
    assert "path" not in got.attrs


def test_what_a_series_lacks_is_nan(tmp_path: Path) -> None:
    data = xr.Dataset({"z": ("record", [3.5]), "a": ("record", [0.2])})
    gio.write_series(data, tmp_path / "s.csv")
    got = gio.read_series(tmp_path / "s.csv")
    assert float(got["z"][0]) == 3.5
    assert np.isnan(got["phi"][0])


@pytest.mark.parametrize(
    "text",
    [
        "z,a\n3.5,0.2\n3.4,0.25\n",
        "\ufeffz , a_signed\r\n3.5, 0.2\r\n\r\n3.4,0.25\r\n",
        "# made by hand\nz;a;note\n3.5;0.2;first\n3.4;0.25;last\n",
        "a\tz\tpath\tmu\n0.2\t3.5\tp\t0.4\n0.25\t3.4\tp\t0.4\n",
    ],
)
def test_a_users_csv_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.csv"
    path.write_text(text, encoding="utf-8", newline="")
    got = gio.read_series(path)
    np.testing.assert_array_equal(got["z"], [3.5, 3.4])
    np.testing.assert_array_equal(got["a" if "a" in got else "a_signed"], [0.2, 0.25])
    assert "note" not in got
    assert set(got["path"].values) == ({"p"} if "\tp" in text else {"mine"})
    if "mu" in text:
        np.testing.assert_array_equal(got["mu"], [0.4, 0.4])


@pytest.mark.parametrize(
    ("content", "kind", "words"),
    [
        (b"", MissingData, "is empty"),
        (b"z,a\n", MissingData, "no rows"),
        (b"zed,a\n1,2\n", MissingData, "no column z (columns found: zed, a)"),
        (b"z,b\n1,2\n", MissingData, "no column a (or a_signed)"),
        (b"q\n1\n", MissingData, "no column z and no column a"),
        (b"z,a\n3,0.1\n3,high\n", CorruptFile, "line 3, column a: 'high' is not a number"),
        (b"# c\nz,a\n\n3,0.1,9\n", CorruptFile, "line 4: 3 cells, but the header has 2"),
        (b"z,a,z\n3,0.1,9\n", CorruptFile, "column z is there twice"),
        (b"\x89PNG\xff\x00\xfe", UnknownFormat, "not a text file"),
    ],
)
def test_bad_csv_is_named_in_one_line(
    tmp_path: Path, content: bytes, kind: type[Exception], words: str
) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(kind) as caught:
        gio.read_series(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_csv_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingData, match="no such file"):
        gio.read_series(tmp_path / "none.csv")
    with pytest.raises(MissingData, match="cannot be opened"):
        gio.read_series(tmp_path)


def _measures() -> xr.Dataset:
    return xr.Dataset(
        {
            "z": ("frame", [3.5, np.nan], {"units": "-", "bounds": None, "signed": True}),
            "rattlers": ("frame", np.array([3, 4])),
            "source": ("frame", ["run.h5", "run.h5"]),
        },
        coords={"frame": [0, 1]},
        attrs={"criterion": "force", "settings": {"mu": 0.4}, "strict": False},
    )


def test_datasets_as_csv_and_netcdf(tmp_path: Path) -> None:
    gio.write_dataset(_measures(), tmp_path / "m.csv")
    assert (tmp_path / "m.csv").read_text() == (
        "frame,z,rattlers,source\n0,3.5,3,run.h5\n1,nan,4,run.h5\n"
    )
    gio.write_dataset(_measures(), tmp_path / "m.nc")
    with xr.open_dataset(tmp_path / "m.nc", engine="scipy") as got:
        np.testing.assert_array_equal(got["z"], [3.5, np.nan])
        assert got["z"].attrs["units"] == "-"
        assert list(got["source"].values.astype(str)) == ["run.h5", "run.h5"]
        assert got.attrs["criterion"] == "force"
        assert json.loads(got.attrs["settings"]) == {"mu": 0.4}
    _only(tmp_path, "m.csv", "m.nc")


def test_datasets_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidSettings, match=r"\.xlsx, allowed \.csv or \.nc"):
        gio.write_dataset(_measures(), tmp_path / "m.xlsx")
    wide = xr.Dataset({"E": (("frame", "theta"), np.ones((2, 3)))})
    with pytest.raises(InvalidSettings, match="frame: 2, theta: 3"):
        gio.write_dataset(wide, tmp_path / "m.csv")
    huge = xr.Dataset({"count": ("frame", np.array([2**60]))})
    with pytest.raises(InvalidSettings, match="do not fit NetCDF 3"):
        gio.write_dataset(huge, tmp_path / "m.nc")
    _only(tmp_path)


@dataclass(frozen=True)
class _Record:
    value: float


def test_json_is_strict_and_knows_numpy(tmp_path: Path) -> None:
    data = {
        "z": np.float64(3.5),
        "steps": np.int64(3),
        "done": np.bool_(True),
        "nan": float("nan"),
        "list": np.array([1.0, np.inf]),
        "record": _Record(np.nan),
        "path": Path("a/b"),
        5: (1, "é"),
    }
    gio.write_json(data, tmp_path / "deep" / "summary.json")

    def refuse(constant: str) -> Any:
        raise AssertionError(constant)

    text = (tmp_path / "deep" / "summary.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=refuse) == {
        "z": 3.5,
        "steps": 3,
        "done": True,
        "nan": None,
        "list": [1.0, None],
        "record": {"value": None},
        "path": "a/b",
        "5": [1, "é"],
    }
    _only(tmp_path / "deep", "summary.json")


def test_a_failed_write_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    gio.write_text("old", path)
    with pytest.raises(InvalidSettings, match="complex"):
        gio.write_json({"x": 1j}, path)
    (tmp_path / "folder").mkdir()
    for place in (tmp_path / "folder", path / "below" / "x.json"):
        with pytest.raises(InvalidSettings, match="cannot be written") as caught:
            gio.write_json({}, place)
        assert "\n" not in str(caught.value)
    assert path.read_text() == "old"
    _only(tmp_path, "folder", "summary.json")
    _only(tmp_path / "folder")


def test_a_format_is_told_from_content(tmp_path: Path) -> None:
    gio.RunFileWriter(tmp_path / "data.csv", settings={}).close()
    assert gio.detect(tmp_path / "data.csv").name == "granufab run file"
    assert set(gio.provenance()) >= {"granufab", "python", "numpy", "numba", "h5py", "cpu"}
    assert gio.cpu_name()
