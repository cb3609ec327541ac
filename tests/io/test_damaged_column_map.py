"""The file that says what the columns of a table hold, cut and with wrong bytes."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from mangling import states
from one_of_each_text import TEXT

import granufab
from granufab.cli.foreign import ForeignOptions
from granufab.errors import GranufabError, InvalidSettings

MAP = """[grains]
id = "who"
x = "east"
y = "north"
z = "up"
radius = 6

[contacts]
i = 2
j = "j"

[conventions]
compression = 1
force_on = "second"
"""


def _told(folder: Path, data: bytes) -> str:
    """The error of reading the tables with a map, which names the map, its entry or a table."""
    path = folder / "map.toml"
    path.write_bytes(data)
    keywords = {}
    try:
        keywords = ForeignOptions(columns=path).keywords()
        run = granufab.read(folder / "g.csv", folder / "c.csv", format="csv", **keywords)
        _, error = states(run)
    except GranufabError as raised:
        error = raised
    text = "" if error is None else str(error)
    assert "\n" not in text, data
    assert not text or re.search(r"map\.toml|columns|[gc]\.csv", text), text
    return text


def test_cuts_and_wrong_bytes(tmp_path: Path) -> None:
    TEXT["csv"](tmp_path)
    whole, chance = MAP.encode(), random.Random(4)
    assert not _told(tmp_path, whole)
    told = [_told(tmp_path, whole[: chance.randrange(len(whole))]) for _ in range(200)]
    for _ in range(200):
        place, value = chance.randrange(len(whole)), chance.randrange(256)
        told.append(_told(tmp_path, whole[:place] + bytes([value]) + whole[place + 1 :]))
    assert 100 < sum(map(bool, told)) < 400


@pytest.mark.parametrize(
    "value",
    ["1.5", "true", "[1]", "{a = 1}", "1979-05-27", "nan", "-7", "0", "9" * 30, '""', '"\\u0000"'],
)
@pytest.mark.parametrize("entry", ['"east"', "radius = 6", "compression = 1", '"second"'])
def test_values_that_are_no_columns(tmp_path: Path, value: str, entry: str) -> None:
    TEXT["csv"](tmp_path)
    key, mark, _ = entry.rpartition("= ")
    assert _told(tmp_path, MAP.replace(entry, key + mark + value).encode())


@pytest.mark.parametrize(
    "data",
    [b"a = " + b"[" * 100000, b"\xff\xfe", b"\0" * 100, b"grains = 1", b"a = 1" + b"0" * 5000],
)
def test_what_is_no_map(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "map.toml"
    path.write_bytes(data)
    with pytest.raises(InvalidSettings, match=r"map\.toml"):
        ForeignOptions(columns=path).keywords()
