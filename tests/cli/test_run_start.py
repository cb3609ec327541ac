"""``run --start``: a run from a state of another program, or of an own run file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import granufab as gf
from granufab.simulate.settings import Sample, Sizes, load_case

PATH = ("--set", "path.0.strain=0.004", "--set", "path.0.inertial_number=5e-3")


@pytest.fixture(scope="module")
def resting() -> gf.Packing:
    """Sixty disks at rest under p = 2."""
    sample = Sample(grain_count=60, pressure=2.0, friction=0.3, sizes=Sizes(spread=0.3))
    return gf.prepare(sample).packing


def softened(packing: gf.Packing, share: float = 0.003) -> str:
    """The same disks as a table, squeezed: overlaps of ``share`` diameters, no forces."""
    position = packing.grains.position * (1 - share)
    rows = [f"{x},{y},{r}" for (x, y), r in zip(position, packing.grains.radius, strict=True)]
    return "\n".join(["x,y,r", *rows]) + "\n"


def cell_of(packing: gf.Packing, share: float = 0.003) -> str:
    assert packing.cell is not None
    return ",".join(str(edge * (1 - share)) for edge in (0.0, 0.0, *packing.cell.matrix.diagonal()))


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_a_foreign_state_is_relaxed_and_said(granufab, resting: gf.Packing, tmp_path: Path) -> None:
    table = tmp_path / "soft.csv"
    table.write_text(softened(resting), encoding="utf-8")
    read = ("--cell", cell_of(resting), "--periodic", "xy")
    done = granufab("run", "--start", table, *read, *PATH, "--set", "sample.pressure=2")
    assert done.code == 0, done.err
    start = summary(tmp_path / "soft")["start"]
    assert start["pressure"] == 2
    assert start["relaxed"]["overlap"][0] > 1e-3
    assert start["relaxed"]["overlap"][1] < 2e-4
    said = [line for line in done.err.splitlines() if line.startswith("granufab: start: ")]
    for part in ("60 grains", "masses: from sample.density = 1", "pressure: 2", "overlaps relaxed"):
        assert any(part in line for line in said), (part, said)
    states = json.loads(granufab("measure", tmp_path / "soft" / "run.h5", "--json").out)
    assert states[0]["eps_q"] == 0
    assert states[0]["p"] == pytest.approx(2.0, rel=0.01)
    assert states[-1]["eps_q"] == pytest.approx(0.004)
    assert states[0]["z_backbone"] == pytest.approx(start["relaxed"]["after"]["z_backbone"])
    settings = load_case(tmp_path / "soft" / "settings.toml")
    assert settings.sample.grain_count == 60
    again = granufab("run", tmp_path / "soft" / "settings.toml", "--out", tmp_path / "again")
    assert again.code == 0, again.err
    last = [gf.read(tmp_path / name / "run.h5").frames[-1].packing for name in ("soft", "again")]
    assert np.array_equal(last[0].grains.position, last[1].grains.position)


def test_a_hard_state_with_forces_starts_as_it_is(
    granufab, resting: gf.Packing, tmp_path: Path
) -> None:
    from granufab.io import write

    (file,) = write(resting, tmp_path / "rest.vtkhdf")
    done = granufab("run", "--start", file, "--out", tmp_path / "out", *PATH)
    assert done.code == 0, done.err
    start = summary(tmp_path / "out")["start"]
    assert start["relaxed"] is None
    assert start["pressure"] == pytest.approx(2.0, rel=1e-4)
    first = gf.read(tmp_path / "out" / "run.h5").frames[0]
    assert np.allclose(first.packing.grains.position, resting.grains.position, atol=1e-12)
    assert np.trace(first.stress) / 2 == pytest.approx(2.0, rel=1e-3)


def test_a_frame_of_a_run_file_keeps_its_pressure(granufab, tmp_path: Path) -> None:
    case = tmp_path / "first.toml"
    case.write_text("[sample]\ngrain_count = 40\npressure = 3.0\n", encoding="utf-8")
    assert granufab("run", case, *PATH, "--set", "record.frame_interval=0.002").code == 0
    file = tmp_path / "first" / "run.h5"
    done = granufab(
        "run", "--start", file, "--out", tmp_path / "b", *PATH, "--set", "sample.frame=1"
    )
    assert done.code == 0, done.err
    assert load_case(tmp_path / "b" / "settings.toml").sample.pressure == 3
    wanted, first = gf.read(file).frames[1], gf.read(tmp_path / "b" / "run.h5").frames[0]
    assert np.array_equal(first.packing.grains.position, wanted.packing.grains.position)
    assert first.eps_q == 0


def test_bad_starts_are_one_line(granufab, resting: gf.Packing, tmp_path: Path) -> None:
    table = tmp_path / "soft.csv"
    table.write_text(softened(resting), encoding="utf-8")
    cell = ("--cell", cell_of(resting))
    case = tmp_path / "case.toml"
    case.write_text("[sample]\ndimension = 3\n", encoding="utf-8")
    out = ("--out", tmp_path / "out")
    for arguments, part in (
        ((), "--start FILE"),
        (("--start", tmp_path / "none.csv"), "no such file"),
        (("--start", table), "--cell"),
        (("--start", table, *cell, "--set", "sample.frame=3"), "holds 1 frames"),
        ((case, "--start", table, *cell), "holds a 2D state"),
        ((case, *cell), "--cell tells how --start FILE is read"),
        (("--start", table, *cell, "--set", "path.0.loading=triaxial"), "use biaxial"),
        (("--start", table, *cell, "--set", "path.0.axis=2"), "allowed 0..1"),
        (("--start", table, "--format", "nonsense"), "nonsense"),
    ):
        done = granufab("run", *arguments, *out)
        assert done.code == 2, (arguments, done.err)
        assert part in done.err, (arguments, done.err)
        assert len(done.err.splitlines()) == 1
        assert not (tmp_path / "out" / "run.h5").exists()


def test_other_shapes_than_disks_and_spheres_are_refused(granufab, tmp_path: Path) -> None:
    cube = "<\nname Cube\nradius 0.01\nvolume 4\nnv 8\n>\n"
    (tmp_path / "cubes.shp").write_text(cube, encoding="utf-8")
    row = "Cube 0 0 1 {} 0 0 0 0 0 0 0 0 1 0 0 0 0 0 0 0 0 0\n"
    head = "Rockable 21-08-2022\nt 0\ndensity 0 1\nnDriven 0\nshapeFile cubes.shp\nprecision 6\n"
    bodies = "".join(row.format(2 * k) for k in range(4))
    file = tmp_path / "conf0"
    file.write_text(f"{head}Particles 4\n{bodies}Interactions 0\nInterfaces 0\n", encoding="utf-8")
    done = granufab("run", "--start", file, "--cell", "8,4,4", "--out", tmp_path / "out")
    assert done.code == 2
    assert "not disks or spheres" in done.err


def test_an_imported_state_starts_as_the_files_it_came_from(
    granufab, resting: gf.Packing, tmp_path: Path
) -> None:
    """A run file that ``import`` wrote has no masses, and overlaps of soft grains."""
    table, file = tmp_path / "soft.csv", tmp_path / "imported.h5"
    table.write_text(softened(resting), encoding="utf-8")
    read = ("--cell", cell_of(resting), "--periodic", "xy")
    assert granufab("import", table, *read, "-o", file).code == 0
    done = granufab("run", "--start", file, "--set", "sample.pressure=2", *PATH)
    assert done.code == 0, done.err
    start = summary(tmp_path / "imported")["start"]
    assert start["relaxed"]["overlap"][0] > 1e-3 > start["relaxed"]["overlap"][1]
    assert any("masses: from sample.density" in line for line in start["notes"])


def test_a_cell_that_is_all_but_empty_is_refused(
    granufab, resting: gf.Packing, tmp_path: Path
) -> None:
    table = tmp_path / "soft.csv"
    table.write_text(softened(resting), encoding="utf-8")
    done = granufab("run", "--start", table, "--cell", "1e4,1e4", "--out", tmp_path / "out", *PATH)
    assert done.code == 2
    assert "give the cell in the units of the positions (--cell)" in done.err


def test_a_damaged_state_asks_for_another_frame(granufab, tmp_path: Path) -> None:
    """``run`` takes one state, so it has no --skip-damaged to point to."""
    table = tmp_path / "series.csv"
    rows = [f"{k},{x},{y},0.5" for k in range(3) for x, y in ((0, 0), (1, 0), (0, 1), (1, 1))]
    rows[-1] = "2,1,1,-0.5"
    table.write_text("\n".join(["frame,x,y,r", *rows]) + "\n", encoding="utf-8")
    done = granufab("run", "--start", table, "--cell", "2,2", "--out", tmp_path / "out")
    assert done.code == 2
    assert "choose another sample.frame" in done.err
    assert "--skip-damaged" not in done.err
