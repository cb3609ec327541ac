"""Figures of a journal's column: functions take results and return matplotlib axes."""

from __future__ import annotations

from granufab.plots.homogeneity import homogeneity
from granufab.plots.mohr import mohr
from granufab.plots.network import network
from granufab.plots.path import path
from granufab.plots.rose import rose
from granufab.plots.series import series
from granufab.plots.style import new_figure, save, style
from granufab.plots.zaz import zaz

__all__ = [
    "homogeneity",
    "mohr",
    "network",
    "new_figure",
    "path",
    "rose",
    "save",
    "series",
    "style",
    "zaz",
]
