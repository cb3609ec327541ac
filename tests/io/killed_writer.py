"""Write frames without end until killed; prints the count after each complete frame.

Arguments: file, "exit" to leave by os._exit in the middle of the fourth frame, "run" otherwise.
"""

from __future__ import annotations

import os
import sys

import numpy as np
from random_frames import random_frame, random_row

from granufab.io.run_file import RunFileWriter


class _DyingWriter(RunFileWriter):
    """Leaves the process once the fourth frame's first datasets are written."""

    def _put(self, name, index, value) -> None:  # type: ignore[no-untyped-def]
        super()._put(name, index, value)
        if name == "frames/strain" and index == 3:
            self._file.flush()
            os._exit(9)


def main() -> None:
    path, how = sys.argv[1:]
    rng = np.random.default_rng(5)
    writer = (_DyingWriter if how == "exit" else RunFileWriter)(path, settings={"name": "loose"})
    base = None
    for count in range(10**6):
        frame = random_frame(rng, grain_count=300, contact_count=500 + count % 90, base=base)
        base = frame.packing.grains
        writer.row(random_row(rng, "loose"))
        writer.frame(frame)
        print(count + 1, flush=True)


if __name__ == "__main__":
    main()
