"""``plot`` writes each figure as a picture of the asked kind, and nothing where it cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

import matplotlib.image
import numpy as np
import pytest
from moving_run import moving_run

from granufab import fabric
from granufab.cli import plot, plot_figures
from granufab.io import read

FIGURES = ["path", "zaz", "series", "mohr", "rose", "network", "branches", "forces", "texture"]
FIGURES += ["sff", "criterion"]


def test_every_figure_of_the_command_line_can_be_drawn() -> None:
    assert list(get_args(plot.Name)) == list(plot_figures.FIGURES)


@pytest.mark.parametrize("figure", ["velocity", "fluctuations", "balance", "homogeneity"])
def test_figures_of_motion(granufab, tmp_path: Path, figure: str) -> None:
    out = tmp_path / f"{figure}.png"
    done = granufab("plot", moving_run(tmp_path / "run.h5"), "--figure", figure, "-o", out)
    assert done.code == 0, done.err
    picture = matplotlib.image.imread(out)
    assert picture[..., :3].min() < 0.5 < picture[..., :3].max()


def test_the_network_of_spheres(granufab, tmp_path: Path) -> None:
    run, out = moving_run(tmp_path / "run.h5", dimension=3), tmp_path / "network.png"
    assert granufab("plot", run, "--figure", "network", "-o", out).code == 0
    colours = matplotlib.image.imread(out)[..., :3].reshape(-1, 3)
    assert len(np.unique(np.round(colours, 2), axis=0)) > 50  # the farther, the paler


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_mohr_circle_spans_the_measured_values(tmp_path: Path, dimension: int) -> None:
    """In 3D whatever the middle one is: a fabric in extension is none in compression."""
    run = read(moving_run(tmp_path / "run.h5", dimension))
    request = plot_figures.Request(
        figure="mohr", runs={"run": run}, index=-1, criterion="force", z_definition="z_backbone"
    )
    drawn = next(
        line
        for line in plot_figures.FIGURES["mohr"](request).get_lines()
        if line.get_label() == run.name
    )
    values = fabric.measure(run.frames[-1].packing)
    assert np.max(drawn.get_xdata()) == pytest.approx(values["g_1"], rel=1e-4)
    assert np.min(drawn.get_xdata()) == pytest.approx(values[f"g_{dimension}"], rel=1e-4)


def test_runs_are_labelled_by_name_where_names_differ(run_file: Path) -> None:
    run = read(run_file)
    options = {"figure": "rose", "index": -1, "criterion": "force", "z_definition": "z"}
    other = replace(run, name="another")
    different = plot_figures.Request(runs={"a.h5": run, "b.h5": other}, **options)
    assert list(different.labels.values()) == ["made-up", "another"]
    alike = plot_figures.Request(runs={"a.h5": run, "b.h5": run}, **options)
    assert list(alike.labels.values()) == ["a.h5", "b.h5"]


def test_a_figure_of_one_state_takes_one_run(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "forces.png"
    other = tmp_path / "other.h5"
    other.write_bytes(run_file.read_bytes())
    done = granufab("plot", run_file, other, "--figure", "forces", "-o", out)
    assert done.code == 2
    assert "forces draws one run, got 2" in done.err


@pytest.mark.parametrize("figure", FIGURES)
def test_each_figure_is_drawn(granufab, run_file: Path, tmp_path: Path, figure: str) -> None:
    out = tmp_path / f"{figure}.png"
    done = granufab("plot", run_file, "--figure", figure, "-o", out)
    assert done.code == 0, done.err
    picture = matplotlib.image.imread(out)
    assert picture.shape[0] > 300
    assert picture.shape[1] > 300
    assert picture[..., :3].min() < 0.5 < picture[..., :3].max()  # ink on paper


def test_the_ending_decides_the_kind(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "rose.pdf"
    assert granufab("plot", run_file, "--figure", "rose", "-o", out, "--frame", 0).code == 0
    assert out.read_bytes().startswith(b"%PDF")


def test_an_unknown_ending(granufab, run_file: Path, tmp_path: Path) -> None:
    done = granufab("plot", run_file, "--figure", "rose", "-o", tmp_path / "rose.doc")
    assert done.code == 2
    assert ".pdf" in done.err


def test_a_folder_that_is_not_there(granufab, run_file: Path, tmp_path: Path) -> None:
    done = granufab("plot", run_file, "--figure", "rose", "-o", tmp_path / "no" / "rose.png")
    assert done.code == 2
    assert "no folder" in done.err


def test_a_state_that_is_not_there(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "rose.png"
    done = granufab("plot", run_file, "--figure", "rose", "-o", out, "--frame", 7)
    assert done.code == 2
    assert "0..2" in done.err
    assert not out.exists()


def test_no_overwriting_without_force(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "rose.png"
    out.write_text("precious", encoding="utf-8")
    done = granufab("plot", run_file, "--figure", "rose", "-o", out)
    assert done.code == 2
    assert out.read_text(encoding="utf-8") == "precious"
    assert granufab("plot", run_file, "--figure", "rose", "-o", out, "--force").code == 0
    assert out.read_bytes().startswith(b"\x89PNG")
