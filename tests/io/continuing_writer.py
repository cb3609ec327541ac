"""Begin or continue a run file and write without end until killed; prints the frame count.

Arguments: file, frames (and rows) to keep, "torn" to be killed inside the n-th setting of a
record or "run" to go on, n.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import numpy as np
from random_frames import random_frame, random_row

from granufab.io.run_file import RunFileWriter


class _TornWriter(RunFileWriter):
    """Kills its process inside a frame or row."""

    calls = 0

    def _put(self, name, index, value) -> None:  # type: ignore[no-untyped-def]
        super()._put(name, index, value)
        self._die_in_time()

    def _put_rows(self, name, first, last, value) -> None:  # type: ignore[no-untyped-def]
        super()._put_rows(name, first, last, value)
        self._die_in_time()

    def _die_in_time(self) -> None:
        _TornWriter.calls -= 1
        if _TornWriter.calls == 0:
            self._file.flush()
            os.kill(os.getpid(), signal.SIGKILL)


def main() -> None:
    path, kept, how, calls = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], int(sys.argv[4])
    kind = _TornWriter if how == "torn" else RunFileWriter
    _TornWriter.calls = calls
    base = random_frame(np.random.default_rng(0), grain_count=300).packing.grains
    if path.exists():
        writer = kind.continued(path, frames=kept, rows=kept)
    else:
        writer = kind(path, settings={"name": "loose"})
    for index in range(kept, 10**6):
        rng = np.random.default_rng(index)
        frame = random_frame(rng, grain_count=300, contact_count=500 + index % 90, base=base)
        writer.row(random_row(np.random.default_rng(index)))
        writer.frame(frame)
        print(index + 1, flush=True)


if __name__ == "__main__":
    main()
