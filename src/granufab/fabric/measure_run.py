"""The values of every recorded frame of a run, as a Dataset."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from granufab.errors import MissingData
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.force_values import FORCE_VALUES, force_values
from granufab.fabric.frame_map import FrameMap, one_by_one
from granufab.fabric.measure import Value, measure, values_dataset
from granufab.fabric.run_definitions import recorded_reach, run_definitions, run_friction
from granufab.history import Frame, Run
from granufab.packing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["measure_run"]


def measure_run(
    run: Run,
    *,
    criterion: str | Criterion | None = None,
    z_definition: ZDefinition | None = None,
    direction: Array | None = None,
    minimum: int | None = None,
    bootstrap: int = 0,
    forces: bool = False,
    each: FrameMap = one_by_one,
) -> xr.Dataset:
    """All values of :func:`measure` for every recorded frame of a run.

    Args:
        run: frames with contacts.
        criterion: default the run's own, else ``force``.
        z_definition: default the run's own, else ``z_backbone``.
        direction: axis of a', shape (D,); default each frame's contraction axis.
        minimum: fewest contacts that hold a grain; default the run's own rule, D + 1 where its
            grains have no friction, else 2.
        bootstrap: number of resampled states a frame for standard errors.
        forces: add the values of :func:`~granufab.fabric.force_values`, with the run's friction.
        each: applies the measure to every frame, one by one or in several processes
            (:func:`granufab.campaign.frame_workers`); no more frames are held than it works on.
    Returns:
        Variables over ``frame``, NaN where unknown, with eps_q, eps_q_total, stage, residual,
        sweeps and inertial_number of the frame; units, long_name and the definitions in attrs.
    Raises:
        MissingData: the run has no frames, or a frame holds nothing to measure.
        InvalidSettings: an unknown criterion or definition.
    """
    rule, definition, fewest = run_definitions(run, criterion, z_definition, minimum)
    rows = list(
        each(
            partial(
                _row,
                criterion=rule,
                z_definition=definition,
                direction=direction,
                minimum=fewest,
                reach=recorded_reach(run),
                bootstrap=bootstrap,
                friction=run_friction(run),
                forces=forces,
            ),
            run.frames,
        )
    )
    attributes = {
        "path": run.name,
        "criterion": rule.text,
        "z_definition": definition,
        "minimum_contacts": fewest,
        "dimension": run.dimension,
    }
    return values_dataset(rows, "frame", attributes)


def _row(
    frame: Frame,
    *,
    criterion: Criterion,
    z_definition: ZDefinition,
    direction: Array | None,
    minimum: int,
    reach: float | None,
    bootstrap: int,
    friction: float | None,
    forces: bool,
) -> dict[str, Value]:
    """All values of one frame."""
    row = measure(
        frame.packing,
        criterion=criterion,
        z_definition=z_definition,
        direction=frame.direction if direction is None else direction,
        minor=frame.extension if direction is None else None,
        minimum=minimum,
        reach=reach,
        bootstrap=bootstrap,
    )
    if forces:
        row |= _force_row(frame, friction, criterion, z_definition, minimum, direction)
    return row | _frame_values(frame)


def _frame_values(frame: Frame) -> dict[str, float]:
    return {
        "eps_q": frame.eps_q,
        "eps_q_total": frame.eps_q_total,
        "stage": float(frame.stage),
        "residual": frame.statistics.residual,
        "sweeps": frame.statistics.sweeps,
        "inertial_number": frame.inertial_number,
    }


def _force_row(
    frame: Frame,
    friction: float | None,
    rule: Criterion,
    definition: ZDefinition,
    fewest: int,
    direction: Array | None,
) -> dict[str, Value]:
    """Values of the forces; None throughout where the frame does not tell."""
    try:
        return dict(
            force_values(
                frame,
                friction=friction,
                criterion=rule,
                z_definition=definition,
                minimum=fewest,
                axis=direction,
            )
        )
    except MissingData:
        return dict.fromkeys(FORCE_VALUES)
