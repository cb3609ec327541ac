"""A run that is still written: new frames appear, what was there stays, a new run is another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from looking import looking_at
from sheared_run import series_row, sheared_frames, write_run

from granufab.io import RunFileWriter
from granufab.simulate.settings import Case, Sample
from granufab.viewer import ViewedRun, fit_data, overview, series_data, unpack

Look = Callable[[Path], ViewedRun]


def settings() -> dict:
    return Case(name="made-up", sample=Sample(dimension=2)).model_dump(mode="json")


def test_new_frames_and_rows_appear(view_of: Look, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    frames = list(sheared_frames(2, 4))
    with RunFileWriter(path, settings=settings()) as writer:
        viewed = view_of(path)
        assert overview(viewed)["frame_count"] == 0
        assert "no row" in str(series_data(viewed)["missing"])
        assert "no row" in fit_data([viewed])["missing"]
        for count, frame in enumerate(frames, start=1):
            writer.frame(frame)
            writer.row(series_row(count))
            viewed.refresh()
            assert overview(viewed)["frame_count"] == count
            assert len(series_data(viewed)["columns"]["z"]) == count
            assert viewed.revision == count
            assert viewed.generation == 0
            assert not viewed.finished
    kept = viewed.frame(1)
    viewed.refresh()
    assert viewed.frame(1) is kept


def test_a_run_in_its_place_is_read_anew(view_of: Look, tmp_path: Path) -> None:
    path = write_run(tmp_path / "run.h5", sheared_frames(2, 4))
    viewed = view_of(path)
    assert overview(viewed)["dimension"] == 2
    kept = viewed.frame(0)
    path.unlink()
    viewed.refresh()
    assert "no such file" in str(viewed.problem)
    assert viewed.frame(0) is kept
    write_run(path, sheared_frames(3, 4))
    viewed.refresh()
    assert viewed.problem is None
    assert viewed.generation == 1
    assert overview(viewed)["dimension"] == 3
    assert viewed.frame(0).packing.dimension == 3


def test_the_server_follows(view_of: Look, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    frames = list(sheared_frames(2, 3))
    with RunFileWriter(path, settings=settings()) as writer:
        writer.frame(frames[0])
        with looking_at(view_of(path)) as viewer:
            assert viewer.get("/api/runs/0").json()["frame_count"] == 1
            early = viewer.get("/api/runs/0/frames/1/packing")
            assert early.status == 422
            assert "holds frames 0..0" in early.json()["error"]
            first = viewer.get("/api/runs/0/frames/0/packing").headers["etag"]
            revision = viewer.get("/api/runs").json()["runs"][0]["revision"]
            writer.frame(frames[1])
            listed = viewer.get("/api/runs").json()["runs"][0]
            assert listed["revision"] > revision
            assert viewer.get("/api/runs/0").json()["frames"]["eps_q"] == [0.0, 0.1]
            header, arrays = unpack(viewer.get("/api/runs/0/frames/1/packing").body)
            assert header["eps_q"] == pytest.approx(0.1)
            assert len(arrays["gained"]) == header["contact_count"]
            assert viewer.get("/api/runs/0/frames/0/packing").headers["etag"] == first


def test_the_server_says_that_the_file_is_gone(view_of: Look, tmp_path: Path) -> None:
    path = write_run(tmp_path / "run.h5", sheared_frames(2, 2))
    with looking_at(view_of(path)) as viewer:
        assert viewer.get("/api/runs/0").json()["problem"] is None
        path.unlink()
        for listed in (viewer.get("/api/runs").json()["runs"][0], viewer.get("/api/runs/0").json()):
            assert "no such file" in listed["problem"]
