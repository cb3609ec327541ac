"""Forces of one state as flat named values, for tables along a path."""

from __future__ import annotations

from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.forces import force_statistics
from granufab.fabric.stress_force_fabric import stress_force_fabric
from granufab.history import Frame
from granufab.packing import Array, Packing

__all__ = ["FORCE_VALUES", "force_values"]

FORCE_VALUES: dict[str, tuple[str, str]] = {
    "a_l": ("-", "branch-length anisotropy along the axis"),
    "a_n": ("-", "normal-force anisotropy along the axis"),
    "a_t": ("-", "tangential-force anisotropy along the axis"),
    "q_over_p_signed": ("-", "stress ratio of the contacts in use along the axis"),
    "q_over_p_linear": ("-", "stress ratio from the sum of the anisotropies"),
    "q_over_p_full": ("-", "stress ratio from the full form of the anisotropies"),
    "strong_share": ("-", "fraction of contacts above the mean normal force"),
    "strong_q_share": ("-", "share of the deviatoric stress that they carry"),
    "sliding_fraction": ("-", "fraction of sliding contacts"),
    "mean_mobilisation": ("-", "mean of the mobilised friction"),
}
"""Units and long name of each value."""


def force_values(
    state: Packing | Frame,
    *,
    friction: float | None = None,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    axis: Array | None = None,
) -> dict[str, float | None]:
    """The scalars of :func:`stress_force_fabric` and :func:`force_statistics`, without errors.

    Args:
        state: a packing or a frame whose contacts have forces.
        friction: coefficient µ [-]; without it, or at 0, sliding and mobilisation are None.
        criterion: contact criterion.
        z_definition: the contacts that this z counts are used.
        minimum: fewest contacts that hold a grain.
        axis: of the signed values, shape (D,); default the frame's loading direction, else a
            principal axis of the fabric.
    Returns:
        The names of :data:`FORCE_VALUES` [-].
    Raises:
        MissingData: no forces, no cell, no contacts, or these in too few directions.
        InvalidSettings: an unknown criterion or definition, an axis of wrong shape.
    """
    sff = stress_force_fabric(
        state, criterion=criterion, z_definition=z_definition, minimum=minimum, axis=axis,
        replicas=0,
    )  # fmt: skip
    forces = force_statistics(
        state, friction=friction or None, criterion=criterion, z_definition=z_definition,
        minimum=minimum, axis=axis, replicas=0,
    )  # fmt: skip
    values: dict[str, float | None] = dict.fromkeys(FORCE_VALUES)
    values |= {name: float(sff[name]) for name in FORCE_VALUES if name in sff}
    values |= {name: float(forces[name]) for name in FORCE_VALUES if name in forces}
    strong = forces.sel(part="strong")
    return values | {
        "strong_share": float(strong["contact_share"]),
        "strong_q_share": float(strong["q_share"]),
    }
