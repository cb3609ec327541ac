"""Checksums of the run file: over the stored values of a frame, a row, or the texts.

Each is BLAKE2b shortened to 8 bytes, as little-endian uint64; 0 stands for "none". Name, shape
and index go in with the values, so that nothing can take another's place.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.io.schema import SCHEMA

__all__ = ["frame_checksum", "row_checksums", "text_checksum"]


def frame_checksum(index: int, values: Mapping[str, NDArray]) -> int:
    """Checksum of a frame.

    Args:
        index: of the frame.
        values: what is stored of it, by entry name and in the entry's type: radius, mass and
            number, the two bounds ``start[k:k + 2]`` of its pairs, and every entry that
            ``frames/present`` tells it holds.
    """
    digest = _begun(f"frame {index}")
    for entry in SCHEMA:
        value = values.get(entry.name)
        if value is not None:
            digest.update(f"\n{entry.name} {value.dtype.str} {value.shape}\n".encode())
            digest.update(np.ascontiguousarray(value).data)
    return _number(digest)


def row_checksums(columns: Mapping[str, NDArray], first: int) -> NDArray[np.uint64]:
    """Checksums of consecutive rows of the series.

    Args:
        columns: the stored columns by entry name, each of shape (row_count,).
        first: index of the first row.
    """
    names = [entry.name for entry in SCHEMA if entry.name in columns]
    stored = [np.ascontiguousarray(columns[name]) for name in names]
    count = len(stored[0]) if stored else 0
    table = np.hstack([c.view(np.uint8).reshape(count, c.dtype.itemsize) for c in stored])
    sums = np.empty(count, np.uint64)
    begun = _begun(" ".join(names))
    for index in range(count):
        digest = begun.copy()
        digest.update(f"\nrow {first + index}\n".encode())
        digest.update(table[index].data)
        sums[index] = _number(digest)
    return sums


def text_checksum(*parts: str | bytes | int) -> int:
    """Checksum of texts and numbers in their order."""
    digest = _begun("text")
    for part in parts:
        content = part if isinstance(part, bytes) else str(part).encode()
        digest.update(f"\n{len(content)}\n".encode())
        digest.update(content)
    return _number(digest)


def _begun(text: str) -> Any:
    return hashlib.blake2b(text.encode(), digest_size=8)


def _number(digest: Any) -> int:
    return int.from_bytes(digest.digest(), "little") or 1
