"""Legacy VTK files of grains: ASCII and binary, of old and new versions, written here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mangling import check_mutations, check_truncations

import granufab
from granufab.errors import CorruptFile, InvalidSettings, MissingData

POSITION = np.random.default_rng(5).uniform(-1, 1, (7, 3))
RADIUS = np.random.default_rng(6).uniform(0.1, 0.2, 7)
NUMBER = np.array([4, 2, 9, 1, 3, 8, 7])
VELOCITY = POSITION[::-1] * 3


def _numbers(values: np.ndarray, kind: str, binary: bool) -> bytes:
    if binary:
        return np.asarray(values).astype(kind).tobytes() + b"\n"
    words = [repr(value) for value in np.asarray(values).ravel().tolist()]
    lines = [" ".join(words[k : k + 9]) + " \n" for k in range(0, len(words), 9)]
    return "".join(lines).encode()


def _file(binary: bool, version: int) -> bytes:
    n = len(RADIUS)
    parts = [
        f"# vtk DataFile Version {version}.1\ngrains\n{'BINARY' if binary else 'ASCII'}\n".encode(),
        b"DATASET POLYDATA\n",
        b"FIELD FieldData 1\nTIME 1 1 double\n" + _numbers(np.array([2.5]), ">f8", binary),
        f"POINTS {n} double\n".encode() + _numbers(POSITION, ">f8", binary),
    ]
    if version >= 5:
        parts += [
            b"METADATA\nINFORMATION 0\n\n",
            f"VERTICES {n + 1} {n}\nOFFSETS vtktypeint64\n".encode(),
            _numbers(np.arange(n + 1), ">i8", binary),
            b"CONNECTIVITY vtktypeint64\n" + _numbers(np.arange(n), ">i8", binary),
        ]
    else:
        cells = np.column_stack([np.ones(n, int), np.arange(n)])
        parts.append(f"VERTICES {n} {2 * n}\n".encode() + _numbers(cells, ">i4", binary))
    parts += [
        f"CELL_DATA {n}\nSCALARS radius float 1\nLOOKUP_TABLE default\n".encode(),
        _numbers(np.full(n, 77.0), ">f4", binary),
        f"POINT_DATA {n}\nSCALARS id int\nLOOKUP_TABLE default\n".encode(),
        _numbers(NUMBER, ">i4", binary),
        b"VECTORS v double\n" + _numbers(VELOCITY, ">f8", binary),
        f"FIELD FieldData 2\nradius 1 {n} double\n".encode() + _numbers(RADIUS, ">f8", binary),
        f"density 1 {n} float\n".encode() + _numbers(np.ones(n), ">f4", binary),
    ]
    return b"".join(parts)


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", [3, 5])
def test_grains_are_what_was_written(tmp_path: Path, binary: bool, version: int) -> None:
    path = tmp_path / "grains12.vtk"
    path.write_bytes(_file(binary, version))
    run = granufab.read(path)
    packing = run.frames[0].packing
    grains = packing.grains
    assert packing.time == 2.5
    assert grains.position.tolist() == POSITION.tolist()
    assert grains.radius.tolist() == RADIUS.tolist()
    assert grains.number is not None
    assert grains.number.tolist() == NUMBER.tolist()
    assert grains.velocity is not None
    assert grains.velocity.tolist() == VELOCITY.tolist()
    assert run.frames.summary.unknown_columns == ("density",)  # type: ignore[attr-defined]


def test_files_are_sorted_by_step(tmp_path: Path) -> None:
    text, paths = _file(False, 5), []
    for step in (100, 20, 3):
        paths.append(tmp_path / f"a_{step}.vtk")
        paths[-1].write_bytes(text.replace(b"TIME 1 1 double\n2.5", b"TIME 1 1 double\n%d" % step))
    run = granufab.read(*paths)
    assert [run.frames[k].packing.time for k in range(3)] == [3, 20, 100]


def test_arrays_by_other_names(tmp_path: Path) -> None:
    path = tmp_path / "a.vtk"
    path.write_bytes(_file(False, 5).replace(b"radius 1 7", b"size 1 7"))
    with pytest.raises(MissingData, match="give --radius"):
        granufab.read(path)
    run = granufab.read(path, columns={"grains": {"diameter": "size"}})
    assert run.frames[0].packing.grains.radius == pytest.approx(RADIUS / 2)
    with pytest.raises(InvalidSettings, match="from the arrays id, v, size, density"):
        granufab.read(path, columns={"grains": {"radius": "r"}})


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (b"POINTS 7 double", b"POINTS 8 double", "24 numbers expected, got 21"),
        (b"POINTS 7 double", b"POINTS 9999999 double", "more than the file can hold"),
        (b"POINT_DATA 7", b"POINT_DATA 8", "POINT_DATA 8, but there are 7 points"),
        (b"ASCII", b"ASCIJ", "expected ASCII or BINARY"),
        (b"VECTORS v", b"VECTARS v", "unknown section 'VECTARS v double'"),
        (b"radius 1 7 double", b"radius 2 7 double", "14 numbers expected, got 7"),
        (b"POINTS 7 double", b"POINTS 7 doubly", "values of type 'doubly'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: bytes, new: bytes, match: str) -> None:
    path = tmp_path / "a.vtk"
    path.write_bytes(_file(False, 5).replace(old, new))
    with pytest.raises(CorruptFile, match=r"a\.vtk: byte \d+: .*" + match):
        granufab.read(path)


@pytest.mark.parametrize("binary", [False, True])
def test_mangled_files(tmp_path: Path, binary: bool) -> None:
    path = tmp_path / "a.vtk"
    path.write_bytes(_file(binary, 5))
    assert check_truncations(path, lambda: granufab.read(path, format="liggghts_vtk")) == 0
    assert 0 < check_mutations(path, lambda: granufab.read(path, format="liggghts_vtk")) < 200
