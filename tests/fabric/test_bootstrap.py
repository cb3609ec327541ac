from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import draw_plane, hexagonal, jittered

from granufab.errors import MissingData
from granufab.fabric import bootstrap_errors, measure, neighbours_within
from granufab.packing import Contacts

CRITERION = "gap:0.05"


def independent(generator):
    """Near pairs with normals that know nothing of each other."""
    state = jittered(generator, 625, spread=0.3)
    pair = neighbours_within(state, 0.12).pair
    normal = draw_plane(len(pair), 0.3, 0.0, generator)
    return replace(state, contacts=Contacts(pair=pair, normal=normal))


@pytest.mark.parametrize(
    ("make", "criterion"),
    [
        (lambda generator: jittered(generator, 625, 2, spread=0.35), "gap:0.05"),
        (lambda generator: jittered(generator, 1000, 3, spread=0.35), "gap:0.05"),
        (independent, "listed"),
    ],
)
def test_errors_are_the_spread_between_replicas(make, criterion):
    generator = np.random.default_rng(11)
    values, errors = [], []
    for _ in range(80):
        state = make(generator)
        chosen = {
            "criterion": criterion,
            "z_definition": "z",
            "direction": np.eye(state.dimension)[0],
        }
        found = measure(state, **chosen)
        values.append([found["z"], found["a_signed"]])
        error = bootstrap_errors(state, **chosen, replicas=200)
        errors.append([error["z"], error["a_signed"]])
    # The spread of 80 replicas is known to 8 %; resampling single grains would give 0.7 of the
    # error of a' for independent contacts.
    ratio = np.mean(errors, axis=0) / np.std(values, axis=0)
    assert 0.8 < ratio[1] < 1.25
    assert 0.8 < ratio[0] < 1.5


def test_a_perfect_lattice_has_no_error_and_a_seed_repeats():
    lattice = hexagonal(20)
    errors = bootstrap_errors(lattice, criterion="gap:0.01")
    assert errors["z"] == pytest.approx(0, abs=1e-12)
    assert errors["a_signed"] == pytest.approx(0, abs=1e-12)
    state = jittered(np.random.default_rng(1), 400)
    first, again, other = (
        bootstrap_errors(state, criterion=CRITERION, z_definition="z", seed=seed)
        for seed in (3, 3, 4)
    )
    assert first == again
    assert first != other


def test_too_small_a_state_is_told_to_use_replicas():
    with pytest.raises(MissingData, match="use replicas"):
        bootstrap_errors(hexagonal(4), criterion="gap:0.01")


def test_measure_adds_the_errors_when_asked():
    state = jittered(np.random.default_rng(1), 400)
    values = measure(state, criterion=CRITERION, z_definition="z", bootstrap=100)
    assert 0 < values["z_error"] < 0.5
    assert 0 < values["a_signed_error"] < 0.5
    small = measure(hexagonal(4), criterion="gap:0.01", bootstrap=100)
    assert small["z"] == 6
    assert "use replicas" in small["missing"]
