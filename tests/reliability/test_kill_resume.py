"""A run that was killed ends, resumed, with the same bits as one that was not."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from run_digest import digest

from granufab.errors import InvalidSettings
from granufab.reproduce import case_folder, checkpoints
from granufab.reproduce.case_folder import RUN_FILES, run_into_folder
from granufab.simulate.engine_path import engine_path
from granufab.simulate.settings import Case, Material, Record, Sample, Stage

STAGES = (
    Stage(strain=0.012, inertial_number=3e-3),
    Stage(loading="isotropic", strain=0.01),
    Stage(strain=-0.008, inertial_number=3e-3),
)
KINDS = {
    "disks": Case(
        sample=Sample(grain_count=40, friction=0.2),
        material=Material(friction=0.3),
        path=STAGES,
        record=Record(checkpoint_strain=1e-3, frame_interval=4e-3),
    ),
    "walls": Case(
        sample=Sample(grain_count=40, friction=0.2, boundary="walls"),
        path=(Stage(loading="biaxial", strain=0.02, inertial_number=3e-3),),
        record=Record(checkpoint_strain=1e-3, frame_interval=4e-3),
    ),
    "spheres, sheared": Case(
        sample=Sample(grain_count=30, dimension=3, friction=0.2),
        path=(Stage(loading="simple-shear", strain=0.02, inertial_number=3e-3),),
        record=Record(checkpoint_strain=1e-3, frame_interval=4e-3),
    ),
}


class KilledError(BaseException):
    """Ends a run without any of its own clean-up of states."""


def end_after(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """Let the run die right after its checkpoint number ``count``."""
    write, made = checkpoints.write_checkpoint, [0]

    def written(*arguments: object) -> None:
        write(*arguments)  # type: ignore[arg-type]
        made[0] += 1
        if made[0] == count:
            raise KilledError

    monkeypatch.setattr(checkpoints, "write_checkpoint", written)


def resumed_from(
    counts: Sequence[int], kind: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> int:
    """End a run at its checkpoints of these numbers, and let it go on; returns how many."""
    case, tmp_path = KINDS[kind], folder
    run_into_folder(case, tmp_path / "whole")
    wanted, ended = digest(tmp_path / "whole"), 0
    for count in counts:
        folder = tmp_path / str(count)
        with monkeypatch.context() as patched:
            end_after(patched, count)
            try:
                run_into_folder(case, folder)
            except KilledError:
                ended += 1
                assert (folder / checkpoints.CHECKPOINT).exists()
        result = run_into_folder(case, folder, resume=True)
        assert digest(folder) == wanted, count
        assert result.summary["resumed"] == 1
        assert sorted(path.name for path in folder.iterdir()) == sorted(RUN_FILES)
    assert ended == len(counts)
    return ended


@pytest.mark.parametrize("kind", KINDS)
def test_from_some_checkpoints_the_same_end(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tell: Callable[..., None]
) -> None:
    monkeypatch.setenv("GRANUFAB_THREADS", "2")
    counts = (1, 6, 11, 19) if kind == "disks" else (9,)
    tell(checkpoints=resumed_from(counts, kind, tmp_path, monkeypatch), threads=2)


@pytest.mark.slow
@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize("kind", KINDS)
def test_from_every_checkpoint_the_same_end(
    kind: str,
    threads: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    tell: Callable[..., None],
) -> None:
    monkeypatch.setenv("GRANUFAB_THREADS", threads)
    ended = resumed_from(range(1, 21), kind, tmp_path, monkeypatch)
    tell(checkpoints=ended, threads=int(threads))


CHILD = """
import os, signal, sys
from pathlib import Path
sys.path[:0] = [{tests!r}]
from test_kill_resume import KINDS
from granufab.io import checkpoint_file, run_file
from granufab.reproduce.case_folder import run_into_folder

inside, left = {inside!r}, [{count}]

def counted(function):
    def called(*arguments, **named):
        left[0] -= 1
        if left[0] == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return function(*arguments, **named)
    return called

if inside == "checkpoint":
    checkpoint_file._blocks = counted(checkpoint_file._blocks)
elif inside == "run file":
    run_file.RunFileWriter._put = counted(run_file.RunFileWriter._put)
print("begins", flush=True)
run_into_folder(KINDS["disks"], Path({folder!r}), resume=True)
"""


def killed_run(folder: Path, chance: random.Random, inside: str, longest: float) -> bool:
    """Run a case in a process that is killed; returns whether it was killed before its end."""
    count = chance.randrange(1, 250 if inside == "checkpoint" else 900)
    text = CHILD.format(
        tests=str(Path(__file__).parent), inside=inside, count=count, folder=str(folder)
    )
    process = subprocess.Popen(
        [sys.executable, "-c", text],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "GRANUFAB_THREADS": "1"},
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begins\n"
        if not inside:
            while not (folder / "run.h5").exists() and process.poll() is None:
                time.sleep(0.005)
            time.sleep(chance.uniform(0, longest))
            process.kill()
        process.wait(timeout=120)
    return process.returncode == -signal.SIGKILL


def kills(folder: Path, count: int, seed: int) -> tuple[int, int]:
    """Kill runs until ``count`` kills struck, and let each go on; returns runs, kills in writes."""
    chance, struck, number, in_writes = random.Random(seed), 0, 0, 0
    case = KINDS["disks"]
    began = time.perf_counter()
    run_into_folder(case, folder / "whole")
    longest = 0.7 * (time.perf_counter() - began)
    wanted = digest(folder / "whole")
    while struck < count:
        inside = ("", "", "checkpoint", "run file")[number % 4]
        target = folder / f"run{number}"
        killed = killed_run(target, chance, inside, longest)
        run_into_folder(case, target, resume=True)
        assert digest(target) == wanted, (number, inside)
        struck, number = struck + killed, number + 1
        in_writes += killed and inside != ""
        assert number < 2 * count + 4, "most kills come too late"
    return number, in_writes


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_killed_at_any_time_the_same_end(
    count: int, tmp_path: Path, tell: Callable[..., None]
) -> None:
    number, in_writes = kills(tmp_path, count, seed=count)
    tell(runs=number, killed=count, inside_writes=in_writes)
    assert in_writes >= count // 4


def test_a_time_limit_ends_with_a_checkpoint(tmp_path: Path) -> None:
    case = KINDS["disks"]
    run_into_folder(case, tmp_path / "whole")
    parts = 0
    while True:
        run = run_into_folder(case, tmp_path / "parts", resume=True, max_walltime=1.0)
        parts += 1
        if not run.summary["interrupted"]:
            break
        assert run.summary["stopped_by"] == "max_walltime"
        assert (tmp_path / "parts" / checkpoints.CHECKPOINT).exists()
        assert parts < 50
    assert digest(tmp_path / "parts") == digest(tmp_path / "whole")


def interrupted(case: Case, folder: Path, monkeypatch: pytest.MonkeyPatch, count: int = 3) -> None:
    with monkeypatch.context() as patched, pytest.raises(KilledError):
        end_after(patched, count)
        run_into_folder(case, folder)


def test_resuming_needs_the_same_case_and_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = KINDS["disks"]
    interrupted(case, tmp_path, monkeypatch)
    other = case.model_copy(update={"material": Material(friction=0.5)})
    with pytest.raises(InvalidSettings, match=r"material\.friction was 0\.3, now 0\.5"):
        run_into_folder(other, tmp_path, resume=True)
    with pytest.raises(InvalidSettings, match="--resume to go on"):
        run_into_folder(case, tmp_path)
    with monkeypatch.context() as patched:
        other_engine = {**engine_path(), "kernels": "of another version"}
        patched.setattr(case_folder._Job, "engine", other_engine)
        with pytest.raises(InvalidSettings, match=r"kernels was .* --elsewhere"):
            run_into_folder(case, tmp_path, resume=True)
    run_into_folder(case, tmp_path, resume=True)
    before = (tmp_path / "run.h5").stat().st_mtime_ns
    assert run_into_folder(case, tmp_path, resume=True).summary["steps"] > 0
    assert (tmp_path / "run.h5").stat().st_mtime_ns == before
    with pytest.raises(InvalidSettings, match="is finished there: material"):
        run_into_folder(other, tmp_path, resume=True)


def test_a_damaged_checkpoint_gives_way_to_the_one_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = KINDS["disks"]
    run_into_folder(case, tmp_path / "whole")
    interrupted(case, tmp_path / "cut", monkeypatch, 5)
    file = tmp_path / "cut" / checkpoints.CHECKPOINT
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    run = run_into_folder(case, tmp_path / "cut", resume=True)
    assert digest(tmp_path / "cut") == digest(tmp_path / "whole")
    assert any("checksum" in warning for warning in run.summary["warnings"])
