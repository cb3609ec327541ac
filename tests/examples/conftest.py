"""Lets tests, and the worker processes that they start, import the synthetic simulation."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
