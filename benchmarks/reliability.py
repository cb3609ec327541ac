"""Run the tests behind docs/reliability.md and keep what they count in docs/reliability.json.

    python benchmarks/reliability.py [quick|slow|both] [test …]

``quick`` are those of the default test command, ``slow`` those marked so (an hour or so). Tests
that are not run keep their entries. Every entry has its date, its command and its seconds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
STORED = ROOT / "docs" / "reliability.json"
TESTS = (
    *(
        "tests/reliability",
        "tests/campaign",
        "tests/cli/test_bad_input.py",
        "tests/cli/test_run.py",
    ),
    *("tests/io/test_checkpoint_file.py", "tests/io/test_damaged_files.py"),
    *("tests/io/test_damaged_run_file.py", "tests/io/test_declared_sizes.py"),
    *("tests/io/test_run_file_safety.py", "tests/io/test_run_lock.py"),
    *("tests/physics/test_invariants.py", "tests/physics/test_threads.py"),
    "tests/viewer/test_server.py",
)
"""Every test that the page names."""
Entries = dict[str, dict[str, Any]]


def run(speed: str, tests: tuple[str, ...]) -> Entries:
    """Run tests and return an entry for each test function, its cases together.

    Raises:
        SystemExit: a test failed; nothing is stored.
    """
    command = [
        "-m",
        "pytest",
        "-q",
        "-n",
        "0",
        "-m",
        "slow" if speed == "slow" else "not slow",
        *tests,
    ]
    with tempfile.TemporaryDirectory() as folder:
        told, report = Path(folder) / "told.jsonl", Path(folder) / "report.xml"
        done = subprocess.run(
            [sys.executable, *command, f"--junitxml={report}"],
            cwd=ROOT,
            env={**os.environ, "GRANUFAB_COUNTS": str(told)},
            check=False,
        )
        if done.returncode:
            raise SystemExit("a test failed: docs/reliability.json is left as it was")
        lines = told.read_text(encoding="utf-8").splitlines() if told.exists() else []
        entries = passed(report.read_text(encoding="utf-8"))
    for line in map(json.loads, lines):
        name, _, case = line.pop("test").partition("[")
        if "::" not in name:
            name += "::"
            entries.setdefault(name, {"passed": 0, "seconds": 0.0})
        entries[name].setdefault("told", []).append({"case": case.rstrip("]"), **line})
    stamp = {
        "date": time.strftime("%Y-%m-%d"),
        "command": f"python benchmarks/reliability.py {speed}",
    }
    return {f"{name} {speed}": {**stamp, **entry} for name, entry in sorted(entries.items())}


def passed(report: str) -> Entries:
    """How many cases of each test function passed, and their seconds."""
    found: Entries = {}
    for case in ElementTree.fromstring(report).iter("testcase"):
        if list(case):
            continue
        path = case.attrib["classname"].replace(".", "/") + ".py"
        name = f"{path}::{case.attrib['name'].partition('[')[0]}"
        entry = found.setdefault(name, {"passed": 0, "seconds": 0.0})
        entry["passed"] += 1
        entry["seconds"] = round(entry["seconds"] + float(case.attrib["time"]), 2)
    return found


def main(words: list[str]) -> None:
    """Renew the entries of the tests that are run."""
    speeds = [words[0]] if words and words[0] in ("quick", "slow") else ["quick", "slow"]
    tests = tuple(word for word in words if word not in ("quick", "slow", "both")) or TESTS
    for speed in speeds:
        entries = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
        entries |= run(speed, tests)
        text = json.dumps(dict(sorted(entries.items())), indent=1, ensure_ascii=False)
        STORED.write_text(text + "\n", encoding="utf-8")
        print(f"wrote {STORED}")


if __name__ == "__main__":
    main(sys.argv[1:])
