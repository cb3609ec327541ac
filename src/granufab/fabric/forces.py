"""Contact forces: their distribution, the strong and the weak network, friction mobilised.

Source: Radjai, Jean, Moreau & Roux, Phys. Rev. Lett. 77, 274 (1996), for the power law below the
mean and the exponential above; Radjai, Wolf, Jean & Moreau, Phys. Rev. Lett. 80, 61 (1998), for
the strong and the weak network.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.ensemble import (
    ContactSample,
    States,
    pool_contacts,
    resample,
    unit_sums,
)
from granufab.fabric.tensors import axial_anisotropy
from granufab.fabric.variables import describe
from granufab.packing import Array, require

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["force_statistics"]

_PARTS = ("weak", "strong")


def force_statistics(
    states: States,
    *,
    friction: float | None = None,
    tolerance: float = 1e-3,
    weak_from: float = 0.02,
    bins: int = 30,
    smallest: float = 1e-3,
    axis: Array | None = None,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    replicas: int = 200,
) -> xr.Dataset:
    r"""Distribution of normal forces, their two networks, and the friction they mobilise.

    x = f_n/<f_n>, the mean over the contacts in use of each state. Below the mean
    :math:`P\propto x^{\alpha}`, above it :math:`P\propto e^{-\beta x}`; α and β are maximum
    likelihood estimates over weak_from < x < 1 and x > 1. Strong contacts have x > 1. The share
    of q that a network carries is that of its stress along the deviator s of the stress of all
    contacts in use, σ_part:s/s:s; shares of p are of tr σ. Mobilised friction is
    |f_t|/(µ f_n), and a contact slides where it exceeds 1 − tolerance.

    Args:
        states: a packing, a frame, or several.
        friction: coefficient µ [-]; None leaves mobilisation and sliding out.
        tolerance: of the sliding condition [-].
        weak_from: lower end of the power law [<f_n>], 0 < weak_from < 1.
        bins: over the logarithm of x, and of the mobilisation.
        smallest: lower edge of the first bin of x; weaker contacts are counted in no bin.
        axis: of the signed anisotropies, shape (D,); default as for
            :func:`~granufab.fabric.ensemble.pool_contacts`.
        criterion: contact criterion; the contacts need forces.
        z_definition: the contacts that this z counts are used.
        minimum: fewest contacts that hold a grain.
        replicas: number of bootstrap draws, of contacts, or of states where there are 8.
    Returns:
        Over ``x`` (geometric bin centres): P_force, P_force_error. Over ``part`` (weak,
        strong): contact_share, a, p_share, q_share, and with µ sliding_share, each with
        ``_error``. Over ``mobilisation``: P_mobilisation, P_mobilisation_error. Scalars:
        weak_exponent (α), strong_decay (β), tail_variation (standard deviation of x − 1 over its
        mean above the mean force: 1 for an exponential, less where P falls faster),
        sliding_fraction, beyond_friction (contacts above 1 + tolerance: 0 if µ is right),
        mean_mobilisation, each with ``_error``; mean_force [N].
    Raises:
        MissingData: no forces or no contacts.
        InvalidSettings: friction, tolerance, weak_from, bins or smallest out of range.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    _check(friction, tolerance, weak_from, bins, smallest)
    sample = pool_contacts(
        states, criterion=criterion, z_definition=z_definition, minimum=minimum, axis=axis
    )
    force = require(sample.force, "contact forces", "use the criterion force")
    normal_force = np.einsum("ci,ci->c", force, sample.normal)
    x = _in_means(normal_force, sample)
    parts = _Parts(sample, x, weak_from)
    data = parts.results(replicas)
    data |= _density(x, _log_edges(x, smallest, bins), "x", "P_force")
    data["mean_force"] = ((), normal_force.mean(), describe("mean normal force", "N"))
    coordinates = {
        "x": ("x", _middle(_log_edges(x, smallest, bins)), describe("normal force over its mean")),
        "part": ("part", list(_PARTS), describe("contacts below and above the mean force")),
    }
    if friction is not None:
        mobilised = _mobilised(force, normal_force, sample.normal, friction)
        data |= _friction(sample, mobilised, x > 1.0, tolerance, replicas)
        edges = np.linspace(0.0, 1.0, bins + 1)
        data |= _density(np.minimum(mobilised, 1.0), edges, "mobilisation", "P_mobilisation")
        centre = 0.5 * (edges[1:] + edges[:-1])
        text = describe("mobilised friction |f_t|/(mu f_n)")
        coordinates["mobilisation"] = ("mobilisation", centre, text)
    limits = {"weak_from": weak_from, "tolerance": tolerance}
    known = {} if friction is None else {"friction": friction}
    return xr.Dataset(data, coordinates, sample.attributes | limits | known)


class _Parts:
    """Exponents of the pdf, and shares of the weak and the strong network, with errors."""

    def __init__(self, sample: ContactSample, x: Array, weak_from: float) -> None:
        force = require(sample.force, "contact forces")
        stress = np.einsum("ci,cj->cij", force, sample.branch)
        total = stress.sum(axis=0)
        deviator = 0.5 * (total + total.T) - np.trace(total) / len(total) * np.eye(len(total))
        self.sample, self.dimension, self.depth = sample, sample.dimension, -math.log(weak_from)
        power, tail = (x > weak_from) & (x < 1.0), x > 1.0
        cosine = (sample.normal @ sample.axis) ** 2
        pressure = np.trace(stress, axis1=1, axis2=2)
        shear = np.einsum("cij,ij->c", stress, deviator)
        logarithm = np.where(power, -np.log(np.where(power, x, 1.0)), 0.0)
        excess = np.where(tail, x - 1.0, 0.0)
        columns = [power, logarithm, tail, excess, excess**2]
        for chosen in (~tail, tail):
            columns += [chosen, chosen * cosine, chosen * pressure, chosen * shear]
        self.columns = np.column_stack(columns).astype(np.float64)

    def results(self, replicas: int) -> dict:
        """Variables with bootstrap errors."""
        texts = {
            "weak_exponent": "exponent of the power law below the mean force",
            "strong_decay": "rate of the exponential above the mean force",
            "tail_variation": "relative spread of forces above their mean",
            "contact_share": "share of the contacts",
            "a": "fabric anisotropy of the part along the axis",
            "p_share": "share of the mean stress",
            "q_share": "share of the deviatoric stress",
        }
        return _with_errors(self.sample, self.columns, self._estimate, texts, replicas)

    def _estimate(self, sums: Array) -> dict[str, Array]:
        below, logarithm, above, excess, square = sums[:, :5].T
        parts = sums[:, 5:].reshape(len(sums), 2, 4)
        count, cosine, pressure, shear = np.moveaxis(parts, 2, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = excess / above
            along = cosine / count
            return {
                "weak_exponent": np.array(
                    [_power_exponent(value, self.depth) for value in logarithm / below]
                ),
                "strong_decay": 1.0 / mean,
                "tail_variation": np.sqrt(np.maximum(square / above - mean**2, 0.0)) / mean,
                "contact_share": count / count.sum(axis=1, keepdims=True),
                "a": axial_anisotropy(along, self.dimension),
                "p_share": pressure / pressure.sum(axis=1, keepdims=True),
                "q_share": shear / shear.sum(axis=1, keepdims=True),
            }


def _friction(
    sample: ContactSample,
    mobilised: Array,
    strong: NDArray[np.bool_],
    tolerance: float,
    replicas: int,
) -> dict:
    sliding = mobilised > 1.0 - tolerance
    columns = np.column_stack(
        [
            np.ones(sample.count),
            mobilised,
            mobilised > 1.0 + tolerance,
            ~strong,
            ~strong & sliding,
            strong,
            strong & sliding,
        ]
    ).astype(np.float64)

    def estimate(sums: Array) -> dict[str, Array]:
        count = sums[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            return {
                "sliding_fraction": (sums[:, 4] + sums[:, 6]) / count,
                "beyond_friction": sums[:, 2] / count,
                "mean_mobilisation": sums[:, 1] / count,
                "sliding_share": sums[:, [4, 6]] / sums[:, [3, 5]],
            }

    texts = {
        "sliding_fraction": "fraction of sliding contacts",
        "beyond_friction": "fraction of contacts beyond the friction given",
        "mean_mobilisation": "mean of the mobilised friction",
        "sliding_share": "fraction of the part's contacts that slide",
    }
    return _with_errors(sample, columns, estimate, texts, replicas)


def _with_errors(
    sample: ContactSample,
    columns: Array,
    estimate: Callable[[Array], dict[str, Array]],
    texts: dict[str, str],
    replicas: int,
) -> dict:
    """Estimates from the sums of columns over all contacts, and their bootstrap errors."""
    sums = unit_sums(sample, lambda part: columns[part])
    values = estimate(sums.sum(axis=0)[None])
    drawn = estimate(resample(sums, replicas)) if replicas else {}
    data = {}
    for name, text in texts.items():
        value = values[name][0]
        dims = ("part",) if np.ndim(value) else ()
        error = _spread(drawn[name]) if replicas else np.full_like(value, np.nan)
        data[name] = (dims, value, describe(text))
        data[f"{name}_error"] = (dims, error, describe(f"bootstrap standard error of {name}"))
    return data


def _spread(drawn: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a value that no draw can tell
        return np.nanstd(drawn, axis=0)


def _power_exponent(mean: float, depth: float) -> float:
    """α of P ∝ x^α over e^−depth < x < 1 from the mean of −ln x; NaN without contacts there.

    −ln x is exponential of rate κ = α + 1, truncated at ``depth``:
    mean = 1/κ − depth/(e^{κ depth} − 1), which falls as κ grows.
    """
    if not 0.0 < mean < depth:
        return math.nan

    def excess(rate: float) -> float:
        product = rate * depth
        if abs(product) < 1e-6:
            return 0.5 * depth - mean - rate * depth**2 / 12.0
        return 1.0 / rate - depth / math.expm1(product) - mean

    low, high = -500.0 / depth, 500.0 / depth
    if excess(low) * excess(high) > 0:
        return math.nan
    return float(scipy.optimize.brentq(excess, low, high)) - 1.0


def _mobilised(force: Array, normal_force: Array, normal: Array, friction: float) -> Array:
    shear = np.linalg.norm(force - normal_force[:, None] * normal, axis=1)
    return shear / (friction * np.abs(normal_force))


def _in_means(normal_force: Array, sample: ContactSample) -> Array:
    count = np.bincount(sample.state, minlength=len(sample.packings))
    total = np.bincount(sample.state, normal_force, minlength=len(sample.packings))
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (total / count)[sample.state]
    if not (mean > 0).all():
        raise MissingData("the mean normal force is not positive, so forces have no scale")
    return normal_force / mean


def _log_edges(x: Array, smallest: float, bins: int) -> Array:
    top = max(float(x.max()), 2.0 * smallest) * (1.0 + 1e-9)
    return np.geomspace(smallest, top, bins + 1)


def _middle(edges: Array) -> Array:
    return np.sqrt(edges[1:] * edges[:-1])


def _density(values: Array, edges: Array, dim: str, name: str) -> dict:
    count = np.histogram(values, edges)[0]
    scale = 1.0 / (len(values) * np.diff(edges))
    error = scale * np.sqrt(np.maximum(count * (1.0 - count / len(values)), 0.0))
    return {
        name: (dim, scale * count, describe(f"probability density of {dim}")),
        f"{name}_error": (dim, error, describe(f"standard error of {name}")),
    }


def _check(
    friction: float | None, tolerance: float, weak_from: float, bins: int, smallest: float
) -> None:
    if friction is not None and not 0.0 < friction < math.inf:
        raise InvalidSettings(f"friction is {friction!r}, must be > 0 (None: no mobilisation)")
    if not 0.0 <= tolerance < 1.0:
        raise InvalidSettings(f"tolerance is {tolerance!r}, must lie in 0..1")
    for name, value in (("weak_from", weak_from), ("smallest", smallest)):
        if not 0.0 < value < 1.0:
            raise InvalidSettings(f"{name} is {value!r}, must lie in 0..1")
    if bins < 3:
        raise InvalidSettings(f"bins is {bins}, must be at least 3")
