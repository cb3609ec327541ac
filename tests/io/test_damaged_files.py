"""Every format, every file of it: cut, with wrong bytes, and with what happens to files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mangling import check_mutations, check_truncations
from one_of_each import COUNT, grid
from one_of_each_binary import EXAMPLES

STREAMS = ("lammps_dump", "liggghts_local", "mercury", "extxyz")
"""Frames one after another: those before a cut are read."""


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_are_what_was_written(tmp_path: Path, name: str) -> None:
    run = EXAMPLES[name](tmp_path).read()
    packing = run.frames[0].packing
    if name.startswith("labels"):
        assert packing.grains.count == 12
        assert packing.contacts is not None
        assert packing.contacts.count == 20
        return
    wanted = grid(packing.dimension)
    assert packing.grains.count == COUNT
    np.testing.assert_allclose(packing.grains.radius, wanted.radius, rtol=1e-6)
    if packing.contacts is not None:
        # Of rigidlib's grain 9 two contacts are replaced by one across the edge.
        assert packing.contacts.count == len(wanted.pair) - (name == "rigidlib")
        force = packing.contacts.force
        assert force is not None
        along = np.einsum("ci,ci->c", force, packing.contacts.normal)
        assert (along > 0).all()


@pytest.mark.parametrize("name", EXAMPLES)
def test_cuts(tmp_path: Path, name: str, tell: Callable[..., None]) -> None:
    example = EXAMPLES[name](tmp_path)
    partial = [
        check_truncations(tmp_path / part.name, example.read, counted=part.counted)
        for part in example.parts
    ]
    assert example.series or not any(partial)
    assert name not in STREAMS or min(partial) > 20
    tell(files=len(example.parts), partial=sum(partial))


@pytest.mark.parametrize("name", EXAMPLES)
def test_wrong_bytes(tmp_path: Path, name: str, tell: Callable[..., None]) -> None:
    example = EXAMPLES[name](tmp_path)
    refused = [check_mutations(tmp_path / part.name, example.read) for part in example.parts]
    assert sum(refused) > 0
    tell(files=len(example.parts), refused=sum(refused))
