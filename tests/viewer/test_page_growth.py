"""A run that is still written appears by itself; data that lack something say what."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Sight, share_changed
from looking import looking_at
from page_data import viewed
from sheared_run import series_row, sheared_frames
from test_growing_run import settings

from granufab import read
from granufab.io import RunFileWriter
from granufab.viewer import ViewedRun, fit_data, interval_data, state_data

Look = Callable[..., Sight]
LAST = "() => Number(document.querySelector('#frame').max)"


def test_new_frames_appear_by_themselves(look_at: Look, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    frames = list(sheared_frames(2, 5))
    with RunFileWriter(path, settings=settings()) as writer:
        writer.frame(frames[0])
        writer.row(series_row(0))
        with looking_at(viewed(path)) as server:
            sight = look_at(server.address)
            sight.shown("0/0/.*")
            first = sight.pixels("#packing canvas")
            for index in (1, 2):  # whoever looks at the end stays there
                writer.frame(frames[index])
                writer.row(series_row(index))
                sight.shown(f"0/{index}/.*")
                assert sight.ask(LAST) == index
                one = viewed(path)
                numbers = state_data(one.run, one.frame(index), one.choice(None, None))["values"]
                assert sight.numbers()["a_signed"] == numbers["a_signed"]
                sight.wait(lambda rows=index + 1: rows in lengths(sight), what="the series")
            assert share_changed(first, sight.pixels("#packing canvas")) > 0.02
            sight.frame(1)  # whoever looks back is left there
            writer.frame(frames[3])
            sight.until(LAST, wanted=lambda last: last == 3)
            assert sight.stays().startswith("0/1/")
            writer.row(series_row(3))
            writer.close()
            sight.wait(lambda: 4 in lengths(sight), what="the series")
            assert sight.stays().startswith("0/1/")
            sight.frame(3)
            numbers = sight.numbers()
            path.unlink()  # what was there stays, and the page says what happened
            sight.until("() => document.body.innerText", wanted=lambda text: "no such file" in text)
            assert sight.stays().startswith("0/3/")
            assert sight.numbers() == numbers


def lengths(sight: Sight) -> set[int]:
    """How many records the curves of the series have."""
    return {len(trace["x"]) for trace in sight.traces("series") if trace.get("x")}


def dump(path: Path, spacing: float) -> Path:
    """Disks of diameter 1 on a square lattice, two states, without forces."""
    lines = []
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(6.0), np.arange(6.0)))
    for step in range(2):
        size = 6 * spacing
        lines += ["ITEM: TIMESTEP", str(step), "ITEM: NUMBER OF ATOMS", str(len(x))]
        lines += ["ITEM: BOX BOUNDS pp pp pp", f"0 {size}", f"0 {size}", "-0.5 0.5"]
        lines += ["ITEM: ATOMS id x y z radius"]
        shift = 0.1 * step
        lines += [
            f"{k + 1} {spacing * a + shift} {spacing * b} 0 0.5"
            for k, (a, b) in enumerate(zip(x, y, strict=True))
        ]
    path.write_text("\n".join([*lines, ""]))
    return path


def words(sight: Sight, panel: str) -> str:
    return " ".join(sight.ask(f"() => document.querySelector('#{panel}').textContent").split())


def foreign(path: Path) -> ViewedRun:
    return ViewedRun(str(path), [path], lambda: read(path))


@pytest.mark.parametrize("spacing", [0.99, 1.5])
def test_foreign_data_without_forces_say_what_is_missing(
    look_at: Look, tmp_path: Path, spacing: float
) -> None:
    path = dump(tmp_path / "atoms.dump", spacing)
    one = foreign(path)
    choice = one.choice(None, None)
    state = state_data(one.run, one.frame(1), choice)
    with looking_at(foreign(path)) as server:
        sight = look_at(server.address)
        sight.shown("0/1/gap.*")
        fit: Any = fit_data([one])
        assert fit["domain"] is None
        assert fit["missing"] in words(sight, "path")
        if spacing < 1:  # touching: everything but forces is there
            assert sight.numbers()["z_backbone"] == state["values"]["z_backbone"] == 4.0
            assert sight.traces("rose")
            assert sight.traces("mohr")
            assert sight.numbers()["q_over_p"] is None
        else:
            for panel in ("rose", "mohr"):
                assert not sight.traces(panel)
                assert re.search("no contact|not in this data", words(sight, panel))
        sight.bring("changes")
        interval = interval_data(one.frame(0), one.frame(1), choice)
        if interval["missing"] is not None:
            assert interval["missing"] in words(sight, "changes")
        assert np.ptp(sight.pixels("#packing canvas")) > 60  # the grains are drawn in any case
        sight.frame(0)
        assert "there is no frame before" in words(sight, "changes")
        for kind in ("force", "gap"):
            sight.page.select_option("#kind", kind)
            sight.page.wait_for_timeout(400)
        assert sight.stays().startswith("0/0/gap")
