"""Frictional contact problems in FCLIB's HDF5 layout, and as plain .npz arrays.

FCLIB (Acary, Brémond, Koziara, Pérignon, report RT-0444, Inria 2014) keeps a problem in the group
``fclib_local``: ``spacedim``, the matrix ``W`` as (nzmax, m, n, nz, p, i, x) with nz = −1 for
compressed columns, −2 for compressed rows, else the number of triplets (p rows, i columns),
``vectors/q`` and ``vectors/mu``, ``info`` as text; beside it ``solution`` and ``guesses``. Only
these names are read, only as hard links, and never more than the file stores.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy import sparse

from granufab.errors import CorruptFile, GranufabError, InvalidProblem, MissingData, UnknownFormat
from granufab.io.checked_hdf5 import BROKEN, HDF5_SIGNATURE, LARGEST_RATIO, storage_fault
from granufab.io.npz_problem import read_npz_problem
from granufab.io.summary import replacing
from granufab.local_problem import LocalProblem, LocalState
from granufab.packing import Array

__all__ = ["read_fclib", "read_fclib_guesses", "read_fclib_solution", "write_fclib"]

_ZIP_SIGNATURE = b"PK\x03\x04"
_TEXTS = ("title", "description", "math_info")


def read_fclib(path: Path | str) -> LocalProblem:
    """Read a problem (W, q, mu) from an FCLIB file or an .npz file; told apart by content.

    An .npz holds W_indptr, W_indices, W_data (CSR), q, mu and d.

    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is neither, or a global problem, or one with bilateral constraints.
        CorruptFile: it is truncated, contradicts itself or declares more than it stores.
    """
    path = Path(path)
    if _head(path) == _ZIP_SIGNATURE:
        return read_npz_problem(path)
    with _opened(path) as file:
        group = file.group("fclib_local")
        for name in ("V", "R"):
            if name in group:
                raise UnknownFormat(
                    f"{path}: has bilateral constraints (fclib_local/{name}); granufab solves "
                    "contacts alone: eliminate them first"
                )
        dimension = file.whole("fclib_local/spacedim")
        info = {name: file.text(f"fclib_local/info/{name}") for name in _TEXTS}
        return LocalProblem(
            W=file.matrix("fclib_local/W"),
            q=file.numbers("fclib_local/vectors/q"),
            mu=file.numbers("fclib_local/vectors/mu"),
            dimension=dimension,
            title=info["title"],
            description="\n".join(filter(None, (info["description"], info["math_info"]))),
        )


def read_fclib_solution(path: Path | str) -> LocalState | None:
    """The solution in an FCLIB file, None where it has none; raises as :func:`read_fclib`."""
    with _opened(Path(path)) as file:
        return file.state("solution") if "solution" in file.root else None


def read_fclib_guesses(path: Path | str) -> list[LocalState]:
    """The initial guesses in an FCLIB file.

    Args:
        path: of the file.
    Raises:
        CorruptFile: the file is damaged or holds fewer guesses than it says.
        UnknownFormat: it is no FCLIB file.
    """
    with _opened(Path(path)) as file:
        if "guesses" not in file.root:
            return []
        count = file.whole("guesses/number_of_guesses")
        if not 0 <= count <= len(file.group("guesses")):
            raise CorruptFile(f"{path}: guesses/number_of_guesses is {count}, stored are fewer")
        return [file.state(f"guesses/{k + 1}") for k in range(count)]


def write_fclib(
    path: Path | str,
    problem: LocalProblem,
    *,
    solution: LocalState | None = None,
    guesses: tuple[LocalState, ...] = (),
) -> None:
    """Write a problem in FCLIB's HDF5 layout, W in compressed rows; a file there is replaced.

    Args:
        path: the file, by custom ``.hdf5``.
        problem: what to write; ``title`` and ``description`` become its info.
        solution: impulses and velocities that solve it.
        guesses: where solvers may start.
    Raises:
        InvalidProblem: a solution or guess does not fit the problem.
        InvalidSettings: the file cannot be written.
    """
    states = {"solution": solution} if solution is not None else {}
    states |= {f"guesses/{k}": guess for k, guess in enumerate(guesses, start=1)}
    for name, state in states.items():
        if state.impulse.shape != problem.q.shape:
            raise InvalidProblem(
                f"{name} has {len(state.impulse)} impulses, the problem has {len(problem.q)}"
            )
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        group = file.create_group("fclib_local")
        _put_whole(group, "spacedim", problem.dimension)
        _put_matrix(group.create_group("W"), problem.W)
        vectors = group.create_group("vectors")
        vectors["q"], vectors["mu"] = problem.q, problem.mu
        info = group.create_group("info")
        for name in ("title", "description"):
            # with its closing zero, as FCLIB's own functions in C read it
            info[name] = np.bytes_(getattr(problem, name).encode() + b"\0")
        for name, state in states.items():
            made = file.create_group(name)
            made["u"], made["r"] = state.velocity, state.impulse
        if guesses:
            _put_whole(file["guesses"], "number_of_guesses", len(guesses))


def _put_whole(group: Any, name: str, value: int) -> None:
    group[name] = np.array([value], dtype=np.int32)


def _put_matrix(group: h5py.Group, W: sparse.csr_array) -> None:
    rows, columns = W.shape
    for name, value in {"nzmax": W.nnz, "m": rows, "n": columns, "nz": -2}.items():
        _put_whole(group, name, value)
    group["p"], group["i"] = W.indptr.astype(np.int32), W.indices.astype(np.int32)
    group["x"] = W.data


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(len(_ZIP_SIGNATURE))
    except FileNotFoundError:
        raise MissingData(f"{path}: no such file") from None
    except OSError as error:
        raise MissingData(f"{path}: cannot be opened ({error.strerror})") from None


@contextmanager
def _opened(path: Path) -> Iterator[_File]:
    """An FCLIB file; whatever the block meets becomes one line that names the file."""
    if _head(path) != HDF5_SIGNATURE[: len(_ZIP_SIGNATURE)]:
        raise UnknownFormat(f"{path}: is neither an FCLIB file (HDF5) nor an .npz file")
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            if "fclib_local" not in file:
                what = "a global problem" if "fclib_global" in file else "no frictional problem"
                raise UnknownFormat(f"{path}: holds {what}, expected the group fclib_local")
            yield _File(file, path)
    except InvalidProblem as error:
        raise CorruptFile(f"{path}: {error}") from None
    except GranufabError:
        raise
    except BROKEN as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CorruptFile(f"{path}: cannot be read as an FCLIB file ({reason})") from None


class _File:
    """An open FCLIB file, trusted in nothing that it declares."""

    def __init__(self, root: h5py.File, path: Path) -> None:
        self.root = root
        self.path = path

    def corrupt(self, text: str) -> CorruptFile:
        """The exception for a contradiction in this file."""
        return CorruptFile(f"{self.path}: {text}")

    def group(self, name: str) -> h5py.Group:
        """A group, reached by hard links."""
        found = self._item(name)
        if not isinstance(found, h5py.Group):
            raise self.corrupt(f"{name} is not a group")
        return found

    def numbers(self, name: str, kinds: str = "fiu") -> Array:
        """A dataset of one axis."""
        data = self._dataset(name)
        if data.dtype.kind not in kinds or len(data.shape) != 1:
            raise self.corrupt(f"{name} has type {data.dtype} and shape {data.shape}")
        return data[()]

    def whole(self, name: str) -> int:
        """A dataset of one whole number."""
        data = self._dataset(name)
        if data.dtype.kind not in "iu" or data.size != 1:
            raise self.corrupt(f"{name} is not one whole number")
        return int(np.ravel(data[()])[0])

    def text(self, name: str) -> str:
        """Text, empty where the file has none."""
        parent, _, last = name.rpartition("/")
        if parent.rpartition("/")[2] not in self.group(parent.rpartition("/")[0]):
            return ""
        if last not in self.group(parent):
            return ""
        data = self._dataset(name)
        if data.dtype.kind != "S" or data.size != 1:
            return ""
        return np.ravel(data[()])[0].rstrip(b"\0").decode(errors="replace")

    def matrix(self, name: str) -> sparse.csr_array:
        """A sparse matrix in any of FCLIB's three layouts."""
        rows, columns, nz = (self.whole(f"{name}/{key}") for key in ("m", "n", "nz"))
        p, i = (self.numbers(f"{name}/{key}", "iu") for key in "pi")
        x = self.numbers(f"{name}/x")
        kind: Any
        if min(rows, columns) < 0 or rows != columns:
            raise self.corrupt(f"{name} has {rows} rows and {columns} columns, must be square")
        if nz >= 0:
            if not nz <= min(len(p), len(i), len(x)):
                raise self.corrupt(f"{name} has nz = {nz}, but fewer triplets are stored")
            entries = (x[:nz], (p[:nz], i[:nz]))
            self._check_range(name, p[:nz], rows)
            self._check_range(name, i[:nz], columns)
            return sparse.csr_array(sparse.coo_array(entries, shape=(rows, columns)))
        if nz not in (-1, -2):
            raise self.corrupt(f"{name}/nz is {nz}, allowed: -1 (columns), -2 (rows), or >= 0")
        count = int(p[-1]) if len(p) == rows + 1 else -1
        if not 0 <= count <= min(len(i), len(x)) or p[0] != 0 or (np.diff(p) < 0).any():
            raise self.corrupt(f"{name}/p does not grow from 0 to the number of stored entries")
        self._check_range(name, i[:count], rows)
        kind = sparse.csc_array if nz == -1 else sparse.csr_array
        return sparse.csr_array(kind((x[:count], i[:count], p), shape=(rows, columns)))

    def state(self, name: str) -> LocalState:
        """Impulses and velocities."""
        self.group(name)
        return LocalState(
            impulse=self.numbers(f"{name}/r"),
            velocity=self.numbers(f"{name}/u"),
        )

    def _check_range(self, name: str, index: Array, size: int) -> None:
        if len(index) and not 0 <= index.min() <= index.max() < size:
            raise self.corrupt(f"{name} has an index outside 0..{size - 1}")

    def _item(self, name: str) -> Any:
        parts = name.split("/")
        for depth in range(1, len(parts) + 1):
            link = self.root.get("/".join(parts[:depth]), getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise self.corrupt(f"{name} is missing or a link to elsewhere")
        return self.root[name]

    def _dataset(self, name: str) -> h5py.Dataset:
        data = self._item(name)
        if not isinstance(data, h5py.Dataset) or data.shape is None:
            raise self.corrupt(f"{name} is not a dataset")
        fault = storage_fault(data, name)
        if not fault and data.nbytes > LARGEST_RATIO * max(data.id.get_storage_size(), 1):
            fault = f"{name} declares {data.nbytes} bytes, {data.id.get_storage_size()} are stored"
        if fault:
            raise self.corrupt(fault)
        return data
