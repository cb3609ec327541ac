"""The numbers of one frame under a criterion: values, rose, Mohr circle, changes, curves."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from granufab.errors import GranufabError, MissingData
from granufab.fabric.balance import balance
from granufab.fabric.criterion_curves import criterion_curves
from granufab.fabric.harmonics import sphere_density, sphere_orientation
from granufab.fabric.measure import measure
from granufab.fabric.measure_run import measure_run
from granufab.fabric.network import Network
from granufab.fabric.orientation import orientation
from granufab.fabric.tensors import enriched_tensor, fabric_tensor
from granufab.history import Frame, Run
from granufab.io.summary import plain
from granufab.packing import Array
from granufab.states import MohrCircle
from granufab.viewer.choice import Choice

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["criterion_data", "interval_data", "state_data"]

BINS = 36
CURVE = 180
"""Points of the fitted curve E(θ)."""
SURFACE = (31, 61)
"""Points of the surface E(n) from pole to pole and around."""
_COUNTS = ("contact_count", "grain_count", "dimension", "stage")


def state_data(run: Run, frame: Frame, choice: Choice, *, bins: int = BINS) -> dict[str, Any]:
    """Everything that the page writes and draws of one frame, beside the packing itself.

    Args:
        run: the run of the frame, for its definitions.
        frame: the state.
        choice: criterion and definition of z.
        bins: of the rose.
    Returns:
        ``values``: those of ``granufab measure`` for this frame, null where unknown; ``units``:
        [unit, long name] of each; ``missing``: why values are unknown; ``point``: z, a (signed
        where known) and az; ``rose`` (:func:`rose_data`), ``mohr`` (:func:`mohr_data`), or null
        where the state has no contacts.
    Raises:
        MissingData: nothing at all can be measured.
        InvalidSettings: fewer than 3 bins.
    """
    values, units = _values(run, frame, choice)
    z, a = values[choice.z_definition], values["a_signed"]
    a = values["a"] if a is None else a
    unknown = any(value is None for value in values.values())
    rose, circle, missing = None, None, _reasons(frame, choice) if unknown else None
    try:
        network = choice.network(frame.packing)
        rose = rose_data(network, bins)
        circle = mohr_data(network)
    except MissingData as error:
        missing = missing or str(error)
    return plain(
        {
            "criterion": choice.criterion.text,
            "z_definition": choice.z_definition,
            "values": values,
            "units": units,
            "missing": missing,
            "point": {"z": z, "a": a, "az": None if z is None or a is None else a * z},
            "rose": rose,
            "mohr": circle,
        }
    )


def _values(run: Run, frame: Frame, choice: Choice) -> tuple[dict[str, Any], dict[str, Any]]:
    """The row of ``granufab measure --frame``, and [unit, long name] of each value."""
    table = measure_run(
        replace(run, frames=[frame]),
        criterion=choice.criterion,
        z_definition=choice.z_definition,
        minimum=choice.minimum,
    )
    values, units = {}, {}
    for name in map(str, table.data_vars):
        number = float(table[name][0])
        known = None if math.isnan(number) else number
        values[name] = int(number) if known is not None and name in _COUNTS else known
        units[name] = [table[name].attrs["units"], table[name].attrs["long_name"]]
    return values, units


def _reasons(frame: Frame, choice: Choice) -> str | None:
    state = measure(
        frame.packing, criterion=choice.criterion, z_definition=choice.z_definition,
        direction=frame.direction, minimum=choice.minimum, reach=choice.reach,
    )  # fmt: skip
    return None if state["missing"] is None else str(state["missing"])


def rose_data(network: Network, bins: int = BINS) -> dict[str, Any]:
    r"""E(θ) in bins, its second-order fit as a curve, and the band of one standard error of it.

    The fit is a mean over contacts, so its error is theirs over √N, contacts taken as independent
    and z as known: in 2D :math:`\sigma_E = (z/\pi)\{[\frac12 + \frac14 A_4\cos 4(\theta-\theta_4)
    - \frac14 a^2\cos^2 2(\theta-\theta_c)]/N\}^{1/2}`, in 3D
    :math:`(z/4\pi)\sigma_a|3\cos^2\theta-1|`.

    Args:
        network: contacts and z in use.
        bins: number of bins.
    Returns:
        theta [rad], count, E, E_error of the bins; curve: theta, E, low, high; a, a_error, z,
        unit, axis (3D) or phase (2D) [degree], phase_error, misfit, share_above_2; in 3D
        ``surface`` (:func:`surface_data`).
    Raises:
        MissingData: there are no contacts.
        InvalidSettings: fewer than 3 bins.
    """
    data = orientation(network.contacts, z=network.z, bins=bins)
    fine = orientation(network.contacts, z=network.z, bins=CURVE, axis=data.attrs.get("axis"))
    theta, fit = fine["theta"].to_numpy(), fine["E_fit"].to_numpy()
    error = _fit_error(data, theta)
    solid = "phase" not in data
    found: dict[str, Any] = {
        **{name: data[name].to_numpy() for name in ("theta", "count", "E", "E_error")},
        "curve": {"theta": theta, "E": fit, "low": fit - error, "high": fit + error},
        **{name: float(data[name]) for name in ("a", "a_error", "misfit", "share_above_2")},
        "z": network.z,
        "unit": data["E"].attrs["units"],
        "error_bars": data.attrs["error_bars"],
    }
    if solid:
        return found | {"axis": data.attrs["axis"], "surface": surface_data(network)}
    return found | {
        "phase": float(data["phase"][0]),
        "phase_error": float(data["phase_error"][0]),
    }


def _fit_error(data: xr.Dataset, theta: Array) -> Array:
    """Standard error of the fitted E at θ, z taken as known."""
    z = float(data.attrs["z"])
    if "phase" not in data:
        return z / (4 * math.pi) * float(data["a_error"]) * np.abs(3 * np.cos(theta) ** 2 - 1)
    second, fourth = (
        float(data["amplitude"][k]) * np.cos(mode * (theta - math.radians(float(data["phase"][k]))))
        for k, mode in enumerate((2, 4))
    )
    variance = 0.5 + 0.25 * fourth - 0.25 * second**2
    return z / math.pi * np.sqrt(np.maximum(variance, 0.0) / data.attrs["contact_count"])


def surface_data(network: Network) -> dict[str, Any] | None:
    """E(n) of a 3D state on a grid of directions, from its harmonics of order 2 to 6 [1/sr].

    Returns:
        theta from the z axis and azimuth [rad], E of shape (theta, azimuth); null below two
        contacts.
    """
    if network.contacts.count < 2:
        return None
    theta = np.linspace(0, math.pi, SURFACE[0])
    azimuth = np.linspace(0, 2 * math.pi, SURFACE[1])
    high, around = np.meshgrid(theta, azimuth, indexing="ij")
    across = np.sin(high)
    direction = np.stack([across * np.cos(around), across * np.sin(around), np.cos(high)], axis=-1)
    sphere = sphere_orientation(network.contacts, z=network.z)
    return {"theta": theta, "azimuth": azimuth, "E": sphere_density(sphere, direction)}


def mohr_data(network: Network) -> dict[str, Any]:
    """Mohr circle of the enriched fabric tensor G: principal values, centre and radius of each.

    Raises:
        MissingData: there are no contacts.
    """
    tensor = enriched_tensor(fabric_tensor(network.contacts), network.z)
    circle = MohrCircle.from_tensor(tensor)
    return {
        "z": circle.z,
        "a": circle.a,
        "principal": circle.principal,
        "circles": circle.circles,
    }


def interval_data(before: Frame, after: Frame, choice: Choice, *, bins: int = 18) -> dict[str, Any]:
    """Contacts gained, lost and turned between two frames by direction, of every grain.

    Args:
        before, after: successive frames.
        choice: its criterion; all contacts count, as in ``granufab balance``.
        bins: of the direction.
    Returns:
        theta (middles) and edges [rad]; gain, loss and before by bin, current by edge [counts];
        gained, lost, persistent; z and z a' at both ends and their parts. Or ``missing``: why not.
    """
    try:
        data = balance(
            before, after, criterion=choice.criterion, bins=bins, reach=choice.reach,
            direction=after.direction,
        )  # fmt: skip
    except GranufabError as error:
        return {"missing": str(error)}
    found = {str(name): data[name].to_numpy() for name in (*data.data_vars, *data.coords)}
    return plain({**found, "since_eps_q": before.eps_q, "eps_q": after.eps_q, "missing": None})


def criterion_data(run: Run, place: int, choice: Choice, *, bootstrap: int = 0) -> dict[str, Any]:
    """z, a, az and rattlers of a frame against force and gap thresholds: the slider's track.

    Args:
        run: the run.
        place: of the frame.
        choice: its definition of z.
        bootstrap: resamples for error bars; 0 for none.
    Returns:
        For ``force`` and ``gap``, where known: threshold, z, a, az, rattler_fraction and each
        ``_error``; ``missing`` in words.
    """
    try:
        curves = criterion_curves(
            run, frame=place, z_definition=choice.z_definition, bootstrap=bootstrap
        )
    except MissingData as error:
        return {"missing": str(error)}
    found: dict[str, Any] = {"missing": curves.attrs["missing"] or None}
    for kind in ("force", "gap"):
        if f"z_{kind}" not in curves:
            continue
        found[kind] = {"threshold": curves[f"{kind}_threshold"].to_numpy()}
        for name in ("z", "a", "az", "rattler_fraction"):
            found[kind][name] = curves[f"{name}_{kind}"].to_numpy()
            found[kind][f"{name}_error"] = curves[f"{name}_{kind}_error"].to_numpy()
    return plain({**found, "z_definition": choice.z_definition})
