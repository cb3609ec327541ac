"""Tables of text: columns by name or by a map, frames, senses, and files that were damaged."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from granufab import read
from granufab.errors import CorruptFile, GranufabError, InvalidSettings, MissingData, UnknownFormat
from granufab.fabric import measure_run

GRAINS = """id,x,y,z,radius
7,0,0,0,0.5
3,1,0,0,0.5
9,0,1,0,0.5
5,0,0,1.02,0.5
"""
CONTACTS = """id1,id2,fx,fy,fz
7,3,2,0.5,0
9,7,0,-3,0
7,5,0,0,4
"""


def written(folder: Path, **tables: str) -> list[Path]:
    paths = []
    for name, text in tables.items():
        path = folder / f"{name}.csv"
        path.write_text(text, encoding="utf-8")
        paths.append(path)
    return paths


def test_obvious_headers_need_no_map(tmp_path: Path) -> None:
    run = read(*written(tmp_path, grains=GRAINS, contacts=CONTACTS))
    packing = run.frames[0].packing
    assert packing.grains.number is not None
    assert packing.grains.number.tolist() == [7, 3, 9, 5]
    assert packing.dimension == 3
    contacts = packing.contacts
    assert contacts is not None and contacts.force is not None and contacts.gap is not None
    assert contacts.pair.tolist() == [[0, 1], [2, 0], [0, 3]]
    np.testing.assert_array_equal(contacts.normal, [[1, 0, 0], [0, -1, 0], [0, 0, 1]])
    np.testing.assert_array_equal(contacts.force, [[2, 0.5, 0], [0, -3, 0], [0, 0, 4]])
    np.testing.assert_allclose(contacts.gap, [0, 0, 0.02], atol=1e-15)
    assert float(measure_run(run, z_definition="z")["z"][0]) == 2 * 3 / 4


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_the_delimiter_is_found(tmp_path: Path, mark: str) -> None:
    run = read(*written(tmp_path, g=GRAINS.replace(",", mark), c=CONTACTS.replace(",", mark)))
    assert run.frames[0].packing.contacts.count == 3  # type: ignore[union-attr]


def test_semicolons_allow_decimal_commas(tmp_path: Path) -> None:
    text = GRAINS.replace(",", ";").replace(".", ",")
    packing = read(*written(tmp_path, grains=text)).frames[0].packing
    assert packing.grains.position[3, 2] == 1.02


def test_a_comment_can_be_the_header(tmp_path: Path) -> None:
    text = "# made by hand\n# x  y  diameter\n0 0 1\n1 0 1\n0 1 2\n3 3 1\n"
    packing = read(*written(tmp_path, grains=text)).frames[0].packing
    assert packing.dimension == 2
    assert packing.grains.radius.tolist() == [0.5, 0.5, 1.0, 0.5]


def test_a_map_names_or_numbers_the_columns(tmp_path: Path) -> None:
    grains = "who,east,north,size,spare\n1,0,0,0.5,8\n2,1,0,0.5,8\n3,0,1,0.5,8\n"
    contacts = "1 2 -5 1.5\n1 3 -6 0.5\n"
    columns: dict = {
        "grains": {"id": "who", "x": "east", "y": "north", "radius": 4},
        "contacts": {"i": 1, "j": 2, "fn": 3, "ft": 4},
    }
    run = read(*written(tmp_path, g=grains, c=contacts), columns=columns)
    contacts = run.frames[0].packing.contacts
    assert contacts is not None
    # Most normal forces are negative, so negative is compression; t = (−n_y, n_x).
    np.testing.assert_allclose(contacts.force, [[5, 1.5], [-0.5, 6]])
    assert run.frames.summary.unknown_columns == ("spare",)  # type: ignore[union-attr]


def test_conventions_can_be_told(tmp_path: Path) -> None:
    paths = written(tmp_path, g=GRAINS, c=CONTACTS)
    told = read(*paths, columns={"conventions": {"force_on": "first"}}).frames[0].packing.contacts
    assert told is not None and told.force is not None
    np.testing.assert_array_equal(told.force[0], [-2, -0.5, 0])


@pytest.mark.parametrize("base", [0, 1])
def test_rows_are_counted_from_0_or_1(tmp_path: Path, base: int) -> None:
    """A chain of five and one far away, so that no number says which: lengths do."""
    grains = "x,y,r\n9,9,.5\n" + "".join(f"{k},0,0.5\n" for k in range(5)) + "9,5,.5\n"
    contacts = "i,j\n" + "".join(f"{k + base},{k + 1 + base}\n" for k in range(1, 5))
    packing = read(*written(tmp_path, g=grains, c=contacts)).frames[0].packing
    assert packing.contacts is not None
    assert packing.contacts.pair.tolist() == [[k, k + 1] for k in range(1, 5)]


def test_equal_volumes_give_radii(tmp_path: Path) -> None:
    text = f"label,centroid-0,centroid-1,centroid-2,area\n1,0,0,0,{4 / 3 * np.pi * 8}\n2,5,5,5,1\n"
    radius = read(*written(tmp_path, grains=text)).frames[0].packing.grains.radius
    np.testing.assert_allclose(radius, [2.0, (0.75 / np.pi) ** (1 / 3)])


def series(frames: int = 4) -> tuple[str, str]:
    """Squares of touching disks that grow by a hundredth a frame."""
    grains, contacts = ["frame,id,x,y,r\n"], ["frame,i,j,fn\n"]
    for frame in range(frames):
        side = 1 + 0.01 * frame
        corners = ((0, 0), (1, 0), (1, 1), (0, 1))
        for number in (range(4), reversed(range(4)))[frame % 2]:  # shuffled between frames
            x, y = corners[number]
            grains.append(f"{10 * frame},{number},{x * side!r},{y * side!r},{side / 2!r}\n")
        contacts += [f"{10 * frame},{k},{(k + 1) % 4},{k + frame + 1}\n" for k in range(4)]
    return "".join(grains), "".join(contacts)


def test_frames_follow_a_column(tmp_path: Path) -> None:
    run = read(*written(tmp_path, g=series()[0], c=series()[1]), strain=0.05)
    assert len(run.frames) == 4
    for index in (2, 0, 3, 1):
        frame = run.frames[index]
        assert frame.eps_q == pytest.approx(0.05 * index)
        side = 1 + 0.01 * index
        grains, contacts = frame.packing.grains, frame.packing.contacts
        assert grains.number is not None and contacts is not None and contacts.force is not None
        assert grains.number.tolist() == run.frames[0].packing.grains.number.tolist()  # type: ignore
        assert grains.position[2].tolist() == [side, side]
        force = np.linalg.norm(contacts.force, axis=1)
        np.testing.assert_allclose(force, np.arange(4) + index + 1)


def test_counts_are_of_frames_not_of_readings(tmp_path: Path) -> None:
    doubled = CONTACTS + "3,7,-2,0,0\n7,7,1,1,1\n"
    run = read(*written(tmp_path, g=GRAINS, c=doubled))
    for _ in range(3):
        assert run.frames[0].packing.contacts.count == 3  # type: ignore[union-attr]
    summary = run.frames.summary  # type: ignore[union-attr]
    assert (summary.frames_read, summary.duplicates_dropped) == (1, 1)
    assert summary.self_contacts_dropped == 1


@pytest.mark.parametrize(
    ("tables", "options", "error", "words"),
    [
        ({"g": "x,y\n0,0\n1,1\n"}, {"format": "csv"}, MissingData, "--radius"),
        ({"c": CONTACTS}, {}, MissingData, "without grains"),
        ({"g": GRAINS.replace("9,", "9.5,")}, {}, CorruptFile, "id of row 3 is 9.5"),
        ({"g": GRAINS.replace("0.5\n3", "0.5,1\n3")}, {}, CorruptFile, "line 2 has 6 columns"),
        ({"g": GRAINS.replace("1.02", "1o2")}, {}, CorruptFile, "line 5: '1o2'"),
        ({"g": GRAINS[:-1]}, {}, CorruptFile, "has no end"),
        ({"g": GRAINS, "c": CONTACTS.replace("7,5", "7,6")}, {}, CorruptFile, "body 6"),
        ({"g": "a,b,c\n1,2,3\n"}, {}, UnknownFormat, "no known format"),
        ({"g": GRAINS}, {"columns": {"grains": {"raduis": 5}}}, InvalidSettings, "radius"),
        ({"g": GRAINS}, {"columns": {"grains": {"radius": 6}}}, InvalidSettings, "columns 1..5"),
        ({"g": GRAINS}, {"columns": {"grains": {"x": "X"}}}, InvalidSettings, "'X' is not in"),
        ({"g": GRAINS}, {"columns": {"grain": {"x": 1}}}, InvalidSettings, "[grain]"),
        ({"g": "frame,x,y,r\n1,0,0,1\n2,0,0,1\n1,3,3,1\n"}, {}, CorruptFile, "second time"),
    ],
)  # fmt: skip
def test_bad_tables_are_told_in_one_line(
    tmp_path: Path, tables: dict, options: dict, error: type[GranufabError], words: str
) -> None:
    with pytest.raises(error) as told:
        _ = read(*written(tmp_path, **tables), **options).frames[0]
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_a_cut_series_gives_whole_frames_or_whole_lines(tmp_path: Path) -> None:
    """A cut within a line is seen; one between lines of the last frame looks like fewer grains."""
    grains, contacts = written(tmp_path, g=series()[0], c=series()[1])
    text = grains.read_text()
    whole = [frame.packing.grains for frame in read(grains).frames]  # type: ignore[union-attr]
    for cut in random.Random(3).choices(range(len(text)), k=200):
        grains.write_text(text[:cut])
        try:
            run = read(grains)
        except GranufabError as error:
            assert str(grains) in str(error)
            continue
        for index in range(len(run.frames)):
            got, right = run.frames[index].packing.grains, whole[index]
            assert got.number is not None and right.number is not None
            rows = {n: k for k, n in enumerate(right.number.tolist())}
            for number, position in zip(got.number.tolist(), got.position, strict=True):
                np.testing.assert_array_equal(position, right.position[rows[number]])
            last = index == len(run.frames) - 1
            assert got.count == 4 or (last and text[cut - 1] == "\n")
    assert contacts.exists()
