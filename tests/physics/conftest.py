"""Lets the tests of this folder import ``physics_cases``; small samples that many of them use."""

import sys
from pathlib import Path

import pytest

from granufab.packing import Packing
from granufab.simulate import compress, random_sample

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def loose() -> Packing:
    """150 disks at rest under p = 1, compacted with friction."""
    return compress(random_sample(150, seed=5), friction=0.3)


@pytest.fixture(scope="session")
def dense() -> Packing:
    """150 disks at rest under p = 1, compacted without friction."""
    return compress(random_sample(150, seed=6), friction=0.0)
