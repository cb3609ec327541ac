"""Read (W, q, mu) from an .npz archive: W_indptr, W_indices, W_data, q, mu, d, optional meta."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray
from scipy import sparse

from granufab.errors import CorruptFile, InvalidProblem
from granufab.io.checked_hdf5 import LARGEST_RATIO
from granufab.local_problem import LocalProblem

__all__ = ["read_npz_problem"]

_NUMBERS = ("W_indptr", "W_indices", "W_data", "q", "mu", "d")
_BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, OverflowError, MemoryError)
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


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
    except (*_BROKEN, zipfile.BadZipFile, zlib.error, RuntimeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CorruptFile(f"{path}: cannot be read as a problem ({reason})") from None


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """One array of numbers, its declared size checked against what the archive stores."""
    member = archive.getinfo(f"{name}.npy")
    if member.file_size > LARGEST_RATIO * max(member.compress_size, 1):
        raise ValueError(f"{name} declares {member.file_size} bytes, too many for the archive")
    with archive.open(member) as stream:
        version = npy.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"{name} has an unknown header version {version}")
        shape, _, kind = _HEADERS[version](stream)
        if kind.kind not in "iuf" or len(shape) > 1:
            raise ValueError(f"{name} has type {kind} and shape {shape}")
        count = shape[0] if shape else 1
        if count * kind.itemsize > member.file_size:
            raise ValueError(f"{name} declares {count} items that are not stored")
        data = stream.read(count * kind.itemsize)
    return np.frombuffer(data, dtype=kind).reshape(shape)
