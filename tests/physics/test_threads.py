"""The same bits for any number of threads; one contact at a time agrees to round-off."""

from __future__ import annotations

import copy
import os
import pickle

import numpy as np
import pytest

import granufab.simulate.contact_solver as contact_solver
import granufab.simulate.stepping as stepping
from granufab.errors import InvalidSettings
from granufab.packing import Packing
from granufab.simulate import Biaxial, ConstantMean, Simulation, Solver, compress, random_sample
from granufab.simulate.team import thread_count


@pytest.fixture(scope="module", params=[2, 3])
def packing(request) -> Packing:
    return compress(random_sample(300, dimension=request.param, seed=3), friction=0.3)


def _state(packing: Packing, monkeypatch, threads: int, loading: type, wide: bool = True):
    monkeypatch.setattr(contact_solver, "CHUNK_GRAINS", 60)
    monkeypatch.setenv("GRANUFAB_THREADS", str(threads))
    monkeypatch.setenv("GRANUFAB_LANES", "1" if wide else "0")
    drive = {"rate": 0.01} if loading is ConstantMean else {"axial_rate": 0.01}
    if loading is ConstantMean:
        drive["dimension"] = packing.grains.dimension
    simulation = Simulation(packing, loading(**drive), solver=Solver(tolerance=1e-8))
    assert simulation.contact_solver.chunk_count == 8
    assert simulation.contact_solver.threads == threads
    for _ in range(5):
        assert simulation.step().converged
    return simulation


@pytest.mark.parametrize("loading", [ConstantMean, Biaxial])
def test_the_bits_do_not_depend_on_the_threads(packing, monkeypatch, loading):
    if loading is Biaxial and packing.grains.dimension == 3:
        pytest.skip("biaxial loading is for disks")
    one = _state(packing, monkeypatch, 1, loading)
    for threads in (2, 4):
        other = _state(packing, monkeypatch, threads, loading)
        assert np.array_equal(other.position, one.position)
        assert np.array_equal(other.motion, one.motion)
        assert np.array_equal(other.candidates.impulse_n, one.candidates.impulse_n)
        assert np.array_equal(other.stress, one.stress)


def test_one_contact_at_a_time_gives_the_same_motion(packing, monkeypatch):
    one = _state(packing, monkeypatch, 1, ConstantMean)
    other = _state(packing, monkeypatch, 1, ConstantMean, wide=False)
    assert other.position == pytest.approx(one.position, abs=1e-7)
    assert other.stress == pytest.approx(one.stress, abs=1e-6)


def test_a_failing_member_ends_the_others(packing, monkeypatch):
    """And the next step starts afresh, with the same result."""
    simulation = _state(packing, monkeypatch, 2, ConstantMean)
    other = _state(packing, monkeypatch, 2, ConstantMean)
    advance = stepping.advance

    def fail(*arguments):
        if arguments[-2] == 0:
            raise KeyboardInterrupt
        return advance(*arguments)

    monkeypatch.setattr(stepping, "advance", fail)
    motion, position, matrix = other.motion.copy(), other.position.copy(), other.matrix.copy()
    with pytest.raises(KeyboardInterrupt):
        other.step()
    monkeypatch.setattr(stepping, "advance", advance)
    other.motion[:], other.position[:], other.matrix = motion, position, matrix
    assert other.step().converged
    assert simulation.step().converged


def test_a_stepped_simulation_can_be_copied_and_pickled(packing, monkeypatch):
    simulation = _state(packing, monkeypatch, 2, ConstantMean)
    twins = [pickle.loads(pickle.dumps(simulation)), copy.deepcopy(simulation)]
    simulation.step()
    for twin in twins:
        twin.step()
        assert np.array_equal(twin.motion, simulation.motion)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_steps_on_with_threads_of_its_own(packing, monkeypatch):
    simulation = _state(packing, monkeypatch, 2, ConstantMean)
    child = os.fork()
    if child == 0:
        converged = simulation.step().converged
        os._exit(0 if converged else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.parametrize("given", ["0", "two", "-1", "²"])
def test_a_wrong_number_of_threads_is_refused(monkeypatch, given):
    monkeypatch.setenv("GRANUFAB_THREADS", given)
    with pytest.raises(InvalidSettings, match="GRANUFAB_THREADS is"):
        thread_count()
