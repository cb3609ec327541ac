"""Everything that decides the next steps of a running system, as arrays.

A system made again from its sample and restored from a snapshot goes on with the same bits as if it
had never stopped: warm start, order of the contacts, chunks of grains, the neighbour list and how
far grains have walked since it was made are part of it. Settings, loading and grains are not: they
come from the case and the sample.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from granufab.errors import CorruptFile
from granufab.kernels.step_arrays import MADE, STATUS, TOTAL, TOTAL_GOAL, WALK_GOAL, WALKED
from granufab.simulate.stepping import Simulation

__all__ = ["restore", "snapshot"]

_CANDIDATES = (
    "pairs", "images", "normal", "length", "gap", "active", "impulse_n", "impulse_t", "memory_t",
    "friction", "home",
)  # fmt: skip
_OF_A_CALL = (STATUS, MADE, WALKED, WALK_GOAL, TOTAL, TOTAL_GOAL)
"""Places in the control that tell of one call of the kernel: how many steps that has is a
matter of time, not of the state."""
_NUMBERS = ("time", "step_size", "damping", "contact_updates", "searches")


def _fixed(simulation: Simulation) -> dict[str, np.ndarray]:
    """Arrays that a system keeps all its life, by name; they are filled in place."""
    memory, solver = simulation.memory, simulation.contact_solver
    return {
        "position": simulation.position,
        "motion": simulation.motion,
        "free": memory.free,
        "start": memory.start,
        "walked": memory.walked,
        "tensors": memory.tensors,
        "origin": memory.origin,
        "gravity": memory.gravity,
        "free_rate": memory.free_rate,
        "control": memory.notes.control,
        "remap": simulation.remap,
        "chunk": solver.chunk,
        "grain_order": solver.grain_order,
    }


def snapshot(simulation: Simulation) -> dict[str, np.ndarray]:
    """The state of a system between two steps; arrays are copies."""
    held = {name: value.copy() for name, value in _fixed(simulation).items()}
    held["control"][list(_OF_A_CALL)] = 0.0
    held |= {f"pair_{n}": getattr(simulation.candidates, n).copy() for n in _CANDIDATES}
    cap = np.inf if simulation.rate_cap is None else simulation.rate_cap
    numbers = [float(getattr(simulation, name)) for name in _NUMBERS]
    return held | {"numbers": np.array([*numbers, cap])}


def restore(simulation: Simulation, held: Mapping[str, np.ndarray]) -> None:
    """Put a system of the same sample, loading and settings into the state of a snapshot.

    Raises:
        CorruptFile: arrays are missing or have other shapes: it is of another sample.
    """
    fixed = _fixed(simulation)
    for name, value in fixed.items():
        found = _array(held, name)
        if found.shape != value.shape:
            raise CorruptFile(
                f"snapshot: {name} has shape {found.shape}, the sample needs {value.shape}"
            )
    pairs = {name: _array(held, f"pair_{name}") for name in _CANDIDATES}
    if len({len(value) for value in pairs.values()}) > 1:
        raise CorruptFile("snapshot: the candidate pairs have arrays of different lengths")
    for name, value in fixed.items():
        value[:] = held[name]
    for name, value in pairs.items():
        setattr(simulation.candidates, name, np.ascontiguousarray(value).copy())
    *numbers, cap = _array(held, "numbers")
    for name, value in zip(_NUMBERS, numbers, strict=True):
        setattr(simulation, name, type(getattr(simulation, name))(value))
    simulation.rate_cap = None if np.isinf(cap) else float(cap)
    simulation.make_room()


def _array(held: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    if name not in held:
        raise CorruptFile(f"snapshot: {name} is missing")
    return held[name]
