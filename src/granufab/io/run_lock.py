"""One writer per run folder: a lock file that names who holds it.

HDF5's own locks can be switched off from outside, and do not cover the files beside the run
file. Here a complete file is linked into place, which succeeds for one process only, on network
file systems too. A lock whose process is gone is recognised on the machine that made it; one of
another machine is left alone, for nobody can know from here.
"""

from __future__ import annotations

import json
import os
import platform
import secrets
import time
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Self

from granufab.errors import InvalidSettings

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None

__all__ = ["LOCK_NAME", "Owner", "RunLock"]

LOCK_NAME = "run.lock"
_PATIENCE = 0.5
_LARGEST = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Owner:
    """Who holds a lock.

    Attributes:
        pid: process id.
        host: name of its machine.
        machine: identity of the machine, "" where the system does not tell.
        boot: identity of its boot, or "".
        namespace: of the process ids (containers have their own), or "".
        begun: start of the process in clock ticks since the boot, −1 where unknown; another
            value under the same pid is another process.
        since: when the lock was taken, ISO 8601, UTC.
        token: differs between any two locks.
    """

    pid: int
    host: str
    machine: str = ""
    boot: str = ""
    namespace: str = ""
    begun: int = -1
    since: str = ""
    token: str = ""

    @classmethod
    def this_process(cls) -> Owner:
        """An owner with a token of its own."""
        pid = os.getpid()
        _, begun = _process(pid)
        return cls(
            pid=pid,
            host=platform.node(),
            machine=_text("/etc/machine-id"),
            boot=_text("/proc/sys/kernel/random/boot_id"),
            namespace=_namespace(),
            begun=begun,
            since=datetime.now(UTC).isoformat(timespec="seconds"),
            token=secrets.token_hex(8),
        )

    def is_gone(self) -> bool:
        """Whether the process certainly runs no more, as far as this machine can tell."""
        here = Owner.this_process()
        if (self.host, self.machine) != (here.host, here.machine):
            return False
        if self.boot != here.boot and self.boot and here.boot:
            return True
        if self.namespace != here.namespace or os.name != "posix":
            return False
        alive, begun = _process(self.pid)
        return not alive or (begun != self.begun and -1 not in (begun, self.begun))


class RunLock:
    """Hold a folder against other processes while the block runs.

    Args:
        folder: made if missing.
        name: of the lock file; another one locks something else in the folder.

    Entering raises:
        InvalidSettings: another process holds it, the lock file cannot be understood, or the
            folder cannot be written.
    """

    _held: ClassVar[dict[Path, tuple[int, str]]] = {}

    def __init__(self, folder: Path | str, *, name: str = LOCK_NAME) -> None:
        self.folder = Path(folder)
        self.path = self.folder / name
        self._give_back: weakref.finalize | None = None  # also if it is forgotten, and at exit

    @classmethod
    def is_held_here(cls, folder: Path | str, *, name: str = LOCK_NAME) -> bool:
        """Whether this process holds the lock of a folder."""
        held = cls._held.get((Path(folder) / name).absolute())
        return held is not None and held[0] == os.getpid()

    def acquire(self) -> None:
        """Take the lock, also one left by a process that is gone.

        Raises:
            InvalidSettings: see the class.
        """
        owner = Owner.this_process()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            end = time.monotonic() + _PATIENCE
            while not _placed(self.path, owner):
                self._clear_or_refuse(end)
        except OSError as error:
            reason = error.strerror or str(error)
            raise InvalidSettings(f"{self.path}: cannot be written ({reason})") from None
        place = self.path.absolute()
        self._held[place] = (owner.pid, owner.token)
        self._give_back = weakref.finalize(self, _give_back, place, owner)

    def release(self) -> None:
        """Give the lock back; does nothing where this process does not hold it."""
        if self._give_back is not None:
            self._give_back()

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()

    def _clear_or_refuse(self, end: float) -> None:
        """Remove a lock whose owner is gone; otherwise raise."""
        owner = _read(self.path)
        if owner is None:
            if self.path.exists() and time.monotonic() > end:
                raise InvalidSettings(
                    f"{self.path}: is no lock file of granufab; if no run is going there, delete it"
                )
            time.sleep(0.02)  # just released, or being written
            return
        if not owner.is_gone() or time.monotonic() > end:
            raise InvalidSettings(self._refusal(owner))
        _remove_stale(self.path, owner)

    def _refusal(self, owner: Owner) -> str:
        here = Owner.this_process()
        text = (
            f"{self.folder}: is in use by process {owner.pid} on {owner.host or 'this machine'} "
            f"since {owner.since}; "
        )
        if owner.pid == here.pid and owner.begun == here.begun and owner.host == here.host:
            return text + "that is this process: close its run first"
        near = (owner.host, owner.machine, owner.namespace)
        if near == (here.host, here.machine, here.namespace):
            return text + "wait for it, stop it, or choose another folder"
        return text + f"if it runs no more, delete {self.path}; else choose another folder"


def _give_back(place: Path, owner: Owner) -> None:
    """Remove the lock of this process."""
    if owner.pid != os.getpid():  # a forked child holds nothing
        return
    RunLock._held.pop(place, None)
    found = _read(place)
    if found is not None and found.token == owner.token:
        with suppress(OSError):
            place.unlink(missing_ok=True)


def _placed(path: Path, owner: Owner) -> bool:
    """Link a complete lock file into place; False where there is one."""
    content = json.dumps(asdict(owner)).encode()
    unique = path.with_name(f".{path.name}.{owner.token}")
    try:
        _write_new(unique, content)
        try:
            os.link(unique, path)
        except FileExistsError:
            return unique.stat().st_nlink == 2  # NFS may repeat a call that had succeeded
        except OSError:  # a file system without links
            try:
                _write_new(path, content)
            except FileExistsError:
                return False
        return True
    finally:
        unique.unlink(missing_ok=True)


def _write_new(path: Path, content: bytes) -> None:
    handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
    try:
        os.write(handle, content)
        os.fsync(handle)
    finally:
        os.close(handle)


def _read(path: Path) -> Owner | None:
    """The owner; None where there is no lock or it cannot be understood."""
    try:
        with path.open("rb") as stream:
            content = json.loads(stream.read(_LARGEST))
        owner = Owner(**content)
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    kinds = {"pid": int, "begun": int}
    right = all(type(value) is kinds.get(name, str) for name, value in asdict(owner).items())
    return owner if right and owner.pid > 0 else None


def _remove_stale(path: Path, owner: Owner) -> None:
    """Remove a lock; of several processes that found it stale, one does."""
    with suppress(FileNotFoundError), path.open("r+b") as stream, _exclusively(stream.fileno()):
        found = _read(path)  # another process may have put its own there
        if found is not None and found.token == owner.token:
            path.unlink()


@contextmanager
def _exclusively(handle: int) -> Iterator[None]:
    """Shut others out of a file that is held open; passes where the system has no such lock."""
    if fcntl is None:
        yield
        return
    with suppress(OSError):
        fcntl.flock(handle, fcntl.LOCK_EX)  # held for a moment, and freed if its holder dies
    yield


def _process(pid: int) -> tuple[bool, int]:
    """Whether a process runs, and its start in clock ticks since the boot (−1 if unknown)."""
    try:
        content = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        fields = content.rpartition(")")[2].split()
        return fields[0] not in ("Z", "X"), int(fields[19])  # a zombie only waits for its parent
    except (OSError, IndexError, ValueError):
        pass
    if os.name != "posix":
        return True, -1
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False, -1
    except PermissionError:
        pass
    return True, -1


def _namespace() -> str:
    with suppress(OSError):
        return str(Path("/proc/self/ns/pid").readlink())
    return ""


def _text(path: str) -> str:
    with suppress(OSError):
        return Path(path).read_text(encoding="utf-8", errors="replace").strip()
    return ""
