"""Labels of equal rows."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.fabric.row_labels import row_labels


@pytest.mark.parametrize("high", [3, 2**40, 2**62], ids=["few", "one number", "rows"])
def test_labels_are_those_of_unique_rows(high: int) -> None:
    rng = np.random.default_rng(3)
    choices = rng.integers(-high, high, size=4)
    rows = choices[rng.integers(0, 4, size=(500, 4))]
    labels = row_labels(rows)
    unique, inverse = np.unique(rows, axis=0, return_inverse=True)
    assert np.array_equal(labels, inverse.reshape(-1))
    assert np.array_equal(unique[labels], rows)


def test_no_rows_have_no_labels() -> None:
    assert row_labels(np.zeros((0, 4), dtype=np.int64)).shape == (0,)
