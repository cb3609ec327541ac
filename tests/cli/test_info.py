"""``info`` says what a run file holds."""

from __future__ import annotations

import json
from pathlib import Path


def test_json(granufab, run_file: Path) -> None:
    done = granufab("info", run_file, "--json")
    assert done.code == 0
    found = json.loads(done.out)
    assert found["file"] == str(run_file)
    assert found["frames"] == 3
    assert found["rows"] == 40
    assert found["grain_count"] == 16
    assert found["dimension"] == 2


def test_the_table_for_people(granufab, run_file: Path) -> None:
    done = granufab("info", run_file)
    assert done.code == 0
    assert "grain count" in done.out
    assert "16" in done.out
