"""Read (W, q, mu) from an .npz archive: W_indptr, W_indices, W_data, q, mu, d, optional meta."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from scipy import sparse

from granufab.errors import CorruptFile, InvalidProblem
from granufab.io.npz_arrays import BROKEN_ARRAYS, archived_array
from granufab.local_problem import LocalProblem

__all__ = ["read_npz_problem"]

_NUMBERS = ("W_indptr", "W_indices", "W_data", "q", "mu", "d")


def read_npz_problem(path: Path) -> LocalProblem:
    """Read a problem; nothing is unpickled, and nothing larger than what is stored is allocated.

    Raises:
        CorruptFile: the archive is damaged, lacks an array or contradicts itself.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            arrays = {name: _array(archive, name) for name in _NUMBERS}
        W: Any = (arrays["W_data"], arrays["W_indices"], arrays["W_indptr"])
        size = len(arrays["W_indptr"]) - 1
        return LocalProblem(
            W=sparse.csr_array(W, shape=(size, size)),
            q=arrays["q"],
            mu=arrays["mu"],
            dimension=int(arrays["d"]),
            title=path.stem,
        )
    except InvalidProblem as error:
        raise CorruptFile(f"{path}: {error}") from None
    except BROKEN_ARRAYS as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CorruptFile(f"{path}: cannot be read as a problem ({reason})") from None


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """One array, of one axis at most."""
    array = archived_array(archive, f"{name}.npy")
    if array.ndim > 1:
        raise ValueError(f"{name} has type {array.dtype} and shape {array.shape}")
    return array
