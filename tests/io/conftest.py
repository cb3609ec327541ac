"""Let the tests here, and the writers they start and kill, share ``random_frames``."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
