"""Checkpoints: arrays and notes in one file that is whole and right, or not there.

Layout: 16 bytes of signature, the length of the header and of the file as little-endian uint64,
the header (JSON as UTF-8: the notes, and name, type and shape of each array), the arrays in that
order, C-contiguous, and 32 bytes of SHA-256 over everything before. Nothing is pickled.

A write goes to a temporary file that is brought to the disk, then the present checkpoint becomes
``<name>.previous`` and the new one takes its place; at every moment one of the three is whole.
"""

from __future__ import annotations

import ast
import hashlib
import json
import math
import os
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as numpy_format
from numpy.typing import NDArray

from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.io.summary import plain

__all__ = [
    "Checkpoint",
    "is_checkpoint",
    "previous_of",
    "read_checkpoint",
    "verify_checkpoint",
    "write_checkpoint",
]

_SIGNATURE = b"granufab-ckpt-1\n"
_SIZES = struct.Struct("<QQ")
_HEAD = len(_SIGNATURE) + _SIZES.size
_DIGEST = hashlib.sha256().digest_size
_BLOCK = 2**16
_BROKEN = (ValueError, KeyError, TypeError, SyntaxError, RecursionError, MemoryError)


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """What a checkpoint file holds.

    Attributes:
        arrays: by name, writable, bit for bit as they were given.
        notes: plain data; tuples have become lists.
        warning: why the present file was not used; None where it was.
    """

    arrays: dict[str, NDArray]
    notes: dict[str, Any]
    warning: str | None = None


def previous_of(path: Path | str) -> Path:
    """Where the checkpoint before the present one is kept."""
    path = Path(path)
    return path.with_name(f"{path.name}.previous")


def is_checkpoint(head: bytes) -> bool:
    """Whether a file with these first bytes is a checkpoint, sound or not."""
    return head.startswith(_SIGNATURE)


def write_checkpoint(
    path: Path | str, arrays: Mapping[str, NDArray], notes: Mapping[str, Any]
) -> None:
    """Write a checkpoint so that a crash at any moment leaves this one or the one before.

    The arrays are streamed to the file; they are not copied in memory.

    Args:
        path: the file; its folder must exist. The present one becomes ``<name>.previous``.
        arrays: of any type without Python objects and of any shape.
        notes: plain data for JSON (NaN and infinities allowed).
    Raises:
        InvalidSettings: an array holds Python objects, or a note has no plain form.
        OSError: it could not be written; the checkpoint before it is kept.
    """
    path = Path(path)
    header = _header(arrays, notes)
    temporary = _temporary_of(path)
    try:
        temporary.unlink(missing_ok=True)  # of a crash
        with temporary.open("xb") as stream:
            _write(stream, header, arrays)
            stream.flush()
            os.fsync(stream.fileno())
        if path.exists():
            path.replace(previous_of(path))
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OSError(
            error.errno, f"the checkpoint could not be written ({reason}); the one before is kept",
            str(path),
        ) from None  # fmt: skip


def read_checkpoint(path: Path | str) -> Checkpoint:
    """Read a checkpoint, or the one before where it is missing or damaged.

    No more memory is asked for than the file is long.

    Args:
        path: the file, as it was given to :func:`write_checkpoint`.
    Returns:
        Its content; ``warning`` says so where it is that of the one before.
    Raises:
        MissingData: neither of them is there.
        CorruptFile: none of those that are there is sound.
    """
    path = Path(path)
    faults: list[str] = []
    for candidate in (path, previous_of(path), _temporary_of(path)):
        if not candidate.is_file():
            if candidate == path:
                faults.append(f"{path}: no such file")
            continue
        try:
            arrays, notes = _read(candidate)
        except CorruptFile as error:
            faults.append(str(error))
            continue
        warning = f"{'; '.join(faults)}; {candidate.name} is used" if faults else None
        return Checkpoint(arrays=arrays, notes=notes, warning=warning)
    if not path.is_file() and not previous_of(path).is_file():  # at most a first one, half written
        raise MissingData(f"{path}: no checkpoint is there")
    raise CorruptFile("; ".join(fault for fault in faults if not fault.endswith("no such file")))


def verify_checkpoint(path: Path | str) -> None:
    """Compare a checkpoint file with its checksum, in blocks.

    Raises:
        CorruptFile: it is not whole and right.
    """
    path = Path(path)
    with path.open("rb") as stream:
        rest, _, head = _sizes(stream, path)
        digest = hashlib.sha256(head)
        rest -= _HEAD + _DIGEST
        while rest:
            block = stream.read(min(rest, _BLOCK))
            if not block:
                break
            digest.update(block)
            rest -= len(block)
        if rest or stream.read(_DIGEST) != digest.digest():
            raise CorruptFile(f"{path}: its bytes do not match their checksum")


def _temporary_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.tmp")


def _header(arrays: Mapping[str, NDArray], notes: Mapping[str, Any]) -> bytes:
    described = []
    for name, array in arrays.items():
        if array.dtype.hasobject or array.dtype.itemsize == 0:
            raise InvalidSettings(
                f"array {name} has type {array.dtype}; a checkpoint holds numbers and text only"
            )
        described.append([name, repr(numpy_format.dtype_to_descr(array.dtype)), array.shape])
    content = {"notes": notes, "arrays": described}
    return json.dumps(content, ensure_ascii=False, default=plain).encode()


def _write(stream: BinaryIO, header: bytes, arrays: Mapping[str, NDArray]) -> None:
    size = _HEAD + len(header) + sum(array.nbytes for array in arrays.values()) + _DIGEST
    digest = hashlib.sha256()
    for part in (_SIGNATURE, _SIZES.pack(len(header), size), header):
        digest.update(part)
        stream.write(part)
    for array in arrays.values():
        for block in _blocks(array):
            digest.update(block)
            stream.write(block)
    stream.write(digest.digest())


def _blocks(array: NDArray) -> Iterator[memoryview]:
    """The bytes of an array in C order; only a strided one is copied, block by block."""
    if array.size == 0:
        return
    if array.flags.c_contiguous:
        yield array.reshape(-1).view(np.uint8).data
        return
    flags = ("external_loop", "buffered")
    for block in np.nditer(array, flags=flags, order="C", buffersize=_BLOCK):
        yield np.ascontiguousarray(block).view(np.uint8).data


def _read(path: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """Arrays and notes of one file.

    Raises:
        CorruptFile: it is not whole and right.
    """
    try:
        with path.open("rb") as stream:
            return _content(stream, path)
    except OSError as error:
        if isinstance(error, CorruptFile):
            raise
        raise CorruptFile(f"{path}: cannot be read ({error.strerror or error})") from None
    except _BROKEN as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CorruptFile(f"{path}: header contradicts itself ({reason})") from None


def _sizes(stream: BinaryIO, path: Path) -> tuple[int, int, bytes]:
    """Length of the file, length of the header, and the bytes read."""
    present = os.fstat(stream.fileno()).st_size
    head = stream.read(_HEAD)
    if not head.startswith(_SIGNATURE):
        raise CorruptFile(f"{path}: header is not that of a checkpoint")
    if len(head) < _HEAD:
        raise CorruptFile(f"{path}: is truncated at {present} bytes")
    length, size = _SIZES.unpack(head[len(_SIGNATURE) :])
    if size != present or not 2 <= length <= present - _HEAD - _DIGEST:
        raise CorruptFile(f"{path}: has {present} bytes, its header declares {size}")
    return present, length, head


def _content(stream: BinaryIO, path: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
    present, length, head = _sizes(stream, path)
    header = stream.read(length)
    content = json.loads(header)
    arrays: dict[str, NDArray] = {}
    room = present - _HEAD - length - _DIGEST
    digest = hashlib.sha256(head + header)
    for name, described, shape in content["arrays"]:
        dtype = numpy_format.descr_to_dtype(ast.literal_eval(described))
        bytes_ = _declared(dtype, shape)
        if bytes_ > room:
            raise CorruptFile(f"{path}: array {name} declares {bytes_} bytes, {room} are stored")
        room -= bytes_
        arrays[name] = array = np.empty(shape, dtype)
        if bytes_:
            flat = array.reshape(-1).view(np.uint8).data
            if stream.readinto(flat) != bytes_:  # type: ignore[attr-defined]
                raise CorruptFile(f"{path}: array {name} is truncated")
            digest.update(flat)
    if room or stream.read(_DIGEST) != digest.digest():
        raise CorruptFile(f"{path}: its {present} bytes do not match their checksum")
    return arrays, content["notes"]


def _declared(dtype: np.dtype, shape: Any) -> int:
    if dtype.hasobject or dtype.itemsize == 0:
        raise ValueError(f"type {dtype}")
    if not all(type(edge) is int and edge >= 0 for edge in shape):
        raise ValueError(f"shape {shape}")
    return dtype.itemsize * math.prod(shape)


def _sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the system can."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
