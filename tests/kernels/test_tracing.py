"""Traced functions: run plain and run to be compiled, they must say the same."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from granufab.kernels.access import address, like_numbers, take
from granufab.kernels.lanes import WIDTH
from granufab.kernels.memory import empty, unlinked, zeros
from granufab.kernels.tracing import (
    choose,
    floor,
    greatest,
    larger,
    nearest,
    root,
    smaller,
    summed,
    traced,
    whole,
)


class Pair(NamedTuple):
    """A named pair."""

    sum: float
    count: int


@traced
def _numbers(x, y, k):
    return (
        (x + y, x - y, x * y, x / y, -x, abs(x), x**2),
        (2 - x, 2.0 / y, k * x, k + 3, 2 * k, whole(x)),
        (larger(x, y), smaller(x, y), larger(k, 3), smaller(k, 3), floor(x), nearest(x)),
        (choose(x < y, 1.0, -1.0), choose(x >= y, x, 0.0), choose(k > 2, k, 0), root(abs(y))),
    )


@traced
def _pair(pair, scale):
    return Pair(scale * pair.sum, pair.count + 1)


@traced
def _branching(x):
    return x if x > 0.0 else -x


@traced
def _folded(values, like):
    numbers = like_numbers(like)
    x, y = take(values, 0, 0, numbers), take(values, 0, 1, numbers)
    longest = choose(x > y, x, y)
    return summed(x * y + 1.0), greatest(longest), summed(root(abs(x)) / 2.0)


def _compiled(function: Any) -> Any:
    return njit(lambda *arguments: function(*arguments))


def _flat(nested: Any) -> list[float]:
    return [x for item in nested for x in (_flat(item) if isinstance(item, tuple) else [item])]


@pytest.mark.parametrize("x", [-2.5, 0.4, 1.5, 7.0])
@pytest.mark.parametrize(("y", "k"), [(3.0, 5), (-0.7, -4)])
def test_compiled_numbers_are_those_of_the_plain_text(x, y, k):
    found, plain = _flat(_compiled(_numbers)(x, y, k)), _flat(_numbers(x, y, k))
    assert found == pytest.approx(plain, rel=1e-15)
    assert [type(one) for one in found] == [type(one) for one in plain]


def test_rounding_goes_to_the_even_number_and_down():
    found = _compiled(_numbers)(2.5, 1.0, 0)
    assert found[2][4:] == (2.0, 2.0)
    assert _compiled(_numbers)(-2.5, 1.0, 0)[2][4:] == (-3.0, -2.0)


def test_named_tuples_stay_named():
    found = _compiled(_pair)(Pair(1.5, 2), 4.0)
    assert isinstance(found, Pair)
    assert found == (6.0, 3)


def test_lanes_are_eight_numbers():
    generator = np.random.default_rng(3)
    values = generator.standard_normal(2 * WIDTH)
    x, y = values[:WIDTH], values[WIDTH:]

    @njit
    def eight(values):
        return _folded(address(values), ((0.0, 0.0),))

    expected = (x @ y + WIDTH, np.maximum(x, y).max(), np.sqrt(np.abs(x)).sum() / 2)
    assert eight(values) == pytest.approx(expected, rel=1e-14)


def test_a_branch_on_a_number_is_refused():
    assert _branching(-2.0) == 2.0
    with pytest.raises(TypingError, match="choose"):
        _compiled(_branching)(-2.0)


def test_lanes_cannot_leave():
    @traced
    def leaking(like):
        return like_numbers(like)

    with pytest.raises(TypingError, match="lanes"):
        _compiled(leaking)(((0.0, 0.0),))


def test_arrays_made_in_kernels_are_numpys():
    @njit
    def made(count):
        table = zeros((count, 3), np.float64)
        links = unlinked((count,), np.int64)
        room = empty((2, count), np.int32)
        for k in range(count):
            room[0, k], room[1, k] = k, -k
        return table, links, room

    for table, links, room in (made(5), made.py_func(5)):
        assert table.shape == (5, 3)
        assert not table.any()
        assert links.dtype == np.int64
        assert links.tolist() == [-1] * 5
        assert room.dtype == np.int32
        assert room.tolist() == [[0, 1, 2, 3, 4], [0, -1, -2, -3, -4]]
        assert table.flags.c_contiguous and room.flags.c_contiguous
    assert math.isfinite(made(0)[0].sum())
