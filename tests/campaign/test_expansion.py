"""Which cases a campaign has, what they are called, and what is refused before any is run."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from granufab.campaign import expand, load_sweep, parse_sweep
from granufab.errors import InvalidSettings
from granufab.simulate.settings import load_case, to_toml

MU = {"key": "material.friction", "values": [0.1, 0.4]}
RATE = {"key": "path.0.inertial_number", "low": 1e-4, "high": 1e-2, "count": 3, "spacing": "log"}
SIZE = {"key": "sample.grain_count", "values": [40, 80]}


def cases(*parameters: dict[str, Any], **more: Any) -> list[Any]:
    return expand(parse_sweep({"parameter": list(parameters), **more}))


def test_a_grid_holds_every_combination_once() -> None:
    found = cases(MU, RATE, seeds=[3, 5])
    got = [
        (m.case.material.friction, m.case.path[0].inertial_number, m.case.sample.seed)
        for m in found
    ]
    assert got == list(product([0.1, 0.4], [1e-4, 1e-3, 1e-2], [3, 5]))
    assert dict(found[0].parameters) == {"friction": 0.1, "inertial_number": 1e-4}


def test_a_linear_grid_has_its_ends_and_no_round_off() -> None:
    found = cases({"key": "material.friction", "low": 0.0, "high": 0.6, "count": 7})
    assert [m.case.material.friction for m in found] == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]


def test_zipped_lists_are_walked_together() -> None:
    first = {"key": "sample.friction", "values": [0.0, 0.5, 0.5], "zip": "start"}
    second = {"key": "sample.solid_fraction", "values": [0.4, 0.3, 0.4], "zip": "start"}
    found = cases(first, MU, second)
    got = {(m.case.sample.friction, m.case.sample.solid_fraction, m.case.material.friction)
           for m in found}  # fmt: skip
    pairs = [(0.0, 0.4), (0.5, 0.3), (0.5, 0.4)]
    assert got == {(a, b, mu) for (a, b), mu in product(pairs, [0.1, 0.4])}
    assert len(found) == 6


def test_two_parameters_of_one_last_name_are_told_apart_by_their_keys() -> None:
    found = cases(MU, {"key": "sample.friction", "values": [0.0]})
    assert set(found[0].parameters) == {"material.friction", "sample.friction"}


@pytest.mark.parametrize("count", [1, 5, 20])
def test_a_latin_hypercube_has_one_value_in_each_share_of_each_range(count: int) -> None:
    ranges = (
        {"key": "material.friction", "low": 0.2, "high": 0.6},
        {"key": "path.0.inertial_number", "low": 1e-4, "high": 1e-2, "spacing": "log"},
    )
    found = cases(*ranges, latin={"count": count, "seed": 4})
    friction = np.array([m.case.material.friction for m in found])
    rate = np.array([m.case.path[0].inertial_number for m in found], dtype=float)
    for share in ((friction - 0.2) / 0.4, np.log10(rate / 1e-4) / 2):
        assert sorted(np.floor(share * count).astype(int)) == list(range(count))
    again = cases(*ranges, latin={"count": count, "seed": 4})
    other = cases(*ranges, latin={"count": count, "seed": 5})
    assert [m.id for m in again] == [m.id for m in found] != [m.id for m in other]


def test_whole_numbers_are_whole() -> None:
    sizes = {"key": "sample.grain_count", "low": 10, "high": 1000, "count": 4, "spacing": "log",
             "whole": True}  # fmt: skip
    assert [m.case.sample.grain_count for m in cases(sizes)] == [10, 46, 215, 1000]


def test_seeds_count_from_the_seed_of_the_case() -> None:
    found = cases(MU, seeds=3, case={"sample": {"seed": 7}})
    assert [m.seed for m in found] == [7, 8, 9, 7, 8, 9]


def test_a_campaign_without_parameters_is_its_seeds() -> None:
    assert [m.seed for m in cases(seeds=[4, 2])] == [4, 2]


def test_the_hash_is_of_the_settings_not_of_how_they_were_written(tmp_path: Path) -> None:
    forth = {m.digest for m in cases(MU, SIZE, seeds=2)}
    back = {m.digest for m in cases(SIZE, {**MU, "values": [0.4, 0.1]}, seeds=[2, 1])}
    defaults = {m.digest for m in cases(MU, SIZE, seeds=2, case={"solver": {"skin": 0.1}})}
    assert forth == back == defaults
    assert len(forth) == 8
    one = cases(MU, SIZE, seeds=2)[3]
    assert one.id.endswith(one.digest)
    (tmp_path / "settings.toml").write_text(to_toml(one.case), encoding="utf-8")
    assert load_case(tmp_path / "settings.toml") == one.case


def test_any_other_setting_changes_the_hash() -> None:
    base = cases(MU)[0].digest
    changed = [
        {"solver": {"tolerance": 1e-5}},
        {"record": {"reach": 0.04}},
        {"path": [{"strain": 0.2}]},
    ]
    assert len({base, *(cases(MU, case=case)[0].digest for case in changed)}) == 4


def test_the_case_of_a_file_lies_beside_and_sections_win(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(
        "[sample]\ngrain_count = 50\nseed = 3\n[material]\nrestitution = 0.5\n", encoding="utf-8"
    )
    text = (
        '[case]\nfile = "case.toml"\n[case.sample]\ngrain_count = 60\n'
        '[[parameter]]\nkey = "material.friction"\nvalues = [0.2]\n'
    )
    (tmp_path / "sweep.toml").write_text(text, encoding="utf-8")
    (one,) = expand(load_sweep(tmp_path / "sweep.toml"))
    assert (one.case.sample.grain_count, one.case.sample.seed) == (60, 3)
    assert (one.case.material.restitution, one.case.material.friction) == (0.5, 0.2)


BAD = {
    "unknown key parametr; did you mean parameter?": {"parametr": []},
    "unknown key parameter.0.valuse; did you mean values?": {
        "parameter": [{"key": "material.friction", "valuse": [1]}]
    },
    "give values = [...], or low and high": {"parameter": [{"key": "material.friction"}]},
    "needs low < high, got 0.5 and 0.1": {
        "parameter": [{"key": "material.friction", "low": 0.5, "high": 0.1, "count": 3}]
    },
    "spacing log needs low > 0": {
        "parameter": [{**RATE, "low": 0.0}]
    },
    "the value 0.1 is there twice": {
        "parameter": [{"key": "material.friction", "values": [0.1, 0.1]}]
    },
    "nan is no value": {"parameter": [{"key": "material.friction", "values": [float("nan")]}]},
    "parameter material.friction is there twice": {"parameter": [MU, MU]},
    "add count = 5, or [latin]": {
        "parameter": [{"key": "material.friction", "low": 0.0, "high": 1.0}]
    },
    "no parameter is a range": {"parameter": [MU], "latin": {"count": 3}},
    "zip w: material.friction has 2 values, but sample.grain_count has 1": {
        "parameter": [{**MU, "zip": "w"}, {**SIZE, "values": [40], "zip": "w"}]
    },
    "repeats are given by seeds": {"parameter": [{"key": "sample.seed", "values": [1, 2]}]},
    "seeds holds a seed twice": {"seeds": [1, 1]},
    "case friction = -1, seed = 1: material.friction": {
        "parameter": [{"key": "material.friction", "values": [0.1, -1.0]}]
    },
    "did you mean friction?": {"parameter": [{"key": "material.frictoin", "values": [0.1]}]},
    "name the stage, for example path.0.strain": {
        "parameter": [{"key": "path.strain", "values": [0.1]}]
    },
    "there is no entry 1, allowed 0..0": {
        "parameter": [{"key": "path.1.strain", "values": [0.1]}]
    },
    "two cases have the same settings": {
        "parameter": [{"key": "record.z_definition", "values": ["z", "z_backbone"]},
                      {"key": "sample.friction", "values": [0.1, 0.10000000000000001], "zip": "w"}]
    },
    "expands to 1000000 cases, at most 100000": {
        "parameter": [
            {"key": "material.friction", "low": 0.0, "high": 1.0, "count": 1000},
            {"key": "material.restitution", "low": 0.0, "high": 1.0, "count": 1000},
        ]
    },
    "parameter name z_star is a result's": {"parameter": [{**MU, "name": "z_star"}]},
    "case.file: expected the name of a file": {"case": {"file": 3}},
}  # fmt: skip


@pytest.mark.parametrize("words", BAD)
def test_bad_campaigns_are_refused_in_one_line(words: str) -> None:
    with pytest.raises(InvalidSettings) as refused:
        expand(parse_sweep(BAD[words], where="sweep.toml"), where="sweep.toml")
    assert words in str(refused.value)
    assert str(refused.value).startswith("sweep.toml: ")
    assert "\n" not in str(refused.value)


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 10**12) | st.floats() | st.text(max_size=6),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=6,
)
keys = st.sampled_from(
    ["material.friction", "path.0.strain", "path.x.strain", "path", "sample", "", "a..b",
     "sample.sizes.spread", "name", "sample.seed", "path.0", "record.criterion", "case.x"]
)  # fmt: skip
rows = st.fixed_dictionaries(
    {"key": keys | plain},
    optional={
        "values": plain,
        "low": st.floats() | plain,
        "high": st.floats() | plain,
        "count": st.integers(-1, 5) | plain,
        "spacing": st.sampled_from(["log", "linear"]) | plain,
        "zip": st.sampled_from(["a", "b"]) | plain,
        "name": plain,
        "whole": plain,
    },
)


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    st.fixed_dictionaries(
        {"parameter": st.lists(rows, max_size=3) | plain},
        optional={"seeds": plain, "case": plain, "latin": plain, "name": plain},
    )
)
def test_any_rows_expand_or_are_refused(data: dict[str, Any]) -> None:
    try:
        found = expand(parse_sweep(data))
    except InvalidSettings as refused:
        assert str(refused).startswith("sweep: ")
    else:
        assert len({member.id for member in found}) == len(found) >= 1
