"""``balance`` on a run file: integers that close, in JSON, in tables and in a figure."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from moving_run import moving_run

from granufab.history import Frame
from granufab.packing import Cell, Contacts, Grains, Packing

LISTS = ("before", "after", "gain", "loss", "current_in", "current_out")


def one_line(done, *words: str) -> None:
    """Exit code 2, and one line on standard error that holds the words."""
    assert done.code == 2, done
    assert done.out == ""
    assert done.err.count("\n") == 1, done.err
    for word in words:
        assert word in done.err


@pytest.fixture
def turning_run(tmp_path: Path) -> Path:
    """Four states of twelve disks; contacts come, go and turn at random."""
    from granufab.io import RunFileWriter
    from granufab.simulate.settings import Case

    generator = np.random.default_rng(1)
    position = generator.random((12, 2)) * 10
    pairs = np.column_stack(np.triu_indices(12, 1))
    angle = generator.random(len(pairs)) * np.pi
    path = tmp_path / "turning.h5"
    with RunFileWriter(path, settings=Case(name="made-up").model_dump(mode="json")) as writer:
        for index in range(4):
            angle = angle + generator.normal(0, 0.3, len(pairs))
            here = generator.random(len(pairs)) < 0.6
            normal = np.column_stack([np.cos(angle), np.sin(angle)])[here]
            packing = Packing(
                grains=Grains(
                    position=position,
                    radius=np.full(12, 0.5),
                    mass=np.ones(12),
                    velocity=np.zeros((12, 2)),
                    spin=np.zeros((12, 1)),
                ),
                contacts=Contacts(
                    pair=pairs[here],
                    normal=normal,
                    branch=normal,
                    gap=np.zeros(len(normal)),
                    force=normal,
                    image=np.zeros((len(normal), 2), dtype=int),
                ),
                cell=Cell(matrix=10 * np.eye(2)),
                time=float(index),
            )
            writer.frame(
                Frame(
                    packing=packing,
                    eps_q=0.01 * index,
                    eps_q_total=0.01 * index,
                    strain=np.zeros((2, 2)),
                    stage=0,
                    stress=np.eye(2),
                    inertial_number=1e-3,
                    direction=np.array([0.0, 1.0]),
                )
            )
    return path


def test_json_closes_in_integers(granufab, turning_run: Path) -> None:
    done = granufab("balance", turning_run, "--json", "--bins", 7)
    assert done.code == 0, done
    intervals = json.loads(done.out)
    assert [(i["frame_before"], i["frame_after"]) for i in intervals] == [(0, 1), (1, 2), (2, 3)]
    for item in intervals:
        before, after, gain, loss, entered, left = (np.array(item[name]) for name in LISTS)
        assert all(isinstance(n, int) for name in LISTS for n in item[name])
        assert before.shape == (7,)
        np.testing.assert_array_equal(before + gain - loss + entered - left, after)
        assert item["gained"] == gain.sum() > 0
        assert item["lost"] == loss.sum() > 0
        assert item["persistent"] == before.sum() - loss.sum()
        assert item["current"] == [*item["current_in"], item["current_out"][-1]]
        assert item["criterion"] == "force"
        assert item["source"] == str(turning_run)
        assert item["bin_edges"] == pytest.approx(np.linspace(0, np.pi, 8))
        assert item["direction"] == [0.0, 1.0]
        assert item["grain_count"] == 12
    assert [i["eps_q"] for i in intervals] == pytest.approx([0.01, 0.02, 0.03])
    assert intervals[0]["after"] == intervals[1]["before"]


def test_longer_intervals(granufab, turning_run: Path) -> None:
    (item,) = json.loads(granufab("balance", turning_run, "--interval", 2, "--json").out)
    assert (item["frame_before"], item["frame_after"]) == (0, 2)
    assert item["eps_q"] == pytest.approx(0.02)


def test_the_lattice_does_not_change(granufab, run_file: Path) -> None:
    for item in json.loads(granufab("balance", run_file, "--json").out):
        assert (item["gained"], item["lost"], item["persistent"]) == (0, 0, 32)
        assert not any(item["current"])


def test_the_table_for_people(granufab, turning_run: Path) -> None:
    done = granufab("balance", turning_run, "--keep", 0.02)
    assert done.code == 0
    assert "kept to a gap of 0.02" in done.out
    for frames in ("0–1", "1–2", "2–3"):
        assert frames in done.out


def test_mean_rates_over_a_window(granufab, turning_run: Path) -> None:
    items = json.loads(granufab("balance", turning_run, "--json").out)[1:]
    done = granufab("balance", turning_run, "--window", 0.01, 0.03)
    assert done.code == 0
    words = done.out.splitlines()[-1].split()
    assert words[:4] == ["mean", "over", "∫|dε_q|", "="]
    for name, sign in (("gained", "I+"), ("lost", "I-")):
        rate = sum(item[name] for item in items) / 0.02 / 12  # per unit strain and grain
        assert float(words[words.index(sign) + 1]) == pytest.approx(rate, rel=1e-3)
    late = granufab("balance", turning_run, "--window", 1, 2)
    assert "no interval lies within the strain window" in late.out


def test_the_contacts_of_another_definition(granufab, tmp_path: Path) -> None:
    run = moving_run(tmp_path / "run.h5")  # every pair in reach is a contact: some lone pairs
    every, held = (
        json.loads(granufab("balance", run, "--json", *options).out)
        for options in ((), ("--z-definition", "z_backbone"))
    )
    assert {item["z_definition"] for item in every} == {"z"}
    assert {item["z_definition"] for item in held} == {"z_backbone"}
    assert sum(held[0]["before"]) < sum(every[0]["before"])


def test_tables_and_figure(granufab, turning_run: Path, tmp_path: Path) -> None:
    table, data, figure = (tmp_path / name for name in ("b.csv", "b.nc", "b.pdf"))
    assert granufab("balance", turning_run, "--bins", 5, "--out", table, "-o", figure).code == 0
    assert figure.read_bytes().startswith(b"%PDF")
    with table.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 3 * 5
    for row in rows:
        before, after, gain, loss, entered, left = (float(row[name]) for name in LISTS)
        assert before + gain - loss + entered - left == after
    assert granufab("balance", turning_run, "--bins", 5, "--out", data).code == 0
    with xr.open_dataset(data, engine="scipy") as read:
        assert dict(read.sizes) == {"interval": 3, "bin": 5, "edge": 6}
        assert read["theta_edge"].attrs["units"] == "rad"
    one_line(granufab("balance", turning_run, "-o", figure), "exists")
    one_line(granufab("balance", turning_run, "--out", data), "exists")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--interval", 0), ("at least 1", "0")),
        (("--interval", 9), ("no interval of 9 frames", "3")),
        (("--bins", 1), ("bins", "at least 2")),
        (("--criterion", "near"), ("near", "gap:DELTA")),
        (("--keep", -0.1), ("keep", "-0.1")),
        (("--criterion", "gap:0.1", "--keep", 0.05), ("keep", "0.1..1")),
        (("--out", "table.txt"), (".csv",)),
        (("-o", "figure.doc"), (".pdf",)),
    ],
)
def test_bad_options(granufab, turning_run: Path, options, words) -> None:
    one_line(granufab("balance", turning_run, *options), *words)


def test_no_such_run(granufab, tmp_path: Path) -> None:
    one_line(granufab("balance", tmp_path / "none.h5"), "none.h5")
