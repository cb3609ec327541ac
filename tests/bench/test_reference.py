"""The C++ reference makes the very sweeps that our kernels make."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.bench import reference as module
from granufab.bench.engine import copy_of, problem_of, streams_of, sweep_seconds
from granufab.bench.problems import tile
from granufab.bench.reference import reference
from granufab.packing import Packing
from granufab.simulate import Biaxial, Isotropic

needs_compiler = pytest.mark.skipif(reference() is None, reason="no C++ compiler")


def _distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one - other).max() / np.abs(other).max())


@needs_compiler
def test_three_sweeps_give_the_same_impulses_and_velocities(packed: Packing) -> None:
    yardstick = reference()
    assert yardstick is not None
    start = problem_of(
        tile(packed, 2, shake=1.0), Isotropic(dimension=packed.dimension), friction=0.2
    )
    before, theirs, swept = streams_of(start), streams_of(start), copy_of(start)
    assert sweep_seconds(swept, 3) is not None
    yardstick.sweep(theirs, 3)
    ours = streams_of(swept)
    for name in ("motion", "dilation", "impulse_n", "impulse_t"):
        one, other = getattr(ours, name), getattr(theirs, name)
        assert _distance(one, other) < 1e-12, name
        assert _distance(one, getattr(before, name)) > 1e-6, name


def test_the_problem_has_sticking_sliding_and_open_contacts(packed: Packing) -> None:
    """Else equal results would say little."""
    case = problem_of(
        tile(packed, 2, shake=1.0), Isotropic(dimension=packed.dimension), friction=0.05
    )
    sweep_seconds(case, 20)
    swept = streams_of(case)
    p_n, p_t = swept.impulse_n, np.linalg.norm(swept.impulse_t, axis=1)
    sliding = p_t > 0.999 * 0.05 * p_n
    assert (p_n == 0).any()
    assert (sliding & (p_n > 0)).any()
    assert (~sliding & (p_n > 0)).any()


def test_a_cell_with_free_components_is_refused(packed: Packing) -> None:
    loading = Biaxial(axial_rate=1e-3, dimension=packed.dimension)
    with pytest.raises(ValueError, match="dilation"):
        streams_of(problem_of(packed, loading, friction=0.3))


@pytest.mark.parametrize("command", ["no-such-compiler", "false"])
def test_without_a_working_compiler_there_is_no_reference(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "COMPILERS", ())
    monkeypatch.setenv("CXX", command)
    assert reference.__wrapped__() is None
