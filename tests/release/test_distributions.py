"""The wheel works without the source tree: built, installed in a new environment, and tested."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = os.environ.get(
    "GRANUFAB_WHEEL_TESTS", "tests/architecture tests/states tests/fabric"
).split()
"""What is run against the wheel; ``tests`` is everything that ``pytest`` runs."""


def _run(*words: object, folder: Path) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode and "No matching distribution" in done.stdout + done.stderr:
        pytest.skip("no packages to install from")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel and the source distribution, the wheel built from the latter."""
    pytest.importorskip("build", reason="build comes with the extra release")
    folder = tmp_path_factory.mktemp("dist")
    _run(sys.executable, "-m", "build", "--outdir", folder, ROOT, folder=folder)
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


@pytest.mark.slow
def test_the_source_holds_tests_documentation_and_benchmarks(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    for name in ("tests/conftest.py", "docs/index.md", "docs/figures.json", "benchmarks/pages.py"):
        assert name in names
    for name in ("paper/paper.md", "CITATION.cff", "SECURITY.md", "constraints.txt", ".ci/run"):
        assert name in names
    assert not [name for name in names if "__pycache__" in name or name.startswith("build/")]


@pytest.mark.slow
def test_the_tests_pass_against_the_wheel(built: tuple[Path, Path], tmp_path: Path) -> None:
    wheel, source = built
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path, filter="data")
    (tree,) = tmp_path.iterdir()
    for path in sorted((tree / "src").rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    _run(sys.executable, "-m", "venv", tmp_path / "env", folder=tmp_path)
    python = tmp_path / "env" / "bin" / "python"
    pins = tree / "constraints.txt"
    _run(python, "-m", "pip", "install", "-q", f"{wheel}[test]", "-c", pins, folder=tmp_path)
    where = _run(python, "-c", "import granufab; print(granufab.__file__)", folder=tree)
    assert where.startswith(str(tmp_path / "env"))
    told = _run(python, "-m", "pytest", "-q", *TESTS, folder=tree)
    assert " passed" in told
