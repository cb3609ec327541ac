"""One look for every figure: a journal column, 84 mm wide, legible when printed.

Figures are made with matplotlib's object interface, so that no global state is touched and no
display is needed.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from granufab.errors import GranufabError

__all__ = [
    "COLOURS",
    "COLUMN",
    "FIT",
    "INK",
    "ON_SCREEN",
    "POINTS",
    "ColumnFigure",
    "letter_panels",
    "new_figure",
    "save",
    "style",
]

ON_SCREEN = 150
"""Dots per inch of a figure in a notebook."""

COLUMN = 84 / 25.4
"""Width of a journal column [inch]."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555")
"""Cycle of Okabe and Ito, told apart by colour-blind readers too."""

INK = "#222222"
"""Lines of theory, outlines and annotations."""

FIT = "#777777"
"""Accessible domain and its uncertainty."""

POINTS: dict[str, Any] = {"ms": 3, "mfc": "white", "mew": 0.8, "elinewidth": 0.7}
"""Look of measured points with error bars."""

_RC: dict[Any, Any] = {
    "font.family": ["STIXGeneral", "DejaVu Serif"],
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.labelsize": 10,
    "axes.titlesize": 9,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.labelpad": 3,
    "axes.axisbelow": True,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "xtick.minor.size": 1.6,
    "ytick.minor.size": 1.6,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
    "lines.linewidth": 1.1,
    "lines.markersize": 4,
    "lines.solid_capstyle": "round",
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "legend.fancybox": False,
    "legend.borderpad": 0.2,
    "legend.handlelength": 1.5,
    "legend.handletextpad": 0.5,
    "legend.labelspacing": 0.25,
    "legend.borderaxespad": 0.4,
    "figure.dpi": ON_SCREEN,
    "savefig.dpi": 300,
    "savefig.bbox": None,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "axes.prop_cycle": cycler(color=COLOURS),
}


class ColumnFigure(Figure):
    """A figure that keeps the house style whenever it is drawn or saved."""

    def draw(self, renderer: Any) -> None:
        """As of any figure, in the house style."""
        with style():
            super().draw(renderer)

    def savefig(self, *args: Any, **kwargs: Any) -> None:
        """As of any figure, in the house style."""
        with style():
            super().savefig(*args, **kwargs)

    def png(self) -> bytes:
        """The figure as a picture for the screen."""
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=ON_SCREEN)
        return stream.getvalue()

    def _repr_png_(self) -> bytes:  # a notebook shows it
        return self.png()


@contextmanager
def style() -> Iterator[None]:
    """Settings of a journal figure, put back on leaving."""
    with matplotlib.rc_context(_RC):
        yield


def new_figure(
    *,
    width: float = COLUMN,
    height: float | None = None,
    rows: int = 1,
    share: bool = True,
    ratios: Sequence[float] | None = None,
    **subplot: Any,
) -> tuple[Figure, list[Axes]]:
    """An empty figure in the house style.

    Args:
        width: [inch].
        height: [inch]; by default 0.78 of the width for each row.
        rows: number of panels, one above another.
        share: the panels have a common abscissa.
        ratios: relative heights of the panels, equal by default.
        subplot: passed to ``Figure.add_subplot``.
    Returns:
        The figure and its panels from top to bottom.
    """
    with style():
        size = (width, height if height is not None else 0.78 * width * rows)
        figure = ColumnFigure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(rows, 1, height_ratios=ratios)
        axes: list[Axes] = []
        for row in range(rows):
            first = axes[0] if axes and share else None
            axes.append(figure.add_subplot(grid[row], sharex=first, **subplot))
    return figure, axes


def save(figure: Figure, stem: Path | str) -> tuple[Path, Path]:
    """Write ``stem.pdf`` (vectors, embedded TrueType fonts) and ``stem.png`` (300 dots per inch).

    Args:
        figure: to be written.
        stem: path without the endings.
    Returns:
        The two files.
    Raises:
        GranufabError: a file cannot be written.
    """
    stem = Path(stem)
    files = stem.with_name(stem.name + ".pdf"), stem.with_name(stem.name + ".png")
    try:
        with style():
            figure.savefig(files[0], metadata={"CreationDate": None})
            figure.savefig(files[1], dpi=300)
    except OSError as error:
        raise GranufabError(f"{stem}: the figure cannot be written ({error})") from None
    return files


def letter_panels(panels: Sequence[Axes]) -> None:
    """Name panels (a), (b)… in their lower left corners."""
    with style():
        for letter, panel in zip("abcdefgh", panels, strict=False):
            where = {"transform": panel.transAxes, "va": "bottom", "ha": "left", "zorder": 5}
            panel.text(0.025, 0.045, f"({letter})", **where)
