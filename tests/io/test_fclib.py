"""FCLIB files: round trip, the three matrix layouts, and what must be refused."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import sparse

from granufab.errors import CorruptFile, InvalidProblem, InvalidSettings, MissingData, UnknownFormat
from granufab.io import read_fclib, read_fclib_guesses, read_fclib_solution, write_fclib
from granufab.local_problem import LocalProblem, LocalState


@pytest.fixture
def problem() -> LocalProblem:
    rng = np.random.default_rng(1)
    W = sparse.random_array((9, 9), density=0.3, rng=rng)
    return LocalProblem(
        W=W @ W.T + sparse.eye_array(9),
        q=rng.standard_normal(9),
        mu=np.array([0.1, 0.2, 0.3]),
        dimension=3,
        title="three contacts",
        description="random, µ up to 0.3",
    )


@pytest.fixture
def written(tmp_path: Path, problem: LocalProblem) -> Path:
    path = tmp_path / "problem.hdf5"
    write_fclib(path, problem)
    return path


def _assert_same(one: LocalProblem, other: LocalProblem) -> None:
    assert (one.W.toarray() == other.W.toarray()).all()
    assert (one.q == other.q).all()
    assert (one.mu == other.mu).all()
    assert one.dimension == other.dimension


def test_round_trip(tmp_path: Path, problem: LocalProblem, written: Path) -> None:
    read = read_fclib(written)
    _assert_same(read, problem)
    assert (read.title, read.description) == (problem.title, problem.description)
    assert read_fclib_solution(written) is None
    assert read_fclib_guesses(written) == []
    states = [LocalState(impulse=np.arange(9.0) + k, velocity=-np.arange(9.0)) for k in range(3)]
    path = tmp_path / "made" / "solved.hdf5"
    write_fclib(path, problem, solution=states[0], guesses=tuple(states[1:]))
    solution = read_fclib_solution(path)
    assert solution is not None
    assert (solution.impulse == states[0].impulse).all()
    assert (solution.velocity == states[0].velocity).all()
    assert [g.impulse[0] for g in read_fclib_guesses(path)] == [1.0, 2.0]


def test_the_layout_is_that_of_the_library(written: Path) -> None:
    """Types and shapes that FCLIB's C functions ask for: int32 and float64 of one axis."""
    with h5py.File(written) as file:
        W = file["fclib_local/W"]
        assert {key: W[key].dtype.str for key in W} == {
            **dict.fromkeys(("nzmax", "m", "n", "nz", "p", "i"), "<i4"),
            "x": "<f8",
        }
        assert [W[key].shape for key in ("nzmax", "m", "n", "nz")] == [(1,)] * 4
        assert W["nz"][0] == -2
        assert file["fclib_local/spacedim"][0] == 3
        assert file["fclib_local/vectors/q"].shape == (9,)
        assert file["fclib_local/info/title"].dtype.kind == "S"


def _replace(group: h5py.Group, **values) -> None:
    for name, value in values.items():
        if name in group:
            del group[name]
        group[name] = value


@pytest.mark.parametrize("layout", ["columns", "triplets", "spare room"])
def test_the_other_layouts(problem: LocalProblem, written: Path, layout: str) -> None:
    columns, triplets = sparse.csc_array(problem.W), sparse.coo_array(problem.W)
    with h5py.File(written, "r+") as file:
        W = file["fclib_local/W"]
        if layout == "columns":
            _replace(W, nz=[-1], p=columns.indptr, i=columns.indices, x=columns.data)
        elif layout == "triplets":
            row, column = triplets.coords
            _replace(W, nz=[triplets.nnz], p=row, i=column, x=triplets.data)
        else:
            pad = [np.append(W[key][()], [0, 0]) for key in "ix"]
            _replace(W, nzmax=[len(pad[0])], i=pad[0], x=pad[1])
    _assert_same(read_fclib(written), problem)


def _external(file: h5py.File) -> None:
    del file["fclib_local/vectors/q"]
    file["fclib_local/vectors/q"] = h5py.ExternalLink("elsewhere.h5", "/q")


def _soft(file: h5py.File) -> None:
    del file["fclib_local/vectors/mu"]
    file["fclib_local/vectors/mu"] = h5py.SoftLink("/fclib_local/vectors/q")


def _huge(file: h5py.File) -> None:
    del file["fclib_local/vectors/q"]
    group = file["fclib_local/vectors"]
    group.create_dataset("q", shape=(10**10,), dtype="f8", chunks=(1000,), compression="gzip")


def _put(name: str, value: object):
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_external, "vectors/q is missing or a link to elsewhere"),
        (_soft, "vectors/mu is missing or a link to elsewhere"),
        (_huge, "vectors/q declares 80000000000 bytes"),
        (_put("fclib_local/W/nz", [-7]), "W/nz is -7, allowed"),
        (_put("fclib_local/W/nz", [1000]), "nz = 1000, but fewer"),
        (_put("fclib_local/W/m", [8]), "8 rows and 9 columns"),
        (_put("fclib_local/W/i", np.full(60, 99)), "index outside 0..8"),
        (_put("fclib_local/W/p", np.arange(10)[::-1]), "does not grow from 0"),
        (_put("fclib_local/W/x", "text"), "W/x has type"),
        (_put("fclib_local/spacedim", [4]), "dimension is 4"),
        (_put("fclib_local/vectors/mu", [0.1, np.nan, 0.2]), r"mu\[1\] is nan"),
        (_put("fclib_local/vectors", 3.0), "vectors/q"),
    ],
)
def test_damaged_and_hostile_files(written: Path, change, message: str) -> None:
    with h5py.File(written, "r+") as file:
        change(file)
    with pytest.raises(CorruptFile, match=message) as caught:
        read_fclib(written)
    assert str(caught.value).startswith(str(written))
    assert "\n" not in str(caught.value)


def test_one_triangle_is_not_taken_for_the_matrix(problem: LocalProblem, written: Path) -> None:
    lower = sparse.csr_array(sparse.tril(problem.W))
    with h5py.File(written, "r+") as file:
        _replace(file["fclib_local/W"], p=lower.indptr, i=lower.indices, x=lower.data)
    with pytest.raises(CorruptFile, match="W is not symmetric"):
        read_fclib(written)


def test_what_granufab_does_not_solve(tmp_path: Path, written: Path) -> None:
    with h5py.File(written, "r+") as file:
        file.create_group("fclib_local/V")
    with pytest.raises(UnknownFormat, match="has bilateral constraints"):
        read_fclib(written)
    other = tmp_path / "global.hdf5"
    with h5py.File(other, "w") as file:
        file.create_group("fclib_global")
    with pytest.raises(UnknownFormat, match="holds a global problem"):
        read_fclib(other)
    text = tmp_path / "text.hdf5"
    text.write_text("nothing")
    with pytest.raises(UnknownFormat, match="neither an FCLIB file"):
        read_fclib(text)
    with pytest.raises(MissingData, match="no such file"):
        read_fclib(tmp_path / "none.hdf5")


def test_truncated_files(written: Path) -> None:
    whole = written.read_bytes()
    for share in (0.1, 0.5, 0.9):
        written.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(CorruptFile, match="cannot be read as an FCLIB file"):
            read_fclib(written)


def test_writing_refuses_what_does_not_fit(tmp_path: Path, problem: LocalProblem) -> None:
    short = LocalState(impulse=np.zeros(3), velocity=np.zeros(3))
    with pytest.raises(InvalidProblem, match="solution has 3 impulses, the problem has 9"):
        write_fclib(tmp_path / "x.hdf5", problem, solution=short)
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidSettings, match="cannot be written"):
        write_fclib(tmp_path / "file" / "x.hdf5", problem)


def _arrays(problem: LocalProblem) -> dict:
    W = problem.W
    arrays = {"W_indptr": W.indptr, "W_indices": W.indices, "W_data": W.data}
    return arrays | {"q": problem.q, "mu": problem.mu, "d": np.int64(problem.dimension)}


def test_plain_arrays(tmp_path: Path, problem: LocalProblem) -> None:
    for name, save in {"stored": np.savez, "packed": np.savez_compressed}.items():
        path = tmp_path / f"{name}.npz"
        save(path, **_arrays(problem))
        read = read_fclib(path)
        _assert_same(read, problem)
        assert read.title == name


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": None}, "q.npy"),
        ({"q": np.array([object()] * 9)}, "q has type object"),
        ({"q": np.zeros((3, 3))}, r"q has type float64 and shape \(3, 3\)"),
        ({"q": np.zeros(8)}, "q has 8 entries"),
        ({"W_indptr": np.arange(10) * 1000}, "cannot be read as a problem"),
        ({"W_data": np.zeros(10**5)}, "cannot be read as a problem"),
        ({"d": np.int64(5)}, "dimension is 5"),
    ],
)
def test_bad_plain_arrays(
    tmp_path: Path, problem: LocalProblem, change: dict, message: str
) -> None:
    arrays = {k: v for k, v in (_arrays(problem) | change).items() if v is not None}
    path = tmp_path / "bad.npz"
    np.savez_compressed(path, **arrays)
    with pytest.raises(CorruptFile, match=message) as caught:
        read_fclib(path)
    assert "\n" not in str(caught.value)


def test_a_header_that_declares_more_than_is_stored(tmp_path: Path, problem: LocalProblem) -> None:
    path = tmp_path / "big.npz"
    np.savez(path, **_arrays(problem))
    text = path.read_bytes()
    shape = b"'shape': (9,), }"
    assert text.count(shape) == 1
    path.write_bytes(text.replace(shape, b"'shape': (9999999999,), }"[: len(shape)]))
    with pytest.raises(CorruptFile, match="cannot be read as a problem"):
        read_fclib(path)
    path.write_bytes(text[: len(text) // 2])
    with pytest.raises(CorruptFile, match="cannot be read as a problem"):
        read_fclib(path)
