"""A tiled state is its source repeated: stress, coordination and residual stay the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granufab.bench.engine import problem_of
from granufab.bench.problems import biaxial_loading, copies_for, isotropic_state, tile
from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import select_network, stress_tensor
from granufab.packing import Packing
from granufab.simulate import Isotropic, compress, random_sample


def test_stress_and_coordination_are_those_of_the_source(packed: Packing) -> None:
    tiled = tile(packed, 2)
    copies = 2**packed.dimension
    assert tiled.grains.count == copies * packed.grains.count
    assert tiled.contacts.count == copies * packed.contacts.count
    assert tiled.cell.volume == pytest.approx(copies * packed.cell.volume)
    assert stress_tensor(tiled) == pytest.approx(stress_tensor(packed), rel=1e-12, abs=1e-14)
    options = {"criterion": "force", "z_definition": "z_backbone"}
    one, many = (select_network(p, **options) for p in (packed, tiled))
    assert many.grain_count == copies * one.grain_count
    assert many.contacts.count == copies * one.contacts.count


def _branches(packing: Packing) -> np.ndarray:
    i, j = packing.contacts.pair.T
    position, shift = packing.grains.position, packing.contacts.image @ packing.cell.matrix.T
    return position[j] + shift - position[i]


def test_every_contact_joins_the_grains_that_its_image_says(packed: Packing) -> None:
    tiled = tile(packed, 3)
    once, often = _branches(packed), _branches(tiled)
    assert often == pytest.approx(np.concatenate([once] * 3**packed.dimension), abs=1e-12)
    i, j = tiled.contacts.pair.T
    touching = np.linalg.norm(often, axis=1) - tiled.grains.radius[i] - tiled.grains.radius[j]
    assert touching == pytest.approx(tiled.contacts.gap, abs=1e-4)  # listed at the midpoint


def test_the_residual_is_that_of_the_source(packed: Packing) -> None:
    loading = Isotropic(dimension=packed.dimension)
    one = problem_of(packed, loading, friction=0.3)
    many = problem_of(tile(packed, 2), loading, friction=0.3)
    assert many.contact_count == 2**packed.dimension * one.contact_count
    assert many.residual == pytest.approx(one.residual, rel=0.05)
    assert one.residual < 0.01


def test_shaken_copies_differ_and_the_draw_is_repeatable(packed: Packing) -> None:
    shaken, again = tile(packed, 2, shake=1.0), tile(packed, 2, shake=1.0)
    assert np.array_equal(shaken.contacts.force, again.contacts.force)
    assert np.array_equal(shaken.grains.velocity, again.grains.velocity)
    change = shaken.contacts.force - tile(packed, 2).contacts.force
    assert 0 < np.abs(change).max() <= 0.05 * np.abs(shaken.contacts.force).max() / 0.95
    assert stress_tensor(shaken) == pytest.approx(stress_tensor(packed), abs=0.05)


def test_grains_keep_their_size_and_mass(packed: Packing) -> None:
    tiled = tile(packed, 2)
    for name in ("radius", "mass"):
        many = np.sort(getattr(tiled.grains, name))[:: 2**packed.dimension]
        assert np.array_equal(many, np.sort(getattr(packed.grains, name)))


@pytest.mark.parametrize(("count", "dimension"), [(13_000, 2), (10_000, 3), (200_000, 2)])
def test_any_size_is_met_within_a_percent(count: int, dimension: int) -> None:
    copies, source = copies_for(count, dimension)
    assert copies**dimension * source == pytest.approx(count, rel=0.01)


def test_isotropic_states_bear_the_pressure() -> None:
    state = isotropic_state(160, source=40, shake=0.0)
    assert state.grains.count == 160
    stress = stress_tensor(state)
    assert np.trace(stress) / 2 == pytest.approx(1.0, abs=0.1)
    assert stress == pytest.approx(np.eye(2), abs=0.3)
    assert np.trace(stress_tensor(state)) == pytest.approx(2.0, abs=1e-3)
    assert biaxial_loading(state).nominal_rate > 0


def test_what_cannot_be_tiled_is_refused(packed: Packing) -> None:
    with pytest.raises(InvalidSettings, match="at least 1 copy, got 0"):
        tile(packed, 0)
    walled = compress(random_sample(20, boundary="walls", seed=1), friction=0.3)
    with pytest.raises(InvalidSettings, match="fully periodic"):
        tile(walled, 2)
    with pytest.raises(MissingData, match="cell"):
        tile(replace(packed, cell=None), 2)
    with pytest.raises(InvalidSettings, match="10 grains"):
        copies_for(10, 2)
