"""Nearest images against the best of many."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.io.nearest_image import nearest_images


@pytest.mark.parametrize("tilt", [0.0, 0.5, -0.9, 2.3])
@pytest.mark.parametrize("periodic", [(True, True, True), (True, True, False)])
def test_no_image_is_shorter(tilt: float, periodic: tuple[bool, ...]) -> None:
    generator = np.random.default_rng(4)
    matrix = np.array([[3, 3 * tilt, 0], [0, 2, 0.7], [0, 0, 4]], float)
    if not periodic[2]:
        matrix[1, 2] = 0
    vectors = generator.uniform(-9, 9, (200, 3))
    found, image = nearest_images(vectors, matrix, periodic)
    assert found == pytest.approx(vectors + image @ matrix.T, abs=1e-12)
    assert not image[:, ~np.array(periodic)].any()
    steps = [np.arange(-5, 6) if wraps else np.zeros(1, int) for wraps in periodic]
    moves = np.stack(np.meshgrid(*steps), -1).reshape(-1, 3) @ matrix.T
    shortest = np.linalg.norm(found[:, None] + moves, axis=2).min(axis=1)
    assert np.linalg.norm(found, axis=1) == pytest.approx(shortest, abs=1e-12)
