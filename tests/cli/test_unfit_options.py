"""Options of foreign data that do not fit the data are refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from foreign_tables import sheared_squares

import granufab as gf
from granufab.errors import InvalidSettings

STACKED = "x,y,z,r\n0,0,0,0.5\n1,0,0,0.5\n0,1,3,0.5\n1,1,4,0.5\n"


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--cell", "4,-4"), "cell is 4,-4, its edges must be finite and > 0"),
        (("--cell", "4,nan"), "its edges must be finite"),
        (("--cell", "0.5,0.5"), "the grains have 50.3 times its volume"),
        (("--cell", "4,4", "--periodic", "xz"), "the axes of the data are xy"),
        (("--periodic", "xy"), "has no cell; give it (--cell)"),
        (("--axis", "z"), "2D data have x and y"),
        (("--axis", "0,0,1"), "allowed: x, y, z or components"),
        (("--strain", "nan"), "strain is nan"),
        (("--radius", "inf"), "radius is inf"),
    ],
)
def test_an_option_that_does_not_fit_is_one_line(granufab, tmp_path, options, part) -> None:
    done = granufab("measure", *sheared_squares(tmp_path, 2), *options, "--json")
    assert (done.code, done.out) == (2, ""), done.err
    assert part in done.err
    assert len(done.err.splitlines()) == 1


def test_grains_above_each_other_are_no_disks(granufab, tmp_path: Path) -> None:
    table = tmp_path / "stacked.csv"
    table.write_text(STACKED, encoding="utf-8")
    done = granufab("measure", table, "--dimension", 2)
    assert done.code == 2
    assert "spread over 4 along z" in done.err


def test_two_components_are_an_axis_in_3d(tmp_path: Path) -> None:
    table = tmp_path / "stacked.csv"
    table.write_text(STACKED, encoding="utf-8")
    direction = gf.read(table, axis="0,2").frames[0].direction
    assert direction.tolist() == [0.0, 1.0, 0.0]


def test_the_axes_of_a_cell_are_those_of_flat_data(tmp_path: Path) -> None:
    table = tmp_path / "flat.csv"
    table.write_text("x,y,z,r\n0,5,0,0.5\n1,5,0,0.5\n0,5,1,0.5\n1,5,1,0.5\n", encoding="utf-8")
    cell = gf.read(table, cell=(2, 2), periodic="z").frames[0].packing.cell
    assert cell is not None
    assert cell.periodic == (False, True)


def test_a_run_file_takes_no_options_of_foreign_data(run_file: Path) -> None:
    with pytest.raises(InvalidSettings, match="'cell' is for other programs' data"):
        gf.read(run_file, cell=(1, 1))


@pytest.mark.parametrize(
    ("figure", "part"),
    [("path", "no path to draw"), ("zaz", "no path to draw"), ("series", "give --strain")],
)
def test_figures_of_states_without_contacts_are_refused(
    granufab, tmp_path: Path, figure: str, part: str
) -> None:
    table = tmp_path / "apart.csv"
    table.write_text("x,y,r\n0,0,0.5\n3,0,0.5\n0,3,0.5\n3,4,0.5\n", encoding="utf-8")
    done = granufab("plot", table, "--figure", figure, "-o", tmp_path / "out.png")
    assert done.code == 2
    assert part in done.err.splitlines()[-1]
    assert "Traceback" not in done.err
    assert not (tmp_path / "out.png").exists()


def test_info_counts_the_bytes_of_a_folder(granufab, tmp_path: Path) -> None:
    from granufab.cli.info import _size

    (tmp_path / "a").write_bytes(b"12345")
    (tmp_path / "b").write_bytes(b"123")
    assert _size(tmp_path) == 8
    assert _size(tmp_path / "a") == 5
