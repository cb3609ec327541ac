"""Sizes that binary files declare are checked before anything is allocated for them."""

from __future__ import annotations

import re
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from mangling import Attempts
from one_of_each import COUNT
from one_of_each_binary import EXAMPLES

MANY = (10**9, 10**12, 2**62)


def refused(tmp_path: Path, name: str, change: Callable[[Path], None], part: int = 0) -> str:
    """The error of an example one of whose files was changed; time and memory are checked."""
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(tmp_path, example.read)
    change(tmp_path / example.parts[part].name)
    seen = attempts.attempt("declared sizes", traced=True)
    attempts.check_resident()
    assert len(seen) < len(attempts.wanted)
    return str(attempts.error)


def put(code: str, place: int, value: int) -> Callable[[Path], None]:
    """Write a number at a byte of a file."""

    def change(path: Path) -> None:
        data = bytearray(path.read_bytes())
        struct.pack_into(code, data, place, value % 256 ** struct.calcsize(code))
        path.write_bytes(data)

    return change


@pytest.mark.parametrize("count", MANY)
@pytest.mark.parametrize("place", [8, 16, 24, 32])
def test_gsd_header(tmp_path: Path, count: int, place: int) -> None:
    refused(tmp_path, "gsd", put("<Q", place, count))


@pytest.mark.parametrize("count", MANY)
@pytest.mark.parametrize(("code", "offset"), [("<Q", 0), ("<Q", 8), ("<q", 16), ("<I", 24)])
def test_gsd_chunks(tmp_path: Path, count: int, code: str, offset: int) -> None:
    """Frame, rows, place and columns of the chunk with the first frame's positions."""
    example = EXAMPLES["gsd"](tmp_path)
    data = (tmp_path / example.parts[0].name).read_bytes()
    (index,) = struct.unpack_from("<Q", data, 8)
    refused(tmp_path, "gsd", put(code, index + 4 * 32 + offset, min(count, 2**32 - 1)
                                 if code == "<I" else count))  # fmt: skip


def test_gsd_grains(tmp_path: Path) -> None:
    def change(path: Path) -> None:
        data = path.read_bytes()
        path.write_bytes(data.replace(struct.pack("<I", COUNT), struct.pack("<I", 10**9), 1))

    assert "expected" in refused(tmp_path, "gsd", change)


@pytest.mark.parametrize("count", MANY)
def test_numpy_header(tmp_path: Path, count: int) -> None:
    assert "not stored" in refused(tmp_path, "labels_npy", lambda path: _widen(path, count))


def _widen(path: Path, count: int) -> None:
    """Another first edge in the header of an .npy file, spaces making up for its digits."""
    data = path.read_bytes()
    shape = re.search(rb"\((\d+), 6, 6\), \} +", data)
    assert shape
    text = b"(%d, 6, 6), }" % count
    path.write_bytes(data.replace(shape[0], text.ljust(len(shape[0]))))


@pytest.mark.parametrize("count", MANY)
def test_numpy_archive(tmp_path: Path, count: int) -> None:
    def change(path: Path) -> None:
        one = tmp_path / "labels.npy"
        with zipfile.ZipFile(path) as archive:
            one.write_bytes(archive.read("labels.npy"))
        _widen(one, count)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(one, "labels.npy")
        one.unlink()

    assert "not stored" in refused(tmp_path, "labels_npz", change)


@pytest.mark.parametrize("tag", [256, 257])
@pytest.mark.parametrize("count", [10**6, 10**9, 2**32 - 1])
def test_tiff_edges(tmp_path: Path, tag: int, count: int) -> None:
    """Width and length of every page, and no shape in words that would contradict them."""

    def change(path: Path) -> None:
        data = path.read_bytes().replace(b'{"shape"', b'{"sh_pe"')
        found = list(re.finditer(struct.pack("<HHI", tag, 4, 1), data, re.DOTALL))
        found += re.finditer(struct.pack("<HHI", tag, 3, 1), data, re.DOTALL)
        assert found
        for one in found:
            data = (
                data[: one.start()] + struct.pack("<HHII", tag, 4, 1, count) + data[one.end() + 4 :]
            )
        path.write_bytes(data)

    refused(tmp_path, "labels_tif", change)


@pytest.mark.parametrize("name", ["vtp_appended", "vtp_zlib"])
@pytest.mark.parametrize("count", MANY)
@pytest.mark.parametrize("word", [0, 2, 3])
def test_vtk_lengths(tmp_path: Path, name: str, count: int, word: int) -> None:
    """Bytes of an appended array; or blocks, bytes of the last one, as it is packed."""
    if name == "vtp_appended" and word:
        return

    def change(path: Path) -> None:
        put("<Q", path.read_bytes().index(b"\n_") + 2 + 8 * word, count)(path)

    assert "array radius" in refused(tmp_path, name, change)


@pytest.mark.parametrize(
    ("name", "dataset"),
    [
        ("vtkhdf", "VTKHDF/Points"),
        ("vtkhdf", "VTKHDF/PointData/radius"),
        ("vtkhdf", "ONDEM/Interactions/id1"),
        ("lmgc90_hdf5", "Evolution/ID_1/RBDY2/rdata"),
        ("lmgc90_hdf5", "Evolution/ID_1/VlocRloc/idata"),
        ("lmgc90_hdf5", "Help/RBDY2/rdata/X/bound"),
    ],
)
@pytest.mark.parametrize("count", [10**9, 10**12])
@pytest.mark.parametrize("chunked", [False, True])
def test_hdf5_shapes(tmp_path: Path, name: str, dataset: str, count: int, chunked: bool) -> None:
    """Rows without storage read as zeros: they must not be allocated."""

    def change(path: Path) -> None:
        with h5py.File(path, "a") as file:
            old = file[dataset]
            assert isinstance(old, h5py.Dataset)
            shape, kind = (count, *old.shape[1:]), old.dtype
            del file[dataset]
            chunks = (1024, *shape[1:]) if chunked else None
            file.create_dataset(dataset, shape, kind, chunks=chunks)

    assert f"{dataset} declares" in refused(tmp_path, name, change)
