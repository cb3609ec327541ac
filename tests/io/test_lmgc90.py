"""LMGC90 text and HDF5: own small files, the samples' known answers, damage."""

from __future__ import annotations

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from foreign_samples import sample
from mangling import check_mutations, check_truncations

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.io.readers.lmgc90_records import fortran

RADIUS = (0.5, 0.5, 0.4)
PLACE = np.array([[0.0, 0.0], [0.9, 0.1], [0.5, 0.8]])
MOVE = np.array([[0.01, 0.0], [0.02, -0.01], [-0.03, 0.02], [0.0, 0.0]])
PAIRS = ((1, 2, 0.3, 2.0), (3, 1, -0.25, 1.5), (3, 2, 0.0, 0.0))


def _d(value: float) -> str:
    return f"{value:.9E}".replace("E", "D").rjust(17)


def _bodies(path: Path) -> Path:
    text = "! File BODIES\n!\n"
    for k, (radius, place) in enumerate(zip(RADIUS, PLACE, strict=True), 1):
        text += _body(k, place, f" DISKx      1  color  BLEUx  byrd={_d(radius)}")
    text += _body(4, (0.4, -0.6), f" JONCx      1  color  DOWNx  ax1 ={_d(2)}  ax2 ={_d(0.1)}")
    path.write_text(text + "!-----\n")
    return path


def _body(number: int, place: tuple | np.ndarray, contactor: str) -> str:
    return (
        f"$bdyty\n RBDY2  {number:5d}\n$blmty\n PLAIN      1  behav  PLEXx  avrd={_d(0.7)}  "
        f"gyrd={_d(0.1)}\n$nodty\n NO3xx      1                coo1={_d(place[0])}  "
        f"coo2={_d(place[1])}  coo3={_d(0)}\n$tacty\n{contactor}\n$$$$$$\n      \n"
    )


def _dof(path: Path, steps: tuple[int, ...] = (7,)) -> Path:
    text = "     \n! DOF\n     \n"
    for step in steps:
        text += f"$steps {step:8d}              time={_d(step * 0.1)}\n \n!-----\n"
        for k, move in enumerate(MOVE * step / 7, 1):
            x = "  ".join(f"X({i})={_d(v)}" for i, v in enumerate((*move, 0.5), 1))
            v = "  ".join(f"V({i})={_d(v)}" for i, v in enumerate((k, -k, 0.1 * k), 1))
            text += (
                f"$bdyty\n RBDY2  {k:5d}\n$nodty\n NO3xx      1                {x}\n{v}\n$$$$$$\n"
            )
        text += "!-----\n"
    path.write_text(text)
    return path


def _vloc(path: Path, steps: tuple[int, ...] = (7,)) -> Path:
    text = "     \n! Vloc_Rloc\n      \n"
    for step in steps:
        text += f"$steps {step:8d}              time={_d(step * 0.1)}\n \n!-----\n"
        place = PLACE + MOVE[:3] * step / 7
        for number, (cd, an, tangent, along) in reversed(list(enumerate(PAIRS, 1))):
            n = place[cd - 1] - place[an - 1]
            n = n / np.linalg.norm(n)
            text += _contact("DKDKx", number, cd, f"{an:5d}  DISKx", (tangent, along), n)
        text += _contact("DKJCx", 1, 1, "    4  JONCx", (0.0, 4.0), np.array([0.0, 1.0]))
    path.write_text(text)
    return path


def _contact(
    kind: str, number: int, cd: int, an: str, force: tuple[float, float], n: np.ndarray
) -> str:
    return (
        f"$icdan  {kind} {number:8d}\n cdbdy  numbr  cdtac  numbr  behav  anbdy  numbr\n"
        f" RBDY2  {cd:5d}  DISKx      1  rstc1  RBDY2  {an}      1  slibw    154\n"
        f"      rlt/H{_d(force[0])}  rln/H{_d(force[1])}  rls/H{_d(0)}\n"
        f"      vlt ={_d(0)}  vln ={_d(0)}  vls ={_d(0)}\n      gapTT{_d(-1e-3)}\n"
        f"      n(1)={_d(n[0])}  n(2)={_d(n[1])}  n(3)={_d(0)}\n"
        f"      coo1={_d(0)}  coo2={_d(0)}  coo3={_d(0)}\n \n"
    )


def _all(folder: Path, steps: tuple[int, ...] = (7,)) -> tuple[Path, Path, Path]:
    return (
        _vloc(folder / "Vloc_Rloc.INI", steps),
        _bodies(folder / "BODIES.DAT"),
        _dof(folder / "DOF.INI", steps),
    )


def test_fortran_exponents() -> None:
    assert fortran("-0.1174972D-01") == -0.01174972
    assert fortran("0.25-101") == 0.25e-101
    assert fortran("1.5") == 1.5


def test_a_small_state(tmp_path: Path) -> None:
    run = granufab.read(*_all(tmp_path))
    packing = run.frames[0].packing
    np.testing.assert_allclose(packing.grains.position, PLACE + MOVE[:3], atol=1e-9)
    np.testing.assert_allclose(packing.grains.radius, RADIUS)
    np.testing.assert_allclose(packing.grains.velocity, [[1, -1], [2, -2], [3, -3]])
    np.testing.assert_allclose(packing.grains.spin, [[0.1], [0.2], [0.3]])
    assert packing.time == pytest.approx(0.7)
    contacts = packing.contacts
    assert contacts is not None
    assert contacts.force is not None
    for k in range(contacts.count):
        i, j = packing.grains.number[contacts.pair[k]]
        cd, an, tangent, along = next(p for p in PAIRS if {p[0], p[1]} == {i, j})
        n = (PLACE + MOVE[:3])[cd - 1] - (PLACE + MOVE[:3])[an - 1]
        n /= np.linalg.norm(n)
        on_candidate = along * n + tangent * np.array([n[1], -n[0]])
        np.testing.assert_allclose(
            contacts.force[k], on_candidate if j == cd else -on_candidate, atol=1e-8
        )
    assert run.frames.summary.walls_dropped > 0  # type: ignore[attr-defined]
    assert granufab.measure(packing)["contact_count"] == 2


def test_a_series_and_one_that_is_cut(tmp_path: Path) -> None:
    files = _all(tmp_path, (7, 14, 21))
    run = granufab.read(*files)
    assert [frame.packing.time for frame in run.frames] == pytest.approx([0.7, 1.4, 2.1])
    whole = files[0].read_bytes()
    files[0].write_bytes(whole[:-300])
    cut = granufab.read(*files)
    assert len(cut.frames) == 2
    second = cut.frames[1].packing.grains.position
    np.testing.assert_allclose(second, PLACE + 2 * MOVE[:3], atol=1e-8)


def test_the_outputs_of_steps_are_paired(tmp_path: Path) -> None:
    files = [_bodies(tmp_path / "BODIES.OUT")]
    for step in (14, 7):
        files += [_vloc(tmp_path / f"Vloc_Rloc.OUT.{step}", (step,))]
        files += [_dof(tmp_path / f"DOF.OUT.{step}", (step,))]
    for run in (granufab.read(*files), granufab.read(tmp_path)):
        assert [frame.packing.time for frame in run.frames] == pytest.approx([0.7, 1.4])
        assert [frame.packing.contacts.count for frame in run.frames] == [3, 3]


def test_a_state_without_contacts(tmp_path: Path) -> None:
    vloc, bodies, dof = _all(tmp_path)
    text = vloc.read_text()
    vloc.write_text(text[: text.index("$icdan")])
    contacts = granufab.read(vloc, bodies, dof).frames[0].packing.contacts
    assert contacts is not None
    assert contacts.count == 0


def test_polygons_touch_in_several_points(tmp_path: Path) -> None:
    vloc, bodies, dof = _all(tmp_path)
    bodies.write_text(bodies.read_text().replace("DISKx", "POLYG"))
    text = vloc.read_text()
    again = text[text.index("$icdan  DKDKx        1") : text.index("$icdan  DKJCx")]
    vloc.write_text(
        text.rstrip(" \n") + "\n \n" + again.replace("DKDKx        1", "DKDKx        4")
    )
    packing = granufab.read(vloc, bodies, dof).frames[0].packing
    assert packing.contacts is not None
    assert packing.contacts.count == 4
    np.testing.assert_allclose(packing.grains.radius, 0.7)


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    vloc, bodies, dof = _all(tmp_path)
    with pytest.raises(MissingData, match=r"BODIES\.DAT"):
        granufab.read(vloc, dof)
    alone = granufab.read(bodies, dof).frames[0].packing
    assert alone.contacts is None
    _dof(dof, (8,))
    with pytest.raises(CorruptFile, match="not of one state"):
        granufab.read(vloc, bodies, dof)


def test_damaged_text(tmp_path: Path) -> None:
    files = _all(tmp_path)
    for file in files:
        check_truncations(file, lambda: granufab.read(*files), count=70)
        assert check_mutations(file, lambda: granufab.read(*files), count=70) > 5


def test_the_sample_of_1024_disks() -> None:
    folder = sample("lmgc90_text", "1024DK_BoxJC")
    files = [folder / name for name in ("Vloc_Rloc.INI", "BODIES.DAT", "DOF.INI")]
    run = granufab.read(*files)
    packing = run.frames[0].packing
    values = granufab.measure(packing, z_definition="z")
    assert packing.grains.count == 1024
    assert packing.contacts is not None
    assert packing.contacts.count == 2672
    assert values["contact_count"] == 1929
    assert round(values["z"], 3) == 3.768
    assert round(values["a"], 3) == 0.079
    text = files[0].read_text()
    assert len(re.findall(r"\$icdan\s+DKJCx", text)) == 136
    alone = granufab.read(*files)
    assert alone.frames.summary.wall_contacts_dropped % 136 == 0  # type: ignore[attr-defined]
    # The same from the numbers as they stand in the file, without any of the package.
    pairs = re.findall(
        r"DKDKx.*?rln/H\s*(\S+).*?n\(1\)=\s*(\S+)\s+n\(2\)=\s*(\S+)", text, re.DOTALL
    )
    table = np.array([[float(word.replace("D", "E")) for word in pair] for pair in pairs])
    n = table[table[:, 0] > 0, 1:]
    f = n.T @ n / len(n)
    assert len(n) == 1929
    assert values["a"] == pytest.approx(2 * np.ptp(np.linalg.eigvalsh(f)), abs=1e-6)


def _hdf5(path: Path, shift: int, steps: int = 2) -> Path:
    """Steps with the bodies of ``PLACE``; ``shift`` moves every column of ``rdata``."""
    with h5py.File(path, "w") as file:
        for group, table, fields in (
            ("RBDY2", "rdata", {"X (x,y,theta)": 3, "V (x,y,rot)": 3}),
            ("RBDY2", "idata", {"visible": 1}),
            ("VlocRloc", "idata", {"bdyty (cd,an)": 2, "ibdyty (cd,an)": 2}),
            ("VlocRloc", "rdata", {"rl (t,n)": 2, "gapTT": 1, "coor (x,y)": 2, "uc (nx,ny)": 2}),
        ):
            start = 1 + (shift if table == "rdata" else 0)
            for name, width in fields.items():
                place = file.create_group(f"Help/{group}/{table}/{name.split()[0]}")
                place["bound"] = np.array([start, start + width - 1], np.int32)
                place["name"] = np.bytes_(name.encode())
                start += width
        file["Help/parameters/bdyty/id"] = np.array([1, 3], np.int32)
        file["Help/parameters/bdyty/name"] = np.array([b"RBDY2", b"MAILx"], "S40")
        blank = np.full((1, shift), 77.0)
        for step in range(1, steps + 1):
            at = f"Evolution/ID_{step}"
            move = np.column_stack([MOVE * step, np.zeros((4, 4))])
            file[f"{at}/RBDY2/rdata"] = np.hstack([np.repeat(blank, 4, 0), move])
            file[f"{at}/RBDY2/idata"] = np.ones((4, 1), np.int32)
            file[f"{at}/TPS"] = 0.5 * step
            file[f"{at}/NStep"] = np.int32(step)
            rows, pairs = [], []
            for cd, an, tangent, along in (*PAIRS, (1, 4, 0.0, 4.0)):
                n = (
                    np.array([0.0, 1.0])
                    if an == 4
                    else (PLACE + step * MOVE[:3])[cd - 1] - (PLACE + step * MOVE[:3])[an - 1]
                )
                n = n / np.linalg.norm(n)
                rows.append([tangent, along, -1e-3, 0, 0, *n])
                pairs.append([1, 1, cd, an])
            pairs.append([1, 3, 1, 1])
            rows.append([0, 5.0, 0, 0, 0, 1, 0])
            file[f"{at}/VlocRloc/idata"] = np.array(pairs, np.int32)
            file[f"{at}/VlocRloc/rdata"] = np.hstack([np.repeat(blank, 5, 0), np.array(rows)])
    return path


@pytest.mark.parametrize("shift", [0, 2])
def test_hdf5_says_what_the_text_says(tmp_path: Path, shift: int) -> None:
    vloc, bodies, dof = _all(tmp_path)
    run = granufab.read(bodies, _hdf5(tmp_path / "lmgc90.h5", shift), format="lmgc90_hdf5")
    assert len(run.frames) == 2
    wanted, got = granufab.read(vloc, bodies, dof).frames[0].packing, run.frames[0].packing
    np.testing.assert_allclose(got.grains.position, wanted.grains.position, atol=1e-8)
    np.testing.assert_allclose(got.grains.radius, wanted.grains.radius)
    assert got.contacts is not None
    assert wanted.contacts is not None
    order = np.lexsort(got.contacts.pair.T), np.lexsort(wanted.contacts.pair.T)
    for name in ("pair", "normal", "force", "gap"):
        one, two = getattr(got.contacts, name)[order[0]], getattr(wanted.contacts, name)[order[1]]
        np.testing.assert_allclose(one, two, atol=1e-8)
    assert (run.frames[0].packing.time, run.frames[1].packing.time) == (0.5, 1.0)


@pytest.mark.parametrize("bodies_first", [False, True])
def test_hdf5_and_bodies_are_one_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bodies_first: bool
) -> None:
    """Nothing but the two files is given, in either order, to Python and the command line."""
    from granufab.cli import main

    files = [_hdf5(tmp_path / "lmgc90.h5", 1, 3), _bodies(tmp_path / "BODIES.DAT")]
    files = files[::-1] if bodies_first else files
    run = granufab.read(*files)
    assert run.settings["format"] == "LMGC90 HDF5"
    assert len(run.frames) == 3
    with pytest.raises(SystemExit) as done:
        main(["measure", *map(str, files), "--json", "--z-definition", "z"])
    assert done.value.code == 0
    states = json.loads(capsys.readouterr().out)
    assert [state["frame"] for state in states] == [0, 1, 2]
    for state in states:  # three pairs are listed, two bear; body 4 is a wall
        assert (state["grain_count"], state["contact_count"]) == (3, 2)
        assert state["z"] == pytest.approx(4 / 3)


def test_hdf5_without_bodies_names_them(tmp_path: Path) -> None:
    with pytest.raises(MissingData, match=r"give BODIES\.DAT"):
        granufab.read(_hdf5(tmp_path / "lmgc90.h5", 0), radius=0.5)


def test_damaged_hdf5(tmp_path: Path) -> None:
    bodies, file = _bodies(tmp_path / "BODIES.DAT"), _hdf5(tmp_path / "lmgc90.h5", 0, 1)
    check_truncations(file, lambda: granufab.read(file, bodies, format="lmgc90_hdf5"))
    assert check_mutations(file, lambda: granufab.read(file, bodies, format="lmgc90_hdf5")) > 0


def _round_bodies(path: Path, dimension: int, pair: np.ndarray, normal: np.ndarray) -> Path:
    """BODIES for a sample that lacks it: ten round bodies, branches along the normals."""
    text, radius = "! File BODIES\n", 0.25
    kind = "DISKx" if dimension == 2 else "SPHER"
    ends = np.zeros((len(pair), 10))
    ends[np.arange(len(pair)), pair[:, 0] - 1] += 1.0
    ends[np.arange(len(pair)), pair[:, 1] - 1] -= 1.0
    places = np.linalg.lstsq(ends, normal, rcond=None)[0]
    for k, place in enumerate(places, 1):
        coo = "  ".join(f"coo{i + 1}={_d(v)}" for i, v in enumerate(place))
        text += (
            f"$bdyty\n RBDY{dimension}  {k:5d}\n$blmty\n PLAIN      1  behav  PLEXx  avrd="
            f"{_d(0.2)}\n$nodty\n NO3xx      1     {coo}\n$tacty\n {kind}      1  color  "
            f"BLEUx  byrd={_d(radius)}\n$$$$$$\n"
        )
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "dimension", "normal", "steps"),
    [("2D_v0_1.h5", 2, slice(7, 9), 10), ("3D_v0_2.h5", 3, slice(13, 16), 3)],
)
def test_the_samples_of_two_versions(
    tmp_path: Path, name: str, dimension: int, normal: slice, steps: int
) -> None:
    file = sample("lmgc90_hdf5", name)
    with h5py.File(file) as data:
        at = data[f"Evolution/ID_{steps}/VlocRloc"]
        kinds, pair = at["idata"][:, 4:6], at["idata"][:, 6:8]
        rigid = (kinds == dimension - 1).all(axis=1) & (pair[:, 0] != pair[:, 1])
        n, force = at["rdata"][:, normal], at["rdata"][:, 1]
        move = data[f"Evolution/ID_{steps}/RBDY{dimension}/rdata"][:, :dimension]
    bodies = _round_bodies(tmp_path / "BODIES.DAT", dimension, pair[rigid], n[rigid])
    run = granufab.read(file, bodies)
    assert len(run.frames) == steps
    packing = run.frames[-1].packing
    unique = {tuple(sorted(one)) for one in pair[rigid].tolist()}
    assert packing.contacts is not None
    assert packing.contacts.count == len(unique)
    reference = granufab.read(bodies).frames[0].packing.grains.position
    np.testing.assert_allclose(packing.grains.position, reference + move, atol=1e-15)
    held = packing.contacts.force
    assert held is not None
    for k, (i, j) in enumerate(packing.grains.number[packing.contacts.pair].tolist()):
        row = next(r for r in np.flatnonzero(rigid) if set(pair[r]) == {i, j})
        sense = 1.0 if packing.contacts.normal[k] @ n[row] > 0 else -1.0
        np.testing.assert_allclose(packing.contacts.normal[k], sense * n[row], atol=1e-12)
        along = held[k] @ packing.contacts.normal[k]
        np.testing.assert_allclose(along, force[row], rtol=1e-9, atol=1e-12)
