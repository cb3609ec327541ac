"""Walking a strain history with an evolution law.

A stage of constant velocity gradient is integrated in the principal frame of its strain rate,
where the law is written axis by axis: without spin the minimal form is then exact, and rotating
the whole history rotates the result to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.integrate import odeint

from granufab.errors import InvalidSettings, NotConverged
from granufab.packing import Array
from granufab.states.evolution import EvolutionLaw, StrainStage
from granufab.states.evolution_rate import Drive

__all__ = ["predict_evolution"]

_TOLERANCE = 1e-11
_AXISYMMETRIC = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State:
    """What the law remembers: g = 2D·G, the direction memory H, the surplus memory w."""

    fabric: Array
    recent: Array
    surplus: float

    def turned(self, frame: Array) -> _State:
        """The same state in the axes that are the columns of ``frame``."""
        return _State(
            fabric=frame.T @ self.fabric @ frame,
            recent=frame.T @ self.recent @ frame,
            surplus=self.surplus,
        )

    def packed(self) -> Array:
        """One vector, for the integrator."""
        return np.concatenate([self.fabric.ravel(), self.recent.ravel(), [self.surplus]])

    @classmethod
    def unpacked(cls, vector: Array, dimension: int) -> _State:
        """Inverse of :meth:`packed`."""
        half = dimension**2
        return cls(
            fabric=vector[:half].reshape(dimension, dimension),
            recent=vector[half:-1].reshape(dimension, dimension),
            surplus=float(vector[-1]),
        )


def predict_evolution(
    law: EvolutionLaw,
    fabric: ArrayLike,
    stages: Sequence[StrainStage],
    *,
    surplus: float | None = None,
    direction: ArrayLike | None = None,
    tolerance: float = _TOLERANCE,
) -> xr.Dataset:
    """Fabric along a strain history.

    Args:
        law: the evolution law.
        fabric: G at the start, tr G = z/2 [-], shape (D, D).
        stages: the history; each starts where the one before ended.
        surplus: w at the start [-]; by default ⟨z − z*⟩, z* of the first strain rate.
        direction: axis of a' and of positive ε_q, shape (D,); by default, of the first strain
            rate, the contraction axis in 2D, the symmetry axis (or that of the largest rate)
            in 3D.
        tolerance: relative, of the integrator.
    Returns:
        Over ``record``: eps_q (along ``direction``), eps_q_total = ∫(d_1 − d_D)dt, z, a,
        a_signed, b_g (3D), stage, and ``fabric`` G over (record, row, column). The end of a
        stage and the start of the next are one record.
    Raises:
        InvalidSettings: tensors of another dimension, G not symmetric, with a negative principal
            value or without a positive trace, or a first stage without a deviatoric strain rate.
        NotConverged: the integrator failed.
    """
    matrix = _checked(fabric, law, stages)
    first = _contraction(stages[0].at(0.0))
    values, vectors = _principal(first)
    if not values[0] - values[-1] > 0.0:
        raise InvalidSettings("the first stage has no deviatoric strain rate, so no direction")
    axis = _axis(values, vectors) if direction is None else _unit(direction, law.dimension)
    state = _State(
        fabric=2.0 * law.dimension * matrix,
        recent=np.zeros_like(matrix),
        surplus=_surplus(law, matrix, values) if surplus is None else float(surplus),
    )
    span = _strain_vectors(axis, values, vectors)
    rows: list[tuple[Array, Array, int]] = []
    strain = np.zeros(2)
    for number, stage in enumerate(stages):
        states = _walk(law, state, stage, tolerance)
        strains = strain + _strains(stage, span)
        keep = slice(0 if number == 0 else 1, None)
        fabrics = np.array([item.fabric for item in states[keep]])
        rows.append((strains[keep], fabrics, number))
        state, strain = states[-1], strains[-1]
    return _dataset(law, rows, axis)


def _checked(fabric: ArrayLike, law: EvolutionLaw, stages: Sequence[StrainStage]) -> Array:
    matrix = np.asarray(fabric, dtype=np.float64)
    shape = (law.dimension, law.dimension)
    if matrix.shape != shape:
        raise InvalidSettings(f"fabric has shape {matrix.shape}, the law needs {shape}")
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9) or not np.trace(matrix) > 0.0:
        raise InvalidSettings("fabric must be symmetric with trace z/2 > 0")
    if np.linalg.eigvalsh(matrix)[0] < -1e-9:
        raise InvalidSettings(
            f"fabric has the principal values {np.linalg.eigvalsh(matrix).tolist()}, none may be "
            "negative"
        )
    if not stages:
        raise InvalidSettings("a strain history needs at least one stage, got none")
    for number, stage in enumerate(stages):
        if stage.at(0.0).shape != shape:
            raise InvalidSettings(
                f"stage {number}: velocity gradient has shape {stage.at(0.0).shape}, "
                f"the law needs {shape}"
            )
    return matrix


def _contraction(gradient: Array) -> Array:
    """Deviator of the strain rate, contraction positive [1/s]."""
    rate = -0.5 * (gradient + gradient.T)
    return rate - np.trace(rate) / len(rate) * np.eye(len(rate))


def _principal(deviator: Array) -> tuple[Array, Array]:
    """Principal values, largest first, and axes as columns."""
    values, vectors = np.linalg.eigh(deviator)
    return values[::-1], vectors[:, ::-1]


def _axis(values: Array, vectors: Array) -> Array:
    extension = len(values) == 3 and -values[-1] > values[0] * (1.0 + _AXISYMMETRIC)
    return vectors[:, -1] if extension else vectors[:, 0]


def _unit(direction: ArrayLike, dimension: int) -> Array:
    axis = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(axis))
    if axis.shape != (dimension,) or not length > 0.0:
        raise InvalidSettings(
            f"direction is {direction!r}, must have {dimension} components, not 0"
        )
    return axis / length


def _surplus(law: EvolutionLaw, fabric: Array, values: Array) -> float:
    return max(2.0 * float(np.trace(fabric)) - Drive.of(law, values).critical, 0.0)


def _strain_vectors(axis: Array, values: Array, vectors: Array) -> tuple[Array, Array]:
    """Axes whose contractions differ by ε̇_q: ``axis``, and the one of the opposite extreme."""
    opposite = vectors[:, 0] if abs(vectors[:, -1] @ axis) > 0.999999 else vectors[:, -1]
    return axis, opposite


def _strains(stage: StrainStage, span: tuple[Array, Array]) -> Array:
    """(ε_q, ∫|dε_q|) since the stage began at its times, shape (record_count, 2)."""
    if callable(stage.gradient):
        nodes = np.linspace(0.0, 1.0, 9)
        rates = np.array(
            [
                [_strain_rates(stage.at(low + (high - low) * node), span) for node in nodes]
                for low, high in zip(stage.times[:-1], stage.times[1:], strict=True)
            ]
        )
        weights = np.array([1, 4, 2, 4, 2, 4, 2, 4, 1]) / 24.0
        steps = np.einsum("rnk,n->rk", rates, weights) * np.diff(stage.times)[:, None]
        return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return stage.times[:, None] * _strain_rates(stage.at(0.0), span)


def _strain_rates(gradient: Array, span: tuple[Array, Array]) -> Array:
    deviator = _contraction(gradient)
    values = _principal(deviator)[0]
    signed = span[0] @ deviator @ span[0] - span[1] @ deviator @ span[1]
    return np.array([signed, values[0] - values[-1]])


def _walk(law: EvolutionLaw, state: _State, stage: StrainStage, tolerance: float) -> list[_State]:
    """States at the stage's times, in the axes of ``state``."""
    if callable(stage.gradient):
        columns = _integrated(law, state, stage, tolerance)
        return [_State.unpacked(column, law.dimension) for column in columns]
    gradient = stage.at(0.0)
    values, frame = _principal(_contraction(gradient))
    spin = frame.T @ _spin(gradient) @ frame
    local = state.turned(frame)
    drive = Drive.of(law, values)
    if law.form == "minimal" and not spin.any():
        states = _exact(drive, local, stage.times)
    elif not spin.any() and _is_diagonal(local.fabric) and _is_diagonal(local.recent):
        states = _diagonal(drive, local, stage.times, tolerance)
    else:
        columns = _solved(
            lambda _, vector: _rate(drive, _State.unpacked(vector, law.dimension), spin).packed(),
            local.packed(),
            stage.times,
            tolerance,
        )
        states = [_State.unpacked(column, law.dimension) for column in columns]
    return [item.turned(frame.T) for item in states]


def _is_diagonal(tensor: Array) -> bool:
    return not (tensor - np.diag(np.diag(tensor))).any()


def _spin(gradient: Array) -> Array:
    return 0.5 * (gradient - gradient.T)


def _exact(drive: Drive, state: _State, times: Array) -> list[_State]:
    """Minimal form without spin: every component relaxes exponentially."""
    goal, rate = np.diag(drive.limits), drive.exchange
    decay = np.exp(-0.5 * (rate[:, None] + rate[None, :]) * times[:, None, None])
    fabrics = goal + (state.fabric - goal) * decay
    surplus = state.surplus * np.exp(-drive.fade * times)
    return [
        _State(fabric=fabric, recent=state.recent, surplus=float(w))
        for fabric, w in zip(fabrics, surplus, strict=True)
    ]


def _integrated(law: EvolutionLaw, state: _State, stage: StrainStage, tolerance: float) -> Array:
    """States where the velocity gradient changes with time."""

    def rate(time: float, vector: Array) -> Array:
        now = _State.unpacked(vector, law.dimension)
        gradient = stage.at(time)
        values, frame = _principal(_contraction(gradient))
        spin = frame.T @ _spin(gradient) @ frame
        return _rate(Drive.of(law, values), now.turned(frame), spin).turned(frame.T).packed()

    step = float(np.diff(stage.times).max())
    return _solved(rate, state.packed(), stage.times, tolerance, step)


def _solved(
    rate: Callable[[float, Array], Array],
    start: Array,
    times: Array,
    tolerance: float,
    max_step: float = 0.0,
) -> Array:
    """Solution at ``times`` by LSODA (stiff where it must be), shape (record_count, n)."""
    found, report = odeint(
        rate,
        start,
        times,
        tfirst=True,
        rtol=tolerance,
        atol=0.1 * tolerance,
        hmax=max_step,
        mxstep=100_000,
        full_output=True,
    )
    if report["message"] != "Integration successful.":
        raise NotConverged(f"the evolution law could not be integrated: {report['message']}")
    return found


def _rate(drive: Drive, state: _State, spin: Array) -> _State:
    """Rates of change in the principal frame of the strain rate."""
    fabric, recent = state.fabric, state.recent
    heading = np.diag(drive.heading)
    z = float(np.trace(fabric)) / len(fabric)
    gain, loss = drive.flow(z, float((recent * heading).sum()), state.surplus)
    change = np.diag(gain) - 0.5 * (loss[:, None] + loss[None, :]) * fabric
    refresh = drive.turnover * (heading - recent)
    if spin.any():
        change = change + spin @ fabric - fabric @ spin
        refresh = refresh + spin @ recent - recent @ spin
    return _State(fabric=change, recent=refresh, surplus=-drive.fade * state.surplus)


def _diagonal(drive: Drive, state: _State, times: Array, tolerance: float) -> list[_State]:
    """States of a straight path whose fabric shares the axes of the strain rate."""
    count = len(drive.heading)

    def rate(_: float, vector: Array) -> Array:
        fabric, recent, surplus = vector[:count], vector[count:-1], vector[-1]
        gain, loss = drive.flow(fabric.sum() / count, float(recent @ drive.heading), surplus)
        change = np.empty_like(vector)
        change[:count] = gain - loss * fabric
        change[count:-1] = drive.turnover * (drive.heading - recent)
        change[-1] = -drive.fade * surplus
        return change

    start = [np.diag(state.fabric), np.diag(state.recent), [state.surplus]]
    columns = _solved(rate, np.concatenate(start), times, tolerance)
    return [
        _State(fabric=np.diag(column[:count]), recent=np.diag(column[count:-1]), surplus=column[-1])
        for column in columns
    ]


def _dataset(
    law: EvolutionLaw, rows: Sequence[tuple[Array, Array, int]], axis: Array
) -> xr.Dataset:
    strains = np.concatenate([row[0] for row in rows])
    fabric = np.concatenate([row[1] for row in rows]) / (2.0 * law.dimension)
    stage = np.concatenate([np.full(len(row[0]), row[2]) for row in rows])
    z = 2.0 * np.trace(fabric, axis1=1, axis2=2)
    principal = np.linalg.eigvalsh(fabric)[:, ::-1] * (2.0 / z)[:, None]
    along = np.einsum("i,rij,j->r", axis, fabric, axis) * 2.0 / z
    spread = principal[:, 0] - principal[:, -1]
    signed = 4.0 * along - 2.0 if law.dimension == 2 else 1.25 * (3.0 * along - 1.0)
    columns = {
        "eps_q": (strains[:, 0], "deviatoric strain, running"),
        "eps_q_total": (strains[:, 1], "deviatoric strain, accumulated"),
        "z": (z, "coordination number"),
        "a": ((2.0 if law.dimension == 2 else 2.5) * spread, "fabric anisotropy"),
        "a_signed": (signed, "signed fabric anisotropy"),
    }
    if law.dimension == 3:
        middle = principal[:, 1] - principal[:, 2]
        b_g = np.where(spread > 1e-9, middle / np.where(spread > 1e-9, spread, 1.0), np.nan)
        columns["b_g"] = (b_g, "(G_2 − G_3)/(G_1 − G_3)")
    return xr.Dataset(
        {
            **{
                name: ("record", values, {"units": "-", "long_name": text})
                for name, (values, text) in columns.items()
            },
            "stage": ("record", stage, {"units": "-", "long_name": "number of the stage"}),
            "fabric": (
                ("record", "row", "column"),
                fabric,
                {"units": "-", "long_name": "fabric tensor G, trace z/2"},
            ),
        },
        attrs={"form": law.form, "direction": axis.tolist(), "dimension": law.dimension},
    )
