"""The schema covers every recorded field, and its page says what it says."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np
from random_frames import random_frame

from granufab.history import SERIES_UNITS, Frame, StepStatistics
from granufab.io import RunFileWriter
from granufab.io.schema import SCHEMA, markdown_table
from granufab.packing import Cell, Contacts, Grains, WallContacts

PAGE = Path(__file__).parent.parent.parent / "docs" / "run-file.md"


def test_the_page_shows_the_schema() -> None:
    text = PAGE.read_text(encoding="utf-8")
    table = text.split("<!-- schema: begin -->\n")[1].split("<!-- schema: end -->")[0]
    assert table == markdown_table()


def test_every_recorded_field_has_an_entry() -> None:
    sources = {entry.source for entry in SCHEMA}
    records = {
        "": (Frame, {"packing", "statistics"}),
        "statistics.": (StepStatistics, set()),
        "packing.grains.": (Grains, set()),
        "packing.contacts.": (Contacts, set()),
        "packing.cell.": (Cell, set()),
        "packing.wall_contacts.": (WallContacts, set()),
    }
    for prefix, (record, apart) in records.items():
        names = {field.name for field in fields(record)} - apart
        assert {prefix + name for name in names} <= sources
    names = {entry.name for entry in SCHEMA}
    assert {f"series/{name}" for name in SERIES_UNITS} <= names


def test_a_file_holds_the_schema_and_nothing_else(tmp_path: Path) -> None:
    frame = random_frame(np.random.default_rng(0), wall_count=3)
    with RunFileWriter(tmp_path / "run.h5", settings={}) as writer:
        writer.frame(frame)
        writer.close({})
    found = {}
    with h5py.File(tmp_path / "run.h5", "r") as file:
        found |= {f"@{name}": None for name in file.attrs}
        file.visititems(
            lambda name, item: (
                found.update({name: item.dtype}) if isinstance(item, h5py.Dataset) else None
            )
        )
    assert set(found) == {entry.name for entry in SCHEMA}
    for entry in SCHEMA:
        if not entry.name.startswith("@"):
            assert found[entry.name] == np.dtype(entry.dtype), entry.name


def test_names_and_bits_are_unique() -> None:
    names = [entry.name for entry in SCHEMA]
    assert len(set(names)) == len(names)
    groups: dict[int, set[str]] = {}
    for entry in SCHEMA:
        if entry.bit is not None:
            groups.setdefault(entry.bit, set()).add(entry.name.split("/")[0])
    assert sorted(groups) == list(range(11))
    assert all(len(owners) == 1 for owners in groups.values())
