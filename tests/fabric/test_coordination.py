import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from granufab.errors import InvalidSettings
from granufab.fabric import backbone, coordination, minimum_contacts


def pairs(*text):
    return np.array(text, dtype=np.int64).reshape(-1, 2)


RING = [(0, 1), (1, 2), (2, 3), (3, 0)]


def test_a_chain_is_removed_to_its_last_grain():
    chain = pairs(*[(k, k + 1) for k in range(50)])
    assert not backbone(chain, 51).any()


def test_a_ring_holds_and_its_tail_does_not():
    held = backbone(pairs(*RING, (3, 4), (4, 5)), 7)
    assert held.tolist() == [True] * 4 + [False] * 3


def test_a_wall_holds_a_chain_that_ends_on_it():
    chain = pairs((0, 1), (1, 2))
    assert not backbone(chain, 3).any()
    assert backbone(chain, 3, support=np.array([1, 0, 1])).all()
    # One end alone does not hold it.
    assert not backbone(chain, 3, support=np.array([1, 0, 0])).any()


def test_a_grain_on_its_own_images_is_held():
    assert backbone(pairs((0, 0), (0, 0), (0, 0)), 1, minimum=6).all()


def test_conventions_remove_ever_more():
    wheel = pairs(*RING, (0, 2), (1, 3))  # four grains, three contacts each
    assert backbone(wheel, 4, minimum=3).all()
    assert not backbone(wheel, 4, minimum=4).any()
    assert not backbone(pairs(*RING), 4, minimum=3).any()
    assert [minimum_contacts(rule, 3) for rule in ("frictional", "frictionless", "below-3", 5)] == [
        2,
        4,
        3,
        5,
    ]
    assert minimum_contacts("frictionless", 2) == 3
    with pytest.raises(InvalidSettings, match=r"rattler rule 'loose' is unknown; allowed: frict"):
        minimum_contacts("loose", 2)


def test_three_definitions_on_a_case_counted_by_hand():
    # Ring of 4 with a diagonal (5 contacts), a tail 3-4-5 (2 more), a floater 6.
    numbers = coordination(pairs(*RING, (0, 2), (3, 4), (4, 5)), 7)
    assert numbers.z == pytest.approx(2 * 7 / 7)
    assert numbers.z_backbone == pytest.approx(2 * 5 / 4)
    # N_0 = 1 (grain 6), N_1 = 1 (grain 5): (14 − 1)/(7 − 1 − 1).
    assert numbers.z_mechanical == pytest.approx(13 / 5)
    assert numbers.rattler_fraction == pytest.approx(3 / 7)


@given(seed=st.integers(0, 10**6), grains=st.integers(2, 60), contacts=st.integers(0, 120))
def test_definitions_agree_with_their_formulas_on_random_graphs(seed, grains, contacts):
    generator = np.random.default_rng(seed)
    pair = generator.integers(0, grains, (contacts, 2))
    pair = pair[pair[:, 0] != pair[:, 1]]
    numbers = coordination(pair, grains)
    degree = np.array([(pair == k).sum() for k in range(grains)])
    none, one = (degree == 0).sum(), (degree == 1).sum()
    if grains > none + one:
        assert numbers.z_mechanical == pytest.approx((2 * len(pair) - one) / (grains - none - one))
    # The backbone is the largest set in which everyone has two contacts: one by one removal.
    alive, edges = set(range(grains)), [tuple(p) for p in pair]
    while weak := [g for g in alive if sum((g in e) for e in edges) < 2]:
        alive -= {weak[0]}
        edges = [e for e in edges if weak[0] not in e]
    assert set(np.flatnonzero(numbers.held)) == alive
    if alive:
        assert numbers.z_backbone == pytest.approx(2 * len(edges) / len(alive))
    else:
        assert numbers.z_backbone == 0


def test_a_hundred_thousand_contacts_take_little_time():
    import time

    generator = np.random.default_rng(0)
    pair = generator.integers(0, 50_000, (100_000, 2))
    start = time.perf_counter()
    held = backbone(pair, 50_000)
    assert time.perf_counter() - start < 1.0
    assert 0 < held.sum() < 50_000
