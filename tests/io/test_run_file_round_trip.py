"""What is written into a run file comes back bit for bit."""

from __future__ import annotations

import os
import pickle
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_frames import assert_same_frame, random_frame, random_row

import granufab.io as gio
from granufab.errors import InvalidPacking, InvalidSettings
from granufab.history import SERIES_UNITS, Recorder
from granufab.io.run_file import RunFileWriter

OPTIONAL = ("velocity", "spin", "branch", "gap", "force", "image", "contacts", "cell", "time")


@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    seed=st.integers(0, 2**31),
    dimension=st.sampled_from([2, 3]),
    contact_counts=st.lists(st.integers(0, 300), min_size=1, max_size=4),
    wall_counts=st.lists(st.none() | st.integers(0, 40), min_size=4, max_size=4),
    lacks=st.lists(
        st.sets(st.sampled_from([*OPTIONAL, "remap", "extension"])), min_size=4, max_size=4
    ),
)
def test_random_frames_come_back_bit_for_bit(
    tmp_path: Path,
    seed: int,
    dimension: int,
    contact_counts: list[int],
    wall_counts: list[int | None],
    lacks: list[set[str]],
) -> None:
    rng = np.random.default_rng(seed)
    frames = []
    base = None
    for contacts, walls, missing in zip(contact_counts, wall_counts, lacks, strict=False):
        frame = random_frame(
            rng,
            dimension=dimension,
            contact_count=contacts,
            wall_count=walls,
            base=base,
            lacks=tuple(missing),
        )
        base = frame.packing.grains
        frames.append(frame)
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings={}, force=True) as writer:
        for frame in frames:
            writer.frame(frame)
    run = gio.read(path)
    assert len(run.frames) == len(frames)
    for got, wanted in zip(run.frames, frames, strict=True):
        assert_same_frame(got, wanted)


def test_a_frame_without_contacts_needs_no_gap_for_its_branch(tmp_path: Path) -> None:
    frame = random_frame(np.random.default_rng(1), contact_count=0, lacks=("gap",))
    with RunFileWriter(tmp_path / "run.h5", settings={}) as writer:
        writer.frame(frame)
    assert_same_frame(gio.read(tmp_path / "run.h5").frames[0], frame)


def test_a_branch_of_other_shapes_is_stored_as_it_is(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    plain = random_frame(rng)
    contacts = plain.packing.contacts
    assert contacts is not None and contacts.branch is not None
    odd = replace(contacts, branch=contacts.branch * 1.25)
    other = replace(plain, packing=replace(plain.packing, contacts=odd))
    with RunFileWriter(tmp_path / "run.h5", settings={}) as writer:
        for frame in (plain, other, plain):
            writer.frame(frame)
    frames = gio.read(tmp_path / "run.h5").frames
    for index, wanted in enumerate((contacts, odd, contacts)):
        got = frames[index].packing.contacts
        assert got is not None and got.branch is not None
        np.testing.assert_allclose(got.branch, wanted.branch, rtol=1e-14)
    assert frames[1].packing.contacts.branch.tobytes() == odd.branch.tobytes()  # type: ignore


def test_frames_are_lazy_indexed_and_picklable(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    frames = [random_frame(rng)]
    frames += [random_frame(rng, base=frames[0].packing.grains) for _ in range(4)]
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings={}) as writer:
        for frame in frames:
            writer.frame(frame)
    source = pickle.loads(pickle.dumps(gio.read(path).frames))
    assert source[-1].eps_q == frames[4].eps_q
    assert [f.eps_q for f in source[1:4:2]] == [frames[1].eps_q, frames[3].eps_q]
    assert [f.stage for f in source] == [f.stage for f in frames]
    for index in (5, -6):
        with pytest.raises(IndexError, match="it holds 5"):
            source[index]
    assert source[2].packing.source == str(path)


def test_series_settings_summary_and_provenance_come_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    rows = [random_row(rng) for _ in range(270)]
    settings_ = {
        "name": "other",
        "sample": {"seed": 7},
        "solver": {"stiffness": float("inf")},
        "record": {"criterion": "force", "z_definition": "z_backbone"},
    }
    path = tmp_path / "deep" / "folder" / "run.h5"
    writer = RunFileWriter(path, settings=settings_, provenance={"command": "granufab run"})
    assert isinstance(writer, Recorder)
    with writer:
        for row in rows[:10]:
            writer.row(row)
        writer.frame(random_frame(rng))
        for row in rows[10:]:
            writer.row(row)
        writer.row({"z": 4.0})
        writer.close({"steps": 12, "residual_max": np.float64(1e-5), "z_0": float("nan")})
    run = gio.read(path)
    for name in SERIES_UNITS:
        np.testing.assert_array_equal(run.series[name][:-1], [row[name] for row in rows])
        assert run.series[name].attrs["units"] == SERIES_UNITS[name][0]
    assert float(run.series["z"][-1]) == 4.0
    assert np.isnan(run.series["a"][-1])
    assert run.name == "dense"
    assert run.series.attrs["criterion"] == "force"
    assert run.settings == settings_
    assert run.summary == {"steps": 12, "residual_max": 1e-5, "z_0": None}
    about = gio.describe(path)
    assert (about["frames"], about["rows"], about["finished"]) == (1, 271, True)
    assert about["provenance"]["command"] == "granufab run"
    assert about["provenance"]["h5py"] == h5py.__version__


def test_a_run_that_fails_keeps_its_frames_and_is_not_finished(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(ZeroDivisionError), RunFileWriter(path, settings={}) as writer:
        writer.frame(random_frame(np.random.default_rng(1)))
        raise ZeroDivisionError
    assert len(gio.read(path).frames) == 1
    assert gio.read(path).summary == {}
    assert gio.describe(path)["finished"] is False


def test_a_file_without_frames_opens_empty(tmp_path: Path) -> None:
    with RunFileWriter(tmp_path / "run.h5", settings={"name": "x"}) as writer:
        writer.row({"z": 3.0})
    run = gio.read(tmp_path / "run.h5")
    assert len(run.frames) == 0
    assert run.name == "x"
    assert run.series.sizes["record"] == 1


def test_an_existing_file_is_replaced_only_by_force(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    path.write_text("precious")
    with pytest.raises(InvalidSettings, match="exists already"):
        RunFileWriter(path, settings={})
    assert path.read_text() == "precious"
    RunFileWriter(path, settings={}, force=True).close()
    assert len(gio.read(path).frames) == 0


def test_places_that_cannot_be_written_are_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    places = [tmp_path / "file" / "run.h5", tmp_path, tmp_path / "file" / "deep" / "run.h5"]
    if os.geteuid() != 0:
        locked = tmp_path / "locked"
        locked.mkdir(mode=0o500)
        places.append(locked / "run.h5")
    for place in places:
        with pytest.raises(InvalidSettings) as caught:
            RunFileWriter(place, settings={}, force=True)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["radius", "mass", "number"])
def test_grains_that_change_are_refused(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(8)
    first = random_frame(rng)
    changed = np.array(getattr(first.packing.grains, name))
    changed[4] += 1
    grains = replace(first.packing.grains, **{name: changed})
    with RunFileWriter(tmp_path / "run.h5", settings={}) as writer:
        writer.frame(first)
        with pytest.raises(InvalidPacking, match=name):
            writer.frame(replace(first, packing=replace(first.packing, grains=grains)))
        with pytest.raises(InvalidPacking, match="31 grains in 2D"):
            writer.frame(random_frame(rng, grain_count=31))
        writer.frame(first)
    assert len(gio.read(tmp_path / "run.h5").frames) == 2


def test_a_name_too_long_is_refused_before_anything_is_touched(tmp_path: Path) -> None:
    with pytest.raises(InvalidSettings, match="at most 64"):
        RunFileWriter(tmp_path / "run.h5", settings={"name": "x" * 65})
    assert list(tmp_path.iterdir()) == []


def test_rows_with_unknown_columns_or_long_names_are_refused(tmp_path: Path) -> None:
    with RunFileWriter(tmp_path / "run.h5", settings={}) as writer:
        with pytest.raises(InvalidSettings, match="temperature"):
            writer.row({"temperature": 1.0})
        with pytest.raises(InvalidSettings, match="at most 64"):
            writer.row({"path": "é" * 33})  # type: ignore[dict-item]
        writer.row({"path": "é" * 32})  # type: ignore[dict-item]
    assert gio.read(tmp_path / "run.h5").name == "é" * 32
