"""What is written for other programs reads back as it was, or is not written at all."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from foreign_states import assert_same_packing, touching

import granufab
from granufab.errors import InvalidSettings
from granufab.fabric import measure
from granufab.history import Run, series_dataset
from granufab.io import WRITERS, write
from granufab.packing import Cell, Packing


def _read(files: tuple[Path, ...]) -> Packing:
    return granufab.read(*files).frames[0].packing


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", ["a.vtkhdf", "a.vtp"])
def test_grains_contacts_and_forces_come_back(tmp_path: Path, dimension: int, name: str) -> None:
    wanted = touching(dimension)
    got = _read(write(wanted, tmp_path / name))
    assert_same_packing(got, wanted, contacts=True)
    assert got.time == wanted.time
    one, two = measure(got, z_definition="z"), measure(wanted, z_definition="z")
    assert one["contact_count"] == two["contact_count"] > 10
    assert (one["z"], one["a"]) == pytest.approx((two["z"], two["a"]), rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", ["a.xyz", "a.data"])
def test_grains_and_cell_come_back(tmp_path: Path, dimension: int, name: str) -> None:
    wanted = touching(dimension)
    got = _read(write(wanted, tmp_path / name))
    assert_same_packing(got, wanted, contacts=False)
    assert got.contacts is None


@pytest.mark.parametrize("dimension", [2, 3])
def test_yade_text_comes_back(tmp_path: Path, dimension: int) -> None:
    wanted = touching(dimension)
    got = _read(write(wanted, tmp_path / "a.txt"))
    np.testing.assert_array_equal(got.grains.position, wanted.grains.position)
    np.testing.assert_array_equal(got.grains.radius, wanted.grains.radius)


def test_csv_tables_hold_every_digit(tmp_path: Path) -> None:
    wanted = touching(3)
    grains, contacts = write(wanted, tmp_path / "a.csv")
    assert (grains.name, contacts.name) == ("a_grains.csv", "a_contacts.csv")
    rows = list(csv.DictReader(grains.open()))
    place = np.array([[float(row[name]) for name in ("x", "y", "z")] for row in rows])
    np.testing.assert_array_equal(place, wanted.grains.position)
    assert [float(row["radius"]) for row in rows] == wanted.grains.radius.tolist()
    number = [int(row["id"]) for row in rows]
    listed = wanted.contacts
    assert listed is not None
    rows = list(csv.DictReader(contacts.open()))
    pair = [[number.index(int(row["id1"])), number.index(int(row["id2"]))] for row in rows]
    np.testing.assert_array_equal(pair, listed.pair)
    for prefix, vectors in (("n", listed.normal), ("f", listed.force)):
        got = np.array([[float(row[f"{prefix}{axis}"]) for axis in "xyz"] for row in rows])
        np.testing.assert_array_equal(got, vectors)


@pytest.mark.parametrize("key", WRITERS)
def test_nothing_is_replaced_without_force(tmp_path: Path, key: str) -> None:
    path = tmp_path / f"a{WRITERS[key].suffixes[0]}"
    files = write(touching(2), path)
    before = [file.read_bytes() for file in files]
    other = touching(2, seed=2)
    with pytest.raises(InvalidSettings, match="exists already"):
        write(other, path, key)
    assert [file.read_bytes() for file in files] == before
    write(other, path, key, force=True)
    assert files[0].read_bytes() != before[0]
    assert sorted(tmp_path.iterdir()) == sorted(files)  # no temporary file is left


@pytest.mark.parametrize("key", WRITERS)
def test_a_write_that_fails_leaves_what_was_there(
    tmp_path: Path, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.any"
    files = write(touching(2), path, key)
    before = [file.read_bytes() for file in files]
    fill = WRITERS[key].fill

    def failing(states: object, names: object) -> None:
        fill(states, names)  # type: ignore[arg-type]
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(WRITERS, key, dataclasses.replace(WRITERS[key], fill=failing))
    with pytest.raises(OSError, match=r"cannot be written \(No space left on device\)"):
        write(touching(2, seed=2), path, key, force=True)
    assert [file.read_bytes() for file in files] == before
    assert sorted(tmp_path.iterdir()) == sorted(files)


@pytest.mark.parametrize("key", WRITERS)
def test_a_bare_packing_can_be_written(tmp_path: Path, key: str) -> None:
    full = touching(3)
    bare = dataclasses.replace(
        full,
        grains=dataclasses.replace(full.grains, mass=None, velocity=None, spin=None),
        contacts=None,
        cell=None,
        time=None,
    )
    files = write(bare, tmp_path / "a.any", key)
    if key == "csv":
        assert len(files[1].read_text().splitlines()) == 1
        return
    got = _read(files)
    np.testing.assert_array_equal(np.sort(got.grains.radius), np.sort(bare.grains.radius))
    assert got.contacts is None or got.contacts.count == 0


def _run(count: int) -> Run:
    """A run of states as a reader would give it back."""
    folder_states = [touching(2, seed=seed) for seed in range(count)]

    class States:
        def __len__(self) -> int:
            return count

        def __getitem__(self, index: int) -> object:
            return SimpleNamespace(packing=folder_states[index])

    return Run(series_source=series_dataset([], {}), frames=States())  # type: ignore[arg-type]


def test_a_run_becomes_one_file_or_a_numbered_series(tmp_path: Path) -> None:
    run = _run(3)
    (one,) = write(run, tmp_path / "a.xyz")
    assert len(granufab.read(one).frames) == 3
    files = write(run, tmp_path / "b.vtp")
    assert [file.name for file in files[:2]] == ["b_0000_grains.vtp", "b_0000_contacts.vtp"]
    again = granufab.read(*files)
    assert len(again.frames) == 3
    for seed in range(3):
        assert_same_packing(again.frames[seed].packing, touching(2, seed=seed), contacts=True)


def test_unknown_formats_are_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidSettings, match=r"suffix '\.pdf'.*\.vtkhdf"):
        write(touching(2), tmp_path / "a.pdf")
    with pytest.raises(InvalidSettings, match="allowed: vtkhdf"):
        write(touching(2), tmp_path / "a.pdf", "pdf")
    with pytest.raises(InvalidSettings, match="is a folder"):
        write(touching(2), tmp_path, "yade")


def test_lammps_takes_no_other_tilts(tmp_path: Path) -> None:
    packing = touching(2)
    matrix = np.array([[8.0, 0.0], [1.0, 8.0]])
    packing = dataclasses.replace(packing, cell=Cell(matrix=matrix))
    with pytest.raises(InvalidSettings, match="must lie along x"):
        write(packing, tmp_path / "a.data")
