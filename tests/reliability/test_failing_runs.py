"""A run that breaks or finds the disk full ends in one line; what it made before is whole."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from run_digest import digest

import granufab as gf
import granufab.simulate.paths as paths
from granufab.cli import main
from granufab.io import read_checkpoint
from granufab.reproduce.case_folder import run_into_folder
from granufab.reproduce.checkpoints import CHECKPOINT
from granufab.simulate import Case, Material, Record, Sample, Simulation, Stage
from granufab.simulate.settings import to_toml

HERE, SOURCE = Path(__file__).parent, Path(__file__).parents[2] / "src"
CASE = Case(
    sample=Sample(grain_count=40, friction=0.3),
    material=Material(friction=0.3),
    path=(Stage(strain=0.01, inertial_number=3e-3),),
    record=Record(frame_interval=1e-3, series_interval=1e-3, checkpoint_strain=2e-3),
)
FAULTS = {
    "nan": ("is not finite", lambda s: s.position.__setitem__((7, 0), np.nan)),
    "inf": ("is not finite", lambda s: s.motion.__setitem__((7, 1), np.inf)),
    "radius": ("radius of grain 7", lambda s: s.radius.__setitem__(7, -0.5)),
    "mass": ("mass of grain 7", lambda s: s.motion.__setitem__((7, 3), -1.0)),
    "overlap": ("overlap", lambda s: s.position.__setitem__(7, s.position[8] + 0.1)),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run that nothing disturbs."""
    folder = tmp_path_factory.mktemp("runs") / "whole"
    run_into_folder(CASE, folder)
    return folder


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_state_ends_the_run_and_keeps_what_was_good(
    fault: str,
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """After the seventh call of the engine a number goes wrong; resumed without, the run ends."""
    words, spoil = FAULTS[fault]

    class Spoiled(Simulation):
        calls = 0

        def advance(self, *arguments, **named):
            self.calls += 1
            if self.calls == 7:
                spoil(self)
            return super().advance(*arguments, **named)

    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(to_toml(CASE))
    with monkeypatch.context() as patched:
        patched.setattr(paths, "Simulation", Spoiled)
        with pytest.raises(SystemExit) as ended:
            main(["run", str(case), "--out", str(out)])
    told = capsys.readouterr().err.splitlines()[-1]
    assert ended.value.code == 1
    assert words in told
    assert "grain" in told
    assert "7" in told
    run = gf.read(out / "run.h5")
    frames = list(run.frames)
    assert f"{len(frames)} good frames before it are in {out / 'run.h5'}" in told
    assert 1 < len(frames) < 11
    assert all(np.isfinite(frame.packing.grains.position).all() for frame in frames)
    assert run.series.sizes["record"] >= len(frames)
    with pytest.raises(SystemExit) as ended:
        main(["measure", str(out / "run.h5"), "--json"])
    assert ended.value.code == 0
    assert read_checkpoint(out / CHECKPOINT).notes["frames"] <= len(frames)
    run_into_folder(CASE, out, resume=True)
    assert digest(out) == digest(whole)


FULL = """
import resource, sys
from granufab.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
main(["run", sys.argv[2], "--out", sys.argv[3]])
"""


def _with_full_disk(case: Path, out: Path, size: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", FULL, str(size), str(case), str(out)],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(SOURCE)},
    )


@pytest.mark.skipif(sys.platform == "win32", reason="needs RLIMIT_FSIZE")
@pytest.mark.parametrize(
    "share",
    [pytest.param(0.35, marks=pytest.mark.slow), 0.6, pytest.param(0.95, marks=pytest.mark.slow)],
)
def test_a_full_disk_ends_the_run_in_one_line_and_it_resumes(
    share: float, whole: Path, tmp_path: Path, tell: Callable[..., None]
) -> None:
    """Files may grow to a share of the whole run file; the rest of the run follows later."""
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(to_toml(CASE))
    size = int(share * (whole / "run.h5").stat().st_size)
    done = _with_full_disk(case, out, size)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1
    assert str(out) in done.stderr
    assert "Traceback" not in done.stderr
    frames = len(gf.read(out / "run.h5").frames) if (out / "run.h5").exists() else 0
    tell(share=share, frames=frames)
    if (out / CHECKPOINT).exists():
        assert read_checkpoint(out / CHECKPOINT).notes["frames"] <= frames
    assert not [path for path in out.iterdir() if path.suffix in (".tmp", ".part")]
    run_into_folder(CASE, out, resume=True, force=True)
    assert digest(out) == digest(whole)


def test_a_full_disk_at_a_checkpoint_keeps_the_one_before(
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The third checkpoint finds no room."""
    import granufab.io.checkpoint_file as checkpoint_file

    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(to_toml(CASE))
    sync, calls = os.fsync, [0]

    def full(descriptor: int) -> None:
        calls[0] += 1
        if calls[0] == 8:
            raise OSError(28, "No space left on device")
        sync(descriptor)

    with monkeypatch.context() as patched:
        patched.setattr(checkpoint_file.os, "fsync", full)
        with pytest.raises(SystemExit) as ended:
            main(["run", str(case), "--out", str(out)])
    told = capsys.readouterr().err.splitlines()[-1]
    assert ended.value.code == 1
    assert "No space left" in told
    assert str(out) in told
    assert calls[0] >= 8
    held = read_checkpoint(out / CHECKPOINT)
    assert held.notes["frames"] > 0
    run_into_folder(CASE, out, resume=True)
    assert digest(out) == digest(whole)
