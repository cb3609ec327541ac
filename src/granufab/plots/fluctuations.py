"""Non-affine displacements: distribution, growth with strain, power spectrum."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, NullLocator

from granufab.packing import Array
from granufab.plots.style import COLOURS, FIT, INK, POINTS, letter_panels, new_figure, style

__all__ = [
    "fluctuation_growth",
    "fluctuation_kurtosis",
    "fluctuation_pdf",
    "fluctuation_spectrum",
    "fluctuations",
]

_WAVES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10)

MARKERS = ("o", "^", "s", "D", "v", "<", ">")


def fluctuations(data: xr.Dataset, spectrum: xr.Dataset | None = None) -> list[Axes]:
    """Distribution, kurtosis, growth and (if given) spectrum, one panel above another.

    Args:
        data: result of :func:`granufab.fabric.fluctuations`.
        spectrum: result of :func:`granufab.fabric.fluctuation_spectrum`.
    Returns:
        The three or four panels.
    """
    rows = 3 if spectrum is None else 4
    with style():
        _, panels = new_figure(rows=rows, height=2.1 * rows, share=False)
        fluctuation_pdf(data, ax=panels[0])
        fluctuation_kurtosis(data, ax=panels[1])
        fluctuation_growth(data, ax=panels[2])
        if spectrum is not None:
            fluctuation_spectrum(spectrum, ax=panels[3])
        letter_panels(panels)
    return panels


def fluctuation_pdf(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Probability density of the scaled displacements for several windows, and a Gaussian.

    Args:
        data: result of :func:`granufab.fabric.fluctuations`.
        ax: panel to draw into; a new column-wide figure by default.
    """
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        value = data["value"].to_numpy()
        chosen = np.unique(np.linspace(0, data.sizes["window"] - 1, 3).round().astype(int))
        for index, row in enumerate(chosen):
            pdf, error = (data[name].to_numpy()[row] for name in ("pdf", "pdf_error"))
            seen = pdf > 0
            ax.errorbar(
                value[seen],
                pdf[seen],
                yerr=np.minimum(error[seen], 0.9 * pdf[seen]),
                fmt=MARKERS[index],
                ms=2.4,
                mfc="white",
                mew=0.7,
                elinewidth=0.5,
                color=COLOURS[index],
                label=_window_name(float(data["strain"][row])),
            )
        ax.plot(value, np.exp(-0.5 * value**2) / np.sqrt(2 * np.pi), color=INK, label="Gaussian")
        ax.set_yscale("log")
        lowest = data["pdf"].to_numpy()[data["pdf"].to_numpy() > 0].min()
        ax.set_ylim(max(0.2 * lowest, 1e-6), 2.0)
        ax.set_xlim(-6.2, 6.2)
        ax.set_xlabel("component of $u$\N{PRIME} over its rms [-]")
        ax.set_ylabel("probability density [-]")
        ax.legend(loc="upper right", fontsize=7.5)
    return ax


def _window_name(strain: float) -> str:
    return "velocities" if strain == 0 else rf"$\Delta\varepsilon_q = {strain:.3g}$"


def fluctuation_kurtosis(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Excess kurtosis of each component against the window of strain; 0 is Gaussian.

    The points at 0, apart from the others, are those of the velocities.

    Args:
        data: result of :func:`granufab.fabric.fluctuations`.
        ax: panel to draw into; a new column-wide figure by default.
    """
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        moved = data["strain"].to_numpy() > 0
        strain = data["strain"].to_numpy()[moved]
        # The velocities stand for a window of zero, which a logarithmic axis cannot show.
        first = 0.35 * strain[0]
        place = strain if moved.all() else np.concatenate([[first], strain])
        ax.axhline(0.0, color=INK, lw=0.8)
        for index, component in enumerate(data["component"].to_numpy()):
            value, error = (
                data[name].sel(component=component).to_numpy()
                for name in ("kurtosis", "kurtosis_error")
            )
            shifted = place * 1.08 ** (index - 0.5)
            ax.errorbar(shifted, value, yerr=error, fmt=MARKERS[index], **POINTS,
                        color=COLOURS[index], label=f"${component}$")  # fmt: skip
        ax.set_xscale("log")
        if not moved.all():
            ax.axvline(0.6 * strain[0], color=FIT, lw=0.6, ls=":")
        _tick_windows(ax, place, data["strain"].to_numpy())
        ax.set_ylim(bottom=min(ax.get_ylim()[0], -0.2 * ax.get_ylim()[1]))
        ax.set_xlabel(r"$\Delta\varepsilon_q$ [-]")
        ax.set_ylabel("excess kurtosis [-]")
        ax.legend(loc="upper right")
    return ax


def _tick_windows(ax: Axes, place: Array, strain: Array) -> None:
    """Name the windows themselves on a logarithmic axis that may span less than a decade."""
    ax.set_xticks(place, labels=[f"{value:.2g}" for value in strain])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlim(0.6 * place[0], 1.6 * place[-1])


def fluctuation_growth(
    data: xr.Dataset | Mapping[str, xr.Dataset], *, ax: Axes | None = None
) -> Axes:
    """Mean square non-affine displacement against strain with its power law.

    Args:
        data: result of :func:`granufab.fabric.fluctuations`, or several with labels.
        ax: panel to draw into; a new column-wide figure by default.
    """
    several = {"": data} if isinstance(data, xr.Dataset) else data
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        for index, (label, result) in enumerate(several.items()):
            strain = result["strain"].to_numpy()
            moved = strain > 0
            strain, value, error = (
                strain[moved],
                *(result[name].to_numpy()[moved] for name in ("msd", "msd_error")),
            )
            exponent, spread = float(result["exponent"]), float(result["exponent_error"])
            law = rf"$\alpha = {exponent:.2f} \pm {spread:.2f}$"
            ax.errorbar(strain, value, yerr=error, fmt=MARKERS[index], **POINTS,
                        color=COLOURS[index], label=label or None)  # fmt: skip
            middle = np.exp(np.mean(np.log(value)) - exponent * np.mean(np.log(strain)))
            ax.plot(strain, middle * strain**exponent, color=COLOURS[index], lw=0.9, label=law)
        ax.set_xscale("log")
        ax.set_yscale("log")
        lowest = min(float(result["msd"].min()) for result in several.values())
        ax.set_ylim(bottom=0.2 * lowest)
        longest = max(several.values(), key=lambda result: float(result["strain"].max()))
        strain = longest["strain"].to_numpy()
        _tick_windows(ax, strain[strain > 0], strain[strain > 0])
        ax.set_xlabel(r"$\Delta\varepsilon_q$ [-]")
        ax.set_ylabel("$\\langle|u$\N{PRIME}$|^2\\rangle/d^2$ [-]")
        ax.legend(loc="upper left")
    return ax


def fluctuation_spectrum(
    spectra: xr.Dataset | Mapping[str, xr.Dataset], *, ax: Axes | None = None
) -> Axes:
    """Power spectrum of the non-affine displacements with its power law.

    Args:
        spectra: result of :func:`granufab.fabric.fluctuation_spectrum`, or several with labels.
        ax: panel to draw into; a new column-wide figure by default.
    """
    several = {"": spectra} if isinstance(spectra, xr.Dataset) else spectra
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        for index, (label, data) in enumerate(several.items()):
            wave, power, error = (data[name].to_numpy() for name in ("k", "S", "S_error"))
            error = np.minimum(error, 0.9 * power)
            ax.errorbar(wave, power, yerr=error, fmt=MARKERS[index], **POINTS,
                        color=COLOURS[index], label=label or None)  # fmt: skip
            _draw_law(ax, data, COLOURS[index])
        ax.axhline(1.0, color=FIT, lw=0.7, ls=":")
        ax.set_xscale("log")
        ax.set_yscale("log")
        low, high = ax.get_xlim()
        named = [value for value in _WAVES if low < value < high]
        ax.set_xticks(named, labels=[f"{value:g}" for value in named])
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_xlabel(r"$k d$ [-]")
        ax.set_ylabel(r"$S(k)$ [-]")
        if ax.get_legend_handles_labels()[1]:
            ax.legend(loc="upper right")
    return ax


def _draw_law(ax: Axes, data: xr.Dataset, colour: str) -> None:
    slope, spread = float(data["slope"]), float(data["slope_error"])
    if not np.isfinite(slope):
        return
    shortest, longest = data.attrs["fit"]
    wave = data["k"].to_numpy()
    inside = (wave >= 2 * np.pi / longest) & (wave <= 2 * np.pi / shortest)
    wave, power, error = wave[inside], data["S"].to_numpy()[inside], data["S_error"][inside]
    weight = (power / np.asarray(error)) ** 2
    level = np.exp(np.average(np.log(power) + slope * np.log(wave), weights=weight))
    law = rf"$k^{{-{slope:.2f} \pm {spread:.2f}}}$"
    ax.plot(wave, level * wave**-slope, color=colour, lw=0.9, label=law)
