"""The paper's figures as recipes: simulate, fit, draw, and leave every number beside."""

from __future__ import annotations

from granufab.reproduce.case_folder import run_into_folder
from granufab.reproduce.engine import FIGURES, reproduce

__all__ = ["FIGURES", "reproduce", "run_into_folder"]
