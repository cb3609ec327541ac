"""Whether a planned run fits into memory and disk; refused before it starts where it does not."""

from __future__ import annotations

import shutil
from pathlib import Path

from granufab.errors import InvalidSettings
from granufab.simulate.available import Room, memory_available
from granufab.simulate.demand import Demand, demand_of
from granufab.simulate.settings import Case

__all__ = ["check_fits", "disk_available", "in_words"]


def check_fits(case: Case, folder: Path, *, prepared: bool = False, frames: int = 0) -> Demand:
    """What a run needs, if there is that much.

    Args:
        case: with the grain count of its sample.
        folder: of the run; it may not exist yet.
        prepared: the sample is there already.
        frames: that are in the folder already.
    Raises:
        InvalidSettings: memory or disk do not suffice; says how much is needed and there.
    """
    demand = demand_of(case, prepared=prepared)
    memory = memory_available()
    if memory is not None and demand.memory > memory.size:
        raise InvalidSettings(
            f"sample.grain_count = {case.sample.grain_count}: the run needs about "
            f"{in_words(demand.memory)} of memory, there are {in_words(memory.size)} "
            f"({memory.source}); nothing was started; take fewer grains or another machine"
        )
    disk = disk_available(folder)
    left = round(demand.disk * max(0, demand.frames - frames) / demand.frames)
    if disk is not None and left > disk.size:
        raise InvalidSettings(
            f"{folder}: the run needs about {in_words(left)} of disk for {demand.frames - frames} "
            f"frames, there are {in_words(disk.size)}; nothing was started; raise "
            "record.frame_interval, or choose another folder"
        )
    return demand


def disk_available(folder: Path) -> Room | None:
    """Free disk where a folder is or will be; None where the system does not tell."""
    for place in (folder, *folder.absolute().parents):
        try:
            return Room(shutil.disk_usage(place).free, f"disk of {place}")
        except FileNotFoundError:
            continue
        except OSError:
            return None
    return None


def in_words(size: float) -> str:
    """Bytes in words, three digits."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if abs(size) < 999.5:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.4g} TB"
