"""A state that cannot be stops the run in that very step, and the grains are named."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import granufab.simulate.contact_solver as contact_solver
from granufab.errors import BrokenState
from granufab.packing import Cell, Grains, Packing
from granufab.simulate import ConstantMean, Simulation, Solver, compress, random_sample

VICTIM = 17
NUMBER = 5017
"""What the users call the grain at index 17."""

QUICK = Solver(tolerance=1e-3, step_strain=1e-3)
BAD = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}


@pytest.fixture(scope="module", params=[2, 3])
def packing(request: pytest.FixtureRequest) -> Packing:
    made = compress(random_sample(150, dimension=request.param, seed=3), friction=0.3)
    grains = dataclasses.replace(made.grains, number=np.arange(5000, 5150))
    return dataclasses.replace(made, grains=grains)


def _simulation(packing: Packing) -> Simulation:
    loading = ConstantMean(rate=0.01, dimension=packing.dimension)
    simulation = Simulation(packing, loading, solver=QUICK)
    simulation.advance(3)
    return simulation


def _spin(s: Simulation, value: float) -> None:
    s.motion[VICTIM, s.dimension] = value


def _mass(s: Simulation, value: float) -> None:
    s.motion[VICTIM, s.dimension + s.candidates.tangents] = value


def _put(name: str) -> Callable[[Simulation, float], None]:
    def change(s: Simulation, value: float) -> None:
        getattr(s, name)[VICTIM] = value

    return change


def _one_velocity(s: Simulation, value: float) -> None:
    s.motion[VICTIM, 1] = value


def _one_place(s: Simulation, value: float) -> None:
    s.position[VICTIM, 0] = value


GRAIN_FAULTS: dict[str, tuple[Callable[[Simulation, float], None], float, str]] = {
    **{f"position {name}": (_one_place, value, "position") for name, value in BAD.items()},
    **{f"velocity {name}": (_one_velocity, value, "velocity") for name, value in BAD.items()},
    **{f"spin {name}": (_spin, value, "spin") for name, value in BAD.items()},
    "radius nan": (_put("radius"), np.nan, "radius"),
    "radius 0": (_put("radius"), 0.0, "radius"),
    "radius -1": (_put("radius"), -1.0, "radius"),
    "radius inf": (_put("radius"), np.inf, "radius"),
    "mass nan": (_mass, np.nan, "mass"),
    "mass inf": (_mass, 0.0, "mass"),
    "mass -1": (_mass, -1.0, "mass"),
    "mass 0": (_mass, np.inf, "mass"),
}


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize("fault", GRAIN_FAULTS)
def test_a_fault_of_a_grain_ends_a_call_of_many_steps_at_once(packing: Packing, fault: str) -> None:
    change, value, name = GRAIN_FAULTS[fault]
    simulation = _simulation(packing)
    time, step = simulation.time, simulation.step_size
    change(simulation, value)
    with pytest.raises(BrokenState) as caught:
        simulation.advance(50)
    assert f"the {name} of grain {NUMBER} is not " in str(caught.value)
    assert "time_step" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert simulation.time <= time + 1.001 * step


@pytest.mark.parametrize("threads", [1, 2])
def test_a_fault_in_the_middle_of_a_call_ends_it_there(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Grains apart, whose spins grow tenfold a step: 1e300 lasts for eight more of them."""
    monkeypatch.setattr(contact_solver, "CHUNK_GRAINS", 4)
    monkeypatch.setenv("GRANUFAB_THREADS", str(threads))
    side, steps = 5, 8
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    spin = np.zeros((side * side, 1))
    spin[VICTIM] = 1e300
    apart = Packing(
        grains=Grains(
            position=places + 0.5,
            radius=np.full(side * side, 0.3),
            mass=np.ones(side * side),
            spin=spin / 0.3,
            number=np.arange(5000, 5000 + side * side),
        ),
        cell=Cell(matrix=np.eye(2) * side),
    )
    still = ConstantMean(rate=0.0)
    still = dataclasses.replace(still, dilation=False)
    simulation = Simulation(apart, still, step=0.01, damping=-9.0)
    assert simulation.contact_solver.threads == threads
    with pytest.raises(BrokenState, match=f"the spin of grain {NUMBER} is not finite"):
        for _ in range(steps + 2):  # a call may return after some tenths of a second
            simulation.advance(50)
    assert simulation.time == pytest.approx((steps + 1) * 0.01, rel=1e-9)


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize(
    ("name", "value"), [("impulse_n", np.nan), ("impulse_n", np.inf), ("impulse_t", np.nan)]
)
def test_a_broken_impulse_ends_the_step(packing: Packing, name: str, value: float) -> None:
    simulation = _simulation(packing)
    time, step = simulation.time, simulation.step_size
    bearing = int(np.argmax(simulation.candidates.impulse_n))
    getattr(simulation.candidates, name)[bearing] = value
    with pytest.raises(BrokenState, match="not finite"):
        simulation.advance(50)
    assert simulation.time <= time + 1.001 * step


def _cell(name: str, value: Any) -> Callable[[Simulation], None]:
    def change(s: Simulation) -> None:
        table = np.array(getattr(s, name))
        table[0, 0] = value
        setattr(s, name, table)

    return change


CELL_FAULTS = {
    "matrix nan": _cell("matrix", np.nan),
    "matrix inf": _cell("matrix", np.inf),
    "rate nan": _cell("rate", np.nan),
    "rate inf": _cell("rate", np.inf),
    "turned inside out": _cell("matrix", -10.0),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("fault", CELL_FAULTS)
def test_a_broken_cell_ends_the_step(packing: Packing, fault: str) -> None:
    simulation = _simulation(packing)
    time, step = simulation.time, simulation.step_size
    CELL_FAULTS[fault](simulation)
    with pytest.raises(BrokenState):
        simulation.advance(50)
    assert simulation.time <= time + 1.001 * step


def test_too_large_an_overlap_names_both_grains(packing: Packing) -> None:
    simulation = _simulation(packing)
    candidates = simulation.candidates
    worst = int(np.argmin(candidates.gap))
    i = int(candidates.pairs[worst, 0])
    simulation.position[i] += 0.7 * candidates.length[worst] * candidates.normal[worst]
    with pytest.raises(BrokenState) as caught:
        simulation.advance(50)
    text = str(caught.value)
    assert f"{5000 + i}" in text
    assert "overlap by" in text
    assert "limit 0.5" in text


def test_a_good_run_passes_the_guards(packing: Packing) -> None:
    simulation = _simulation(packing)
    made = 0
    while made < 100:
        made += len(simulation.advance(100 - made))
    assert np.isfinite(simulation.position).all()
