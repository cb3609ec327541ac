"""Compares what a command prints with what a page shows of it."""

from __future__ import annotations

import re

from console_pages import shown

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
FREE = ("seconds", "outside", "read in", "worst overlap", "largest residual")
"""Beginnings of lines whose numbers depend on the machine, or on each grain's place."""


def assert_alike(found: str, page: tuple[str, ...], *, share: float = 0.3) -> None:
    """The same lines as on the page: words to the letter, numbers to 30 % or 0.15.

    Frictional grains are chaotic: another processor's last digit moves every grain in the end, and
    the means of small samples then agree within their scatter only.
    """
    if not any(line.strip() for line in page):
        return
    lines = [" ".join(line.split()) for line in shown(found, page) if line.strip()]
    wanted = [" ".join(line.split()) for line in page if line.strip()]
    assert [NUMBER.sub("#", line) for line in lines] == [NUMBER.sub("#", line) for line in wanted]
    for line, known in zip(lines, wanted, strict=True):
        if line.startswith(FREE):
            continue
        for one, other in zip(NUMBER.findall(line), NUMBER.findall(known), strict=True):
            room = max(0.15, share * max(abs(float(one)), abs(float(other))))
            assert abs(float(one) - float(other)) <= room, f"{line!r}, the page has {known!r}"
