"""The kernels mean the same as plain Python and compiled."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tiny_steps

import granufab


@pytest.fixture(scope="module")
def plain() -> dict[str, list[float]]:
    """The same steps in a process whose kernels are not compiled."""
    package = str(Path(granufab.__file__).resolve().parents[1])
    done = subprocess.run(
        [sys.executable, tiny_steps.__file__],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": package},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def compiled() -> dict[str, list[float]]:
    return tiny_steps.results()


@pytest.mark.parametrize("name", ["pyramid", "biaxial", "bounce", "spheres"])
def test_plain_and_compiled_kernels_agree(name, plain, compiled):
    one, two = np.array(plain[name]), np.array(compiled[name])
    assert two == pytest.approx(one, rel=1e-12, abs=1e-12)
    assert np.abs(one).max() > 0
    assert one[-1] > 0, "no contacts were solved"


def test_many_contacts_are_packed_without_compilation() -> None:
    code = (
        "import numpy as np\n"
        "from granufab.kernels.schedule import Plan, schedule\n"
        "first = np.arange(400, dtype=np.int32)\n"
        "plan = Plan.of(np.zeros(401, np.int64), 1, 400)\n"
        "batches, order = schedule(plan, first, first + 1), plan.order[:400]\n"
        "assert len(set(order.tolist())) == 400 and order.max() < 8 * batches\n"
    )
    package = str(Path(granufab.__file__).resolve().parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": package},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
