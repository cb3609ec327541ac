"""Which frames are kept where not all fit: evenly spaced, with the first and the last."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from granufab.errors import InvalidSettings

__all__ = ["evenly", "fitting", "parse_size"]

_UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9}
_UNITS |= {"KIB": 2**10, "MIB": 2**20, "GIB": 2**30}


def parse_size(text: str | float) -> int:
    """A size in bytes from words such as ``20MB``, ``512 KiB`` or ``20000000``.

    Raises:
        InvalidSettings: it is no size above zero.
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?(?:e\d+)?)\s*([a-z]*)\s*", str(text), re.IGNORECASE)
    size = float(found[1]) * _UNITS.get(found[2].upper(), 0) if found else 0.0
    if not 1 <= size < 2**53:
        raise InvalidSettings(f"size {str(text)!r}: give bytes, or a number with KB, MB, GB or MiB")
    return int(size)


def evenly(count: int, kept: int) -> list[int]:
    """Places of ``kept`` of ``count`` frames, evenly spaced, the first and the last among them."""
    if kept >= count:
        return list(range(count))
    return sorted({int(place) for place in np.rint(np.linspace(0, count - 1, max(kept, 1)))})


def fitting(counts: Sequence[int], sizes: Sequence[float], most: float) -> list[int] | None:
    """How many frames of each run fit, the same share of each, two of each at least.

    Args:
        counts: frames of each run.
        sizes: bytes of a frame of each run.
        most: bytes for all of them.
    Returns:
        The numbers, or None where not even two frames of each fit.
    """

    def kept(share: float) -> list[int]:
        return [min(count, max(2, int(share * count))) for count in counts]

    def size(share: float) -> float:
        return sum(n * one for n, one in zip(kept(share), sizes, strict=True))

    if size(0.0) > most:
        return None
    shares = sorted({n / count for count in counts for n in range(1, count + 1) if count} | {0.0})
    return kept(max(share for share in shares if size(share) <= most) + 1e-12)
