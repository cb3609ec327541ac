"""Settings of every wrong kind: one line that names the key and the value, soon, no traceback."""

from __future__ import annotations

import math
import string
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from granufab.errors import InvalidSettings
from granufab.simulate.settings import Case, load_case, to_toml

CI, RELEASE = 300, 20_000
"""Examples of the default and of the slow tests."""
LONGEST = 10.0
"""Seconds after which an example counts as hanging; a fault is told in milliseconds."""

QUICKLY = settings(
    max_examples=CI, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
MANY = settings(QUICKLY, max_examples=RELEASE)
COUNTS = {"read": 0, "refused": 0, "seconds": 0.0}


def _number_keys(model: Any, path: str = "") -> Iterator[str]:
    for name, value in model:
        key = f"{path}.{name}" if path else name
        if isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            yield from _number_keys(value[0], f"{key}.0")
        elif isinstance(value, BaseModel):
            yield from _number_keys(value, key)
        elif isinstance(value, float) and not isinstance(value, bool):
            yield key


NUMBERS = sorted(_number_keys(Case()))
POSITIVE = [key for key in NUMBERS if not key.endswith(".strain")]
UNBOUNDED = {"solver.stiffness"}
"""Keys that may be infinite."""


def _attempt(path: Path, text: str | bytes) -> str:
    """The message of a refusal, or nothing; anything but a clean refusal fails."""
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    began, message = time.process_time(), ""
    try:
        case = load_case(path)
        assert load_case(_again(path, case)) == case
    except InvalidSettings as error:
        message = str(error)
        assert "\n" not in message
        assert str(path) in message
        assert len(message) < 2000
    spent = time.process_time() - began
    assert spent < LONGEST
    COUNTS["seconds"] = max(COUNTS["seconds"], spent)
    COUNTS["refused" if message else "read"] += 1
    return message


def _again(path: Path, case: Case) -> Path:
    again = path.with_suffix(".again")
    again.write_text(to_toml(case), encoding="utf-8")
    return again


def _assignment(key: str, text: str) -> str:
    *sections, name = key.split(".")
    if sections and sections[-1] == "0":
        return f"[[{'.'.join(sections[:-1])}]]\n{name} = {text}\n"
    return f"[{'.'.join(sections)}]\n{name} = {text}\n" if sections else f"{name} = {text}\n"


@pytest.fixture(scope="module", autouse=True)
def counts(tell_of_all: Callable[..., None]) -> Iterator[None]:
    yield
    tell_of_all(**COUNTS)


@pytest.mark.parametrize("value", ["nan", "-nan", "inf", "-inf", "-1.0", "-1e300"])
@pytest.mark.parametrize("key", POSITIVE)
def test_every_number_refuses_what_it_cannot_be(tmp_path: Path, key: str, value: str) -> None:
    message = _attempt(tmp_path / "case.toml", _assignment(key, value))
    if key in UNBOUNDED and value == "inf":
        assert not message
        return
    assert key in message
    assert repr(float(value)).lstrip("-") in message


@pytest.mark.parametrize("value", ['"many"', "[1]", "{x = 1}", "1979-05-27"])
@pytest.mark.parametrize("key", NUMBERS)
def test_every_number_refuses_other_types(tmp_path: Path, key: str, value: str) -> None:
    message = _attempt(tmp_path / "case.toml", _assignment(key, value))
    assert key in message
    assert "got" in message


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_a_strain_must_be_finite(tmp_path: Path, value: str) -> None:
    message = _attempt(tmp_path / "case.toml", _assignment("path.0.strain", value))
    assert "strain" in message
    assert value in message


LETTERS = st.text(string.ascii_lowercase + "_", min_size=1, max_size=12)
PLAIN = st.one_of(
    st.booleans().map(lambda x: str(x).lower()),
    st.integers(-(10**30), 10**30).map(str),
    st.floats().map(lambda x: repr(x) if math.isfinite(x) else ("nan" if x != x else "inf")),
    st.text(string.printable.replace('"', "").replace("\\", ""), max_size=20)
    .filter(lambda text: all(c >= " " for c in text))
    .map(lambda text: f'"{text}"'),
    st.lists(st.integers(), max_size=4).map(str),
)
SECTIONS = ["sample", "material", "solver", "record", "sample.sizes", "sample.read", ""]


def _unknown_key(tmp_path: Path, section: str, key: str, value: str) -> None:
    models = [Case, *(type(value) for _, value in Case() if isinstance(value, BaseModel))]
    known = {name for model in models for name in model.model_fields}
    if key in known:
        return
    name = f"{section}.{key}" if section else key
    message = _attempt(tmp_path / "case.toml", _assignment(name, value))
    assert f"unknown key {name}" in message
    assert "did you mean" in message


def _any_value(tmp_path: Path, key: str, value: str) -> None:
    message = _attempt(tmp_path / "case.toml", _assignment(key, value))
    if message:
        assert key.split(".")[0] in message


def _mutated(tmp_path: Path, places: list[tuple[float, int]], cut: float) -> None:
    text = bytearray(to_toml(Case()).encode())
    for place, byte in places:
        text[int(place * (len(text) - 1))] = byte
    _attempt(tmp_path / "case.toml", bytes(text[: int(cut * len(text))]))


UNKNOWN = {"section": st.sampled_from(SECTIONS), "key": LETTERS, "value": PLAIN}
ANY = {"key": st.sampled_from(NUMBERS), "value": PLAIN}
MUTATED = {
    "places": st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6),
    "cut": st.floats(0, 1),
}
BYTES = {"content": st.binary(max_size=300)}


@QUICKLY
@given(**UNKNOWN)
def test_unknown_keys(tmp_path: Path, section: str, key: str, value: str) -> None:
    _unknown_key(tmp_path, section, key, value)


@QUICKLY
@given(**ANY)
def test_any_value_of_a_number(tmp_path: Path, key: str, value: str) -> None:
    _any_value(tmp_path, key, value)


@QUICKLY
@given(**MUTATED)
def test_changed_bytes_of_a_settings_file(
    tmp_path: Path, places: list[tuple[float, int]], cut: float
) -> None:
    _mutated(tmp_path, places, cut)


@QUICKLY
@given(**BYTES)
def test_any_bytes(tmp_path: Path, content: bytes) -> None:
    _attempt(tmp_path / "case.toml", content)


@pytest.mark.slow
@MANY
@given(**UNKNOWN)
def test_unknown_keys_at_length(tmp_path: Path, section: str, key: str, value: str) -> None:
    _unknown_key(tmp_path, section, key, value)


@pytest.mark.slow
@MANY
@given(**MUTATED)
def test_changed_bytes_at_length(
    tmp_path: Path, places: list[tuple[float, int]], cut: float
) -> None:
    _mutated(tmp_path, places, cut)


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * 50_000,
        "x = " + "9" * 100_000,
        "[sample]\ngrain_count = " + "9" * 4000,
        "[" + "a." * 20_000 + "a]\n",
        "name = '" + "x" * 1_000_000 + "'\n[material]\nfriction = -1\n",
        "[[path]]\n" * 20_000 + "loading = 'twist'\n",
    ],
    ids=["nested", "long number", "huge count", "deep table", "long name", "many stages"],
)
def test_oversized_settings_are_told_in_a_short_line(tmp_path: Path, text: str) -> None:
    assert _attempt(tmp_path / "case.toml", text)
