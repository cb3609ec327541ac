"""Settings every test needs before matplotlib is first imported.

Compiled kernels need none: their cache folder is named by a hash of their sources
(``granufab.kernels.options``), so an edited kernel is never served stale.
"""

from __future__ import annotations

import os

os.environ.setdefault("MPLBACKEND", "Agg")
