"""A damaged frame among others: the default stops there, ``skip_damaged`` reads the rest."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample

import granufab
from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.fabric import balance_run, measure_run
from granufab.history import Frame, Run
from granufab.io.foreign_run import foreign_run
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames
from granufab.io.read_options import ReadOptions


class Counting:
    """A source of three touching disks a frame, which shear; counts how often it is parsed."""

    def __init__(self, frames: int, broken: tuple[int, ...] = (), empty: tuple[int, ...] = ()):
        self.parsed: list[int] = []
        self.count, self.broken, self.empty = frames, broken, empty
        self.deforms = False

    def parse(self, index: int) -> FoundFrame:
        self.parsed.append(index)
        if index in self.broken:
            raise CorruptFile(f"made.txt: frame {index}: is broken")
        count = 0 if index in self.empty else 3
        place = np.array([[0.0, 0], [1, 0], [0.5, 0.75]])[:count]
        height = 10.0 - (0.1 * index if self.deforms else 0)
        return FoundFrame(
            place=f"made.txt: frame {index}",
            position=place,
            radius=np.full(count, 0.5),
            dimension=2,
            cell=FoundCell(
                matrix=np.diag([10.0, height]), origin=np.zeros(2), periodic=(True, True)
            ),
            contacts=FoundContacts(
                first=np.array([0, 0][:count]), second=np.array([1, 2][:count]),
                normal_force=np.ones(min(2, count)), tangential_size=np.zeros(min(2, count)),
            ),
        )  # fmt: skip

    def open(self, **options: object) -> Run:
        self.parsed.clear()
        source = LazyFrames(count=self.count, parse=self.parse)
        return foreign_run("made", [Path("made.txt")], source, ReadOptions(**options))  # type: ignore[arg-type]


def _numbers(run: Run) -> list[int]:
    """The frames that a loop gives, by what their places say."""
    return [int(frame.packing.source.split()[-1]) for frame in run.frames]


def test_the_default_stops_and_names_the_option() -> None:
    run = Counting(5, broken=(2,)).open()
    assert len(run.frames) == 5
    with pytest.raises(CorruptFile, match=r"frame 2: is broken; skip_damaged \(--skip-damaged\)"):
        measure_run(run)
    assert [f.packing.source[-1] for f in (run.frames[1], run.frames[4])] == ["1", "4"]
    with pytest.raises(CorruptFile, match=r"is broken; skip_damaged"):
        Counting(5, broken=(0,)).open()
    with pytest.raises(CorruptFile, match=r"frame 0: is broken$"):
        Counting(1, broken=(0,)).open()  # nothing else to read


@pytest.mark.parametrize("broken", [(2,), (0,), (4,), (0, 1, 4), (1, 3), ()])
def test_skipping_leaves_the_others(broken: tuple[int, ...]) -> None:
    source = Counting(5, broken=broken)
    run = source.open(skip_damaged=True)
    kept = [k for k in range(5) if k not in broken]
    assert _numbers(run) == kept
    frames = run.frames
    assert (len(frames), frames.numbers) == (len(kept), tuple(kept))  # type: ignore[union-attr]
    assert frames[-1].packing.source.endswith(str(kept[-1]))
    assert [f.packing.source[-1] for f in frames[1:]] == [str(k) for k in kept[1:]]  # type: ignore[index]
    with pytest.raises(IndexError):
        _ = frames[len(kept)]
    summary = frames.summary  # type: ignore[union-attr]
    assert [one["frame"] for one in summary.skipped_frames] == list(broken)
    assert all(one["reason"].endswith("is broken") for one in summary.skipped_frames)
    assert summary.frames_read == len(kept)
    text = "\n".join(summary.lines())
    assert (f"warning: {len(broken)} damaged frames skipped" in text) == bool(broken)


def test_a_loop_reads_each_frame_once() -> None:
    source = Counting(6, broken=(0, 3))
    run = source.open(skip_damaged=True, strain=0.01)
    _numbers(run)
    # The first frame twice, where the beginning looks for empty frames and finds a broken one.
    assert source.parsed == [0, 0, 1, 2, 3, 4, 5]
    run = Counting(6, broken=(3,)).open(skip_damaged=True, strain=0.01)
    table = measure_run(run)
    assert table.sizes["frame"] == 5
    source = Counting(6, broken=(3,))
    run = source.open(skip_damaged=True, strain=0.01)
    balance = balance_run(run)
    assert balance.sizes["interval"] == 4
    assert source.parsed == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("deforms", [False, True])
def test_strain_knows_the_gap(deforms: bool) -> None:
    """The strain of the frames that are left is the one that they have in the whole series."""
    source = Counting(6)
    source.deforms = deforms
    given = {} if deforms else {"strain": 0.02}
    whole = [frame.eps_q for frame in source.open(**given).frames]
    source.broken = (2, 3)
    left = [frame.eps_q for frame in source.open(skip_damaged=True, **given).frames]
    assert left == [whole[k] for k in (0, 1, 4, 5)]
    assert np.ptp(whole) > 0.04
    source.broken = ()
    part = [frame.eps_q for frame in source.open(frames="2:5", **given).frames]
    assert part[0] == 0.0
    assert part[-1] == pytest.approx(whole[4] - whole[2], rel=1e-12)


def test_all_damaged_is_an_error() -> None:
    with pytest.raises(CorruptFile, match=r"all 3 frames are damaged; the first: made.txt: frame"):
        Counting(3, broken=(0, 1, 2)).open(skip_damaged=True)


def test_empty_frames_among_others_count_as_damaged() -> None:
    source = Counting(5, empty=(0, 1, 3))
    with pytest.raises(MissingData, match="no grains; skip_damaged"):
        _numbers(source.open())
    run = source.open(skip_damaged=True)
    assert _numbers(run) == [2, 4]
    assert run.frames.numbers == (0, 2)  # type: ignore[union-attr]
    assert run.frames.summary.empty_frames == 2  # type: ignore[union-attr]


def test_what_all_frames_lack_is_no_damage(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("frame,x,y\n0,1,1\n1,1,1\n")
    with pytest.raises(MissingData, match=r"give --radius$"):
        granufab.read(table, skip_damaged=True, format="csv")


@pytest.mark.parametrize(
    ("frames", "wanted"),
    [("2:", [2, 3, 4, 5]), (":2", [0, 1]), ("-2:", [4, 5]), ("1:6:2", [1, 3, 5]), ("4:99", [4, 5])],
)
def test_a_part_of_the_series(frames: str, wanted: list[int]) -> None:
    for skip in (False, True):
        run = Counting(6).open(frames=frames, skip_damaged=skip)
        assert _numbers(run) == wanted
        assert run.frames.numbers == tuple(wanted)  # type: ignore[union-attr]
    if frames == "2:":
        assert _numbers(Counting(6, broken=(0, 3)).open(frames=frames, skip_damaged=True)) == [
            2, 4, 5,
        ]  # fmt: skip


@pytest.mark.parametrize("frames", ["3", "1:2:3:4", "a:b", "::-1", "::0", ""])
def test_no_part_is_refused(frames: str) -> None:
    with pytest.raises(InvalidSettings, match="allowed: A:B"):
        Counting(6).open(frames=frames)


def test_a_part_that_is_not_there() -> None:
    with pytest.raises(InvalidSettings, match=r"made\.txt holds frames 0\.\.5"):
        Counting(6).open(frames="8:9")


def _table(folder: Path) -> list[Path]:
    rows = [f"{frame},{k},{k},{0.1 * frame},0.5" for frame in range(4) for k in range(3)]
    rows[4] = rows[4].replace("0.1", "O.l")
    (folder / "a.csv").write_text("frame,id,x,y,r\n" + "\n".join(rows) + "\n")
    return [folder / "a.csv"]


def _xyz(folder: Path) -> list[Path]:
    text = ""
    for frame in range(4):
        text += f"3\nProperties=species:S:1:pos:R:3:radius:R:1 Time={frame}\n"
        text += "".join(f"X {k} {0.1 * frame} 0 {'0.5' if frame != 1 else 'half'}\n"
                        for k in range(3))  # fmt: skip
    (folder / "a.xyz").write_text(text)
    return [folder / "a.xyz"]


def _dump(folder: Path) -> list[Path]:
    text = ""
    for frame in range(4):
        text += f"ITEM: TIMESTEP\n{frame}\nITEM: NUMBER OF ATOMS\n3\n"
        text += "ITEM: BOX BOUNDS pp pp pp\n" + "0 9\n" * 3 + "ITEM: ATOMS id x y z radius\n"
        text += "".join(f"{k} {k} {0.1 * frame} {k % 2 if frame != 1 else '?'} 0.5\n"
                        for k in range(3))  # fmt: skip
    (folder / "a.dump").write_text(text)
    return [folder / "a.dump"]


def _vtk(folder: Path) -> list[Path]:
    for frame in range(4):
        (folder / f"a{frame}.vtk").write_text(
            "# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n"
            f"0 0 0 1 {0.1 * frame} 1 2 0 1\nPOINT_DATA {3 if frame != 1 else 4}\n"
            "SCALARS radius double 1\nLOOKUP_TABLE default\n0.5 0.5 0.5\n"
        )
    return sorted(folder.glob("*.vtk"))


def _mercury(folder: Path) -> list[Path]:
    text = ""
    for frame in range(4):
        text += f"3 {frame} 0 0 0 9 9 9\n"
        text += "".join(f"{k} {0.1 * frame} {k % 2} 0 0 0 {0.5 if frame != 1 else 'r'} 0 0 0 0 0 0 "
                        "0\n" for k in range(3))  # fmt: skip
    (folder / "a.data").write_text(text)
    return [folder / "a.data"]


@pytest.mark.parametrize("made", [_table, _xyz, _dump, _vtk, _mercury])
def test_every_format_follows_the_rule(tmp_path: Path, made: Callable[[Path], list[Path]]) -> None:
    files = made(tmp_path)
    run = granufab.read(*files)
    assert run.frames[3].packing.grains.count == 3
    with pytest.raises(CorruptFile, match=r"a.*skip_damaged \(--skip-damaged\) reads the other"):
        list(run.frames)
    run = granufab.read(*files, skip_damaged=True)
    heights = [frame.packing.grains.position[1, 1] for frame in run.frames]
    assert heights == pytest.approx([0, 0.2, 0.3])
    skipped = run.frames.summary.skipped_frames  # type: ignore[union-attr]
    assert [one["frame"] for one in skipped] == [1]
    assert files[0].stem[0] in skipped[0]["reason"]


@pytest.mark.parametrize("count", ["x", "4", "2", "999999", ""])
def test_a_lost_beginning_in_xyz(tmp_path: Path, count: str) -> None:
    """The count of rows of frame 1 is damaged; later frames are found by their comments."""
    (path,) = _xyz(tmp_path)
    lines = path.read_text().replace("half", "0.5").split("\n")
    assert lines[5] == "3"
    lines[5] = count
    path.write_text("\n".join(lines))
    assert granufab.read(path).frames[0].packing.grains.count == 3
    with pytest.raises(CorruptFile, match=r"a\.xyz: .*skip_damaged"):
        list(granufab.read(path).frames)
    run = granufab.read(path, skip_damaged=True, strain=0.1)
    lost = [1, 2] if count == "4" else [1]  # a row too many is the next frame's beginning
    kept = [k for k in range(4) if k not in lost]
    assert [frame.packing.time for frame in run.frames] == kept
    assert [frame.eps_q for frame in run.frames] == pytest.approx([0.1 * k for k in kept])
    summary = run.frames.summary  # type: ignore[union-attr]
    assert [one["frame"] for one in summary.skipped_frames] == lost


def test_the_photoelastic_sample() -> None:
    run = granufab.read(sample("rigidlib", "DataAnnulus_1"), skip_damaged=True)
    frames: list[Frame] = list(run.frames)
    assert [frame.packing.grains.count for frame in frames] == [1783]
    skipped = run.frames.summary.skipped_frames  # type: ignore[union-attr]
    assert [one["frame"] for one in skipped] == [1]
    assert "no particle 1779" in skipped[0]["reason"]
