"""Synthetic figures; lets tests, and the worker processes that they start, import them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from synthetic_run import reproduce_synthetic, synthetic_run

from granufab.simulate.settings import Case


@pytest.fixture(scope="session")
def everything(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], list[Case]]:
    """The folder of ``reproduce all``, what it returned, and the cases that were run."""
    folder = tmp_path_factory.mktemp("figures") / "all"
    cases: list[Case] = []

    def run(case: Case, **options: Any) -> Any:
        cases.append(case)
        return synthetic_run(case, **options)

    return folder, reproduce_synthetic("all", folder, run_case=run), cases


@pytest.fixture(scope="session")
def results(everything: Any) -> dict[str, Any]:
    return everything[1]


@pytest.fixture(scope="session")
def single(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder of ``reproduce fig7`` alone, and what it returned."""
    folder = tmp_path_factory.mktemp("single") / "fig7"
    return folder, reproduce_synthetic("fig7", folder)
