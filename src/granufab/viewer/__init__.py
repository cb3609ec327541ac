"""The viewer in the browser: data of runs as plain numbers and buffers, and a small server.

``frame_data``, ``state_data`` and ``run_data`` need nothing but the package itself; ``server``
needs the extra ``view``. What is sent is described in docs/viewer.md.
"""

from granufab.viewer.choice import Choice
from granufab.viewer.frame_data import frame_buffer, unpack
from granufab.viewer.run_data import fit_data, overview, series_data
from granufab.viewer.state_data import criterion_data, interval_data, state_data
from granufab.viewer.viewed_run import ViewedRun

__all__ = [
    "Choice",
    "ViewedRun",
    "criterion_data",
    "fit_data",
    "frame_buffer",
    "interval_data",
    "overview",
    "series_data",
    "state_data",
    "unpack",
]
