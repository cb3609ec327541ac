"""Ten grains that are written in every format that is read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import granufab
from granufab.history import Run

__all__ = ["COUNT", "EDGE", "PUSH", "RADIUS", "Example", "Grid", "Part", "grid", "row", "rows"]

COUNT, EDGE, RADIUS, PUSH = 10, 9.0, 0.4621, 7.654
"""RADIUS is that of grain 4, PUSH the normal force of contact 2: marks that are there once."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Grains near the points of a grid, those that overlap in contact; n points from i to j."""

    position: np.ndarray
    radius: np.ndarray
    pair: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    overlap: np.ndarray
    push: np.ndarray
    force: np.ndarray


@cache
def grid(dimension: int) -> Grid:
    """Forces are on j."""
    chance = np.random.default_rng(8)
    k = np.arange(COUNT)
    place = np.stack([k % 4, k // 4] if dimension == 2 else [k % 3, k // 3 % 2, k // 6], axis=1)
    position = (1.0 + 0.95 * place + chance.uniform(-0.02, 0.02, place.shape)).round(4)
    radius = np.full(COUNT, 0.5)
    radius[4] = RADIUS
    i, j = np.triu_indices(COUNT, 1)
    branch = position[j] - position[i]
    length = np.linalg.norm(branch, axis=1)
    touch = length < radius[i] + radius[j]
    pair, normal = np.stack([i, j], axis=1)[touch], (branch / length[:, None])[touch]
    push = np.arange(1.0, len(pair) + 1)
    push[2] = PUSH
    across = np.roll(normal, 1, axis=1) * ([-1, 1] if dimension == 2 else 1)
    return Grid(
        position=position,
        radius=radius,
        pair=pair,
        normal=normal,
        point=position[pair].mean(axis=1),
        overlap=(radius[i] + radius[j] - length)[touch],
        push=push,
        force=push[:, None] * normal + 0.25 * across,
    )


@dataclass(frozen=True, kw_only=True)
class Part:
    """One of an example's files.

    Attributes:
        name: of the file.
        number: a number that is used, in its characters; empty for none.
        text: whether lines and numbers are text.
        counted: whether it tells how many rows it has.
        counts: patterns with one group, a count that it declares.
    """

    name: str
    number: str = ""
    text: bool = True
    counted: bool = True
    counts: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Example:
    """Files of a format, all in one folder, with what they need to be read."""

    key: str
    folder: Path
    parts: tuple[Part, ...]
    whole: bool = False
    series: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def read(self) -> Run:
        """Open them."""
        paths = [self.folder] if self.whole else [self.folder / part.name for part in self.parts]
        return granufab.read(*paths, format=self.key, **self.options)


def row(*values: Any, mark: str = " ") -> str:
    """A line of numbers and words."""
    words: list[str] = []
    for value in values:
        if isinstance(value, str):
            words.append(value)
        else:
            words += [f"{one:.10g}" for one in np.atleast_1d(value).ravel().tolist()]
    return mark.join(words) + "\n"


def rows(lines: Iterable[str]) -> str:
    return "".join(lines)
