"""Map of local strain: is the sample sheared as a whole, or in a band?"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.errors import MissingData
from granufab.plots.style import new_figure, style

__all__ = ["homogeneity"]


def homogeneity(strain: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Local deviatoric strain over the cell, in shares of its mean.

    Args:
        strain: result of :func:`granufab.fabric.local_strain` in 2D.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel; its axes are fractions of the cell.
    Raises:
        MissingData: the strain is that of a 3D state.
    """
    if strain.sizes["i"] != 2:
        raise MissingData("the map of local strain is drawn in 2D; this state is 3D")
    side = int(strain.attrs["cells"])
    local, mean = strain["eps_q"].to_numpy(), float(strain.attrs["eps_q"])
    field = np.full((side, side), np.nan)
    column, row = np.clip((strain["centre"].to_numpy() * side).astype(int), 0, side - 1).T
    field[row, column] = local / mean
    with style():
        ax = ax if ax is not None else new_figure(height=2.7)[1][0]
        reach = max(1.0, float(np.nanmax(np.abs(field - 1))))
        image = ax.imshow(
            field,
            origin="lower",
            extent=(0, 1, 0, 1),
            cmap="PuOr_r",
            vmin=1 - reach,
            vmax=1 + reach,
        )
        figure = ax.get_figure(root=True)
        assert figure is not None
        bar = figure.colorbar(image, ax=ax, shrink=0.78, pad=0.03)
        bar.set_label(r"$\varepsilon_q^{\mathrm{loc}}/\varepsilon_q$ [-]")
        bar.outline.set_linewidth(0.6)  # pyright: ignore[reportCallIssue]
        ax.set_xlabel(r"$x/L_x$ [-]")
        ax.set_ylabel(r"$y/L_y$ [-]")
    return ax
