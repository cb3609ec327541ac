"""Many steps in one call are the same steps, with any number of threads; nothing is allocated."""

from __future__ import annotations

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest

import granufab.simulate.contact_solver as contact_solver
from granufab.errors import NotConverged
from granufab.packing import Cell, Grains, Packing
from granufab.simulate import (
    Biaxial,
    ConstantMean,
    Loading,
    Material,
    SimpleShear,
    Simulation,
    Solver,
    compress,
    random_sample,
)
from granufab.simulate.stepping import Watch

QUICK = Solver(tolerance=1e-4, step_strain=2e-3, skin=0.05)
LOADINGS = {
    "biaxial": (2, Biaxial(axial_rate=0.05)),
    "shear": (2, SimpleShear(rate=0.05)),
    "spheres": (3, ConstantMean(rate=0.05, dimension=3)),
}


@pytest.fixture(scope="module")
def samples() -> dict[int, Packing]:
    return {
        2: compress(random_sample(300, seed=3), friction=0.3),
        3: compress(random_sample(200, dimension=3, seed=3), friction=0.3),
    }


def _simulation(packing: Packing, loading: Loading, **given) -> Simulation:
    given = {"solver": QUICK, "material": Material(friction=0.4), **given}
    return Simulation(packing, loading, **given)


def _bits(simulation: Simulation) -> list[np.ndarray]:
    s, c = simulation, simulation.candidates
    cell = [s.matrix, s.rate, s.strain, s.stress, s.origin, np.array([s.time])]
    return [s.position, s.motion, *cell, c.pairs, c.images, c.impulse_n, c.impulse_t, c.gap]


def _assert_same(one: Simulation, other: Simulation) -> None:
    for mine, yours in zip(_bits(one), _bits(other), strict=True):
        assert np.array_equal(mine, yours)
    assert (one.searches, one.contact_updates) == (other.searches, other.contact_updates)


@pytest.mark.parametrize("name", LOADINGS)
def test_threads_do_not_change_a_bit_of_a_run_with_searches(name, samples, monkeypatch):
    monkeypatch.setattr(contact_solver, "CHUNK_GRAINS", 40)
    dimension, loading = LOADINGS[name]
    runs = []
    for threads in (1, 2, 4):
        monkeypatch.setenv("GRANUFAB_THREADS", str(threads))
        runs.append(_simulation(samples[dimension], loading))
        assert runs[-1].contact_solver.threads == threads
        assert len(runs[-1].advance(1)) == 1
        made = 1
        while made < 60:
            made += len(runs[-1].advance(60 - made))
    assert runs[0].searches > 4
    for one, other in pairwise(runs):
        _assert_same(one, other)


@pytest.mark.parametrize("name", LOADINGS)
@pytest.mark.parametrize("chunk_grains", [40, 3000])
def test_one_call_makes_the_same_steps_as_many(name, chunk_grains, samples, monkeypatch):
    monkeypatch.setattr(contact_solver, "CHUNK_GRAINS", chunk_grains)
    dimension, loading = LOADINGS[name]
    one = _simulation(samples[dimension], loading)
    many = _simulation(samples[dimension], loading)
    reports = [one.step() for _ in range(80)]
    rows: list[np.ndarray] = []
    while sum(map(len, rows)) < 80:
        found = many.advance(80 - sum(map(len, rows)))
        rows.append(np.column_stack([found.sweeps, found.residual, found.contacts, found.overlap]))
    _assert_same(one, many)
    expected = [[r.sweeps, r.residual, r.contacts, r.overlap] for r in reports]
    assert np.concatenate(rows).tolist() == expected
    assert one.searches > 4


def test_a_watched_strain_ends_the_call_with_the_step_that_reaches_it(samples):
    loading = LOADINGS["biaxial"][1]
    weight = np.diag([-1.0, 1.0])
    one, watched = (_simulation(samples[2], loading) for _ in range(2))
    before, walked, steps = one.strain, 0.0, 0
    while walked < 0.011:
        one.step()
        steps += 1
        walked = float((weight * (one.strain - before)).sum())
    made = 0
    while float((weight * (watched.strain - before)).sum()) < 0.011:
        left = 0.011 - float((weight * (watched.strain - before)).sum())
        made += len(watched.advance(10_000, Watch(weight, left, np.inf)))
    assert made == steps > 3
    _assert_same(one, watched)
    assert len(watched.advance(10_000, Watch(weight, np.inf, 1e-9))) == 1


def test_steps_allocate_nothing(samples):
    """What remains allocated and what was, apart from a few hundred bytes of the reports."""
    still = Solver(tolerance=1e-3, step_strain=1e-6)
    simulation = _simulation(samples[2], ConstantMean(rate=1e-3), solver=still)
    simulation.advance(10)
    searches = simulation.searches
    tracemalloc.start()
    simulation.advance(1)
    _, one = tracemalloc.get_traced_memory()
    tracemalloc.reset_peak()
    made = len(simulation.advance(50))
    _, many = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert simulation.searches == searches
    assert made > 10
    row = simulation.memory.notes.rows[0].nbytes
    assert many - one < 6 * made * row
    assert many < simulation.position.nbytes * 8


def test_an_error_ends_a_call_at_its_step():
    """The second step misses the tolerance: the third is not made."""
    grains = Grains(
        position=np.array([[0.0, 0.0], [1.02, 0.3], [2.0, -0.2], [2.9, 0.4]]),
        radius=np.full(4, 0.5),
        mass=np.ones(4),
        velocity=np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [-1.0, 0.1]]),
        spin=np.zeros((4, 1)),
    )
    packing = Packing(grains=grains, cell=Cell(matrix=np.diag([20.0, 20.0])))
    zero = np.zeros((2, 2))
    loading = Loading(
        rate=zero, free=zero.astype(bool), dilation=False, stress=zero,
        direction=np.array([0.0, 1.0]), extension=np.array([1.0, 0.0]),
    )  # fmt: skip
    strict = Solver(tolerance=1e-13, max_sweeps=2, strict=True)
    simulation = Simulation(packing, loading, step=0.01, solver=strict)
    with pytest.raises(NotConverged, match="after 2 sweeps"):
        simulation.advance(100)
    assert 0 < simulation.time < 0.5
    assert not simulation.last_report.converged
