"""What a simulation imports: nothing heavy that it does not use."""

from __future__ import annotations

import subprocess
import sys

HEAVY = {"xarray", "pandas", "matplotlib", "h5py", "scipy.optimize"}


def test_simulating_imports_no_dataset_figure_or_file_library() -> None:
    text = "import sys, granufab.simulate; print(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert HEAVY.isdisjoint(done.stdout.split())
