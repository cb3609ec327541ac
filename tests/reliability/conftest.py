"""Lets the tests of this folder import ``reliability_cases``; prints counts with ``pytest -s``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
