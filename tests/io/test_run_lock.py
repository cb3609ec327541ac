"""One process holds a run's folder; locks of processes that are gone are taken over."""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import signal
import subprocess
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from granufab.errors import InvalidSettings
from granufab.io.run_lock import LOCK_NAME, Owner, RunLock

HOLD = """
import sys, time
from granufab.io.run_lock import RunLock
with RunLock(sys.argv[1]):
    print("held", flush=True)
    how = sys.stdin.readline().strip()
    if how == "raise":
        raise RuntimeError("failed")
    if how == "exit":
        sys.exit(4)
"""
linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")


def _holder(folder: Path) -> subprocess.Popen[str]:
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "held\n"
    return child


def _write(folder: Path, **changes: Any) -> Path:
    path = folder / LOCK_NAME
    path.write_text(json.dumps(asdict(replace(Owner.this_process(), **changes))))
    return path


def _dead_pid() -> int:
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    return done.pid


def test_a_second_process_is_refused_at_once(tmp_path: Path) -> None:
    child = _holder(tmp_path)
    started = time.perf_counter()
    with pytest.raises(InvalidSettings) as caught:
        RunLock(tmp_path).acquire()
    took = time.perf_counter() - started
    text = str(caught.value)
    assert f"process {child.pid} on {platform.node()}" in text
    assert str(tmp_path) in text and "choose another folder" in text and "\n" not in text
    assert took < 1.0
    child.communicate("go on\n", timeout=30)
    with RunLock(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("how", "code"), [("go on", 0), ("raise", 1), ("exit", 4)])
def test_it_is_released_when_the_process_ends(tmp_path: Path, how: str, code: int) -> None:
    child = _holder(tmp_path)
    child.communicate(f"{how}\n", timeout=30)
    assert child.returncode == code
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_a_killed_process_leaves_a_stale_lock(tmp_path: Path) -> None:
    child = _holder(tmp_path)
    child.send_signal(signal.SIGKILL)
    time.sleep(0.2)  # it is a zombie until it is waited for
    assert (tmp_path / LOCK_NAME).exists()
    with RunLock(tmp_path) as lock:
        assert RunLock.is_held_here(tmp_path)
        assert json.loads(lock.path.read_text())["pid"] == os.getpid()
    child.communicate()
    assert list(tmp_path.iterdir()) == []


@linux
def test_another_process_under_the_same_pid_is_told_by_its_start(tmp_path: Path) -> None:
    here = Owner.this_process()
    _write(tmp_path, begun=here.begun - 1)
    with RunLock(tmp_path):
        pass
    _write(tmp_path, boot="an earlier one", namespace="pid:[1]")
    with RunLock(tmp_path):
        pass
    _write(tmp_path, pid=_dead_pid())
    with RunLock(tmp_path):
        pass
    _write(tmp_path)
    with pytest.raises(InvalidSettings, match="that is this process"):
        RunLock(tmp_path).acquire()


@pytest.mark.parametrize("change", [{"host": "node17"}, {"machine": "m"}, {"namespace": "pid:[1]"}])
def test_a_lock_of_elsewhere_is_never_broken(tmp_path: Path, change: dict[str, str]) -> None:
    path = _write(tmp_path, pid=_dead_pid(), **change)
    before = path.read_bytes()
    with pytest.raises(InvalidSettings) as caught:
        RunLock(tmp_path).acquire()
    assert f"delete {path}" in str(caught.value)
    assert change.get("host", "") in str(caught.value)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    path.unlink()
    with RunLock(tmp_path):
        pass


@pytest.mark.parametrize(
    "content", ["", "{", "[1]", "{}", '{"pid": "1", "host": ""}', '{"pid": -1, "host": "x"}']
)
def test_what_is_no_lock_is_left_alone(tmp_path: Path, content: str) -> None:
    path = tmp_path / LOCK_NAME
    path.write_text(content)
    with pytest.raises(InvalidSettings, match="delete it"):
        RunLock(tmp_path).acquire()
    assert path.read_text() == content


def test_a_lock_that_was_taken_away_is_not_released(tmp_path: Path) -> None:
    with RunLock(tmp_path) as lock:
        lock.path.unlink()
        _write(tmp_path, host="node17")
    assert (tmp_path / LOCK_NAME).exists()


def test_the_folder_is_made_and_must_be_writable(tmp_path: Path) -> None:
    with RunLock(tmp_path / "deep" / "run"):
        assert (tmp_path / "deep" / "run" / LOCK_NAME).exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidSettings, match="cannot be written"):
        RunLock(tmp_path / "file").acquire()


def _race(folder: str, start: Any, won: Any, inside: Any) -> None:
    start.wait()
    for _ in range(40):
        try:
            with RunLock(folder):
                with inside.get_lock():
                    inside.value += 1
                    alone = inside.value == 1
                if alone:
                    with won.get_lock():
                        won.value += 1
                time.sleep(0.001)
                with inside.get_lock():
                    inside.value -= 1
                if not alone:
                    os._exit(9)
        except InvalidSettings:
            time.sleep(0.0005)


@linux
def test_of_many_processes_one_takes_over_a_stale_lock(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    won, inside, start = context.Value("i", 0), context.Value("i", 0), context.Event()
    arguments = (str(tmp_path), start, won, inside)
    children = [context.Process(target=_race, args=arguments) for _ in range(4)]
    for child in children:
        child.start()
    _write(tmp_path, pid=_dead_pid())
    start.set()
    for child in children:
        child.join(timeout=60)
    assert [child.exitcode for child in children] == [0] * 4
    assert won.value > 4
    assert list(tmp_path.iterdir()) == []


def test_a_forked_child_does_not_release_it(tmp_path: Path) -> None:
    if not hasattr(os, "fork"):
        pytest.skip("needs fork")
    with RunLock(tmp_path) as lock:
        child = os.fork()
        if child == 0:
            lock.release()
            os._exit(1 if RunLock.is_held_here(tmp_path) else 0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert lock.path.exists()


def test_a_forgotten_lock_is_given_back(tmp_path: Path) -> None:
    lock = RunLock(tmp_path)
    lock.acquire()
    del lock
    assert not RunLock.is_held_here(tmp_path)
    assert list(tmp_path.iterdir()) == []
    code = "import sys; from granufab.io.run_lock import RunLock; x = RunLock(sys.argv[1]); "
    subprocess.run([sys.executable, "-c", code + "x.acquire()", str(tmp_path)], check=True)
    assert list(tmp_path.iterdir()) == []
