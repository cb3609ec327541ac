"""Lets the tests of this folder import their own modules; counts are shown by ``pytest -s``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
