"""Small packed states shared by the tests of the benchmarks."""

from __future__ import annotations

import pytest

from granufab.packing import Packing
from granufab.simulate import compress, random_sample


@pytest.fixture(scope="session", params=[2, 3])
def packed(request: pytest.FixtureRequest) -> Packing:
    """A compacted frictional sample of disks or spheres at rest under p = 1."""
    count = {2: 60, 3: 50}[request.param]
    return compress(random_sample(count, dimension=request.param, seed=3), friction=0.3)
