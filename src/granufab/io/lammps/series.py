"""Atom dumps and local dumps of one simulation as a series of frames, matched by time step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from granufab.errors import MissingData
from granufab.io.found import FoundFrame, LazyFrames, Source
from granufab.io.lammps.box import bounds_cell
from granufab.io.lammps.columns import Columns
from granufab.io.lammps.contacts import contact_columns, parse_contacts, unnamed
from granufab.io.lammps.dump_index import DumpFrame, index_dump
from granufab.io.lammps.grains import grain_columns, parse_grains
from granufab.io.lammps.recognise import recognised, told
from granufab.io.lammps.walls import apart, with_walls
from granufab.io.read_options import ReadOptions
from granufab.packing import Array

__all__ = ["open_dumps"]

_BY_GAP = "contacts are found by gap: no local dump is given"


@dataclass(frozen=True, slots=True)
class _Pair:
    """The rows of grains and of contacts of one step."""

    grains: DumpFrame
    contacts: DumpFrame | None


def open_dumps(paths: Sequence[Path], options: ReadOptions) -> Source:
    """Index all files and match their frames.

    Raises:
        CorruptFile: a file has no complete frame.
        MissingData: contacts come without their grains, or nothing says which columns hold them.
    """
    notes: list[str] = []
    grains, contacts = _indexed(paths, notes)
    if not grains:
        raise MissingData(
            f"{paths[0]}: contacts without their grains; give the atom dump of the same steps too"
        )
    contacts, walls = apart(contacts, options) if contacts else ([], [])
    frames = _matched(grains, contacts, notes)
    beside = [dict(_numbered(_joined([file], notes))) for file in walls]
    if walls and not contacts:
        notes.append(f"{walls[0][0].path}: contacts with walls, left out")
    unknown = list(grain_columns(frames[-1].grains, options).unknown)
    known: dict[tuple[str, ...], Columns] = {}
    if contacts:
        names, columns = _contact_columns(frames, options, notes)
        known[names] = columns
        unknown += columns.unknown
    else:
        notes.append(_BY_GAP)

    keys = [key for key, _ in _numbered([pair.grains for pair in frames])]
    turned = _turned([pair.grains for pair in frames])

    def parse(index: int) -> FoundFrame:
        listed, contacts = frames[index].contacts, None
        if listed is not None:
            columns = known.get(listed.columns) or contact_columns(listed, options)
            contacts = parse_contacts(listed, columns)
            key = keys[index]
            contacts = with_walls(contacts, [file[key] for file in beside if key in file])
        found = parse_grains(frames[index].grains, options, contacts)
        if found.cell is None or index not in turned:
            return found
        cell = replace(found.cell, followed=found.cell.matrix @ turned[index])
        return replace(found, cell=cell)

    return LazyFrames(count=len(frames), parse=parse, unknown=unknown, notes=notes)


def _indexed(
    paths: Sequence[Path], notes: list[str]
) -> tuple[list[list[DumpFrame]], list[list[DumpFrame]]]:
    """Frames of grains and of contacts, file by file."""
    grains: list[list[DumpFrame]] = []
    contacts: list[list[DumpFrame]] = []
    for path in paths:
        index = index_dump(path)
        if index.cut:
            notes.append(f"{path}: left out at the end: {index.cut}")
        kind = grains if index.frames[0].label == "ATOMS" else contacts
        kind.append(list(index.frames))
    return grains, contacts


def _matched(
    grains: list[list[DumpFrame]], contacts: list[list[DumpFrame]], notes: list[str]
) -> list[_Pair]:
    """Frames with grains, in the order of the steps, beside the contacts of the same step."""
    frames = _without_gaps(_joined(grains, notes), notes)
    if not contacts:
        return [_Pair(frame, None) for frame in frames]
    listed = dict(_numbered(_joined(contacts, notes)))
    pairs = [_Pair(frame, listed[key]) for key, frame in _numbered(frames) if key in listed]
    if not pairs:
        raise MissingData(
            f"{grains[0][0].path} has the steps {_steps(frames)}, but {contacts[0][0].path} has "
            f"{_steps([*listed.values()])}: no step is in both"
        )
    alone = len(frames) - len(pairs), len(listed) - len(pairs)
    if any(alone):
        notes.append(
            f"left out: {alone[0]} frames of grains without contacts, {alone[1]} frames of "
            "contacts without grains"
        )
    return pairs


def _joined(files: list[list[DumpFrame]], notes: list[str]) -> list[DumpFrame]:
    """The frames of several files, sorted by step; of a step that two have, the later file's."""
    if len(files) == 1:
        return files[0]
    by_step = {frame.step: frame for frames in files for frame in frames}
    twice = sum(len(frames) for frames in files) - len(by_step)
    if twice:
        notes.append(f"{twice} frames are in several files; those of the later file are read")
    return [by_step[step] for step in sorted(by_step)]


def _without_gaps(frames: list[DumpFrame], notes: list[str]) -> list[DumpFrame]:
    """Without the empty frames that come after others; those at the beginning are counted."""
    begun = next((k for k, frame in enumerate(frames) if frame.count), len(frames))
    kept = frames[:begun] + [frame for frame in frames[begun:] if frame.count]
    if len(kept) < len(frames):
        notes.append(f"left out: {len(frames) - len(kept)} empty frames among the others")
    return kept


def _numbered(frames: Sequence[DumpFrame]) -> list[tuple[tuple[int, int], DumpFrame]]:
    """Frames by step, and by how often the step was there before (runs that begin again at 0)."""
    seen: Counter[int] = Counter()
    keys = []
    for frame in frames:
        keys.append(((frame.step, seen[frame.step]), frame))
        seen[frame.step] += 1
    return keys


def _steps(frames: Sequence[DumpFrame]) -> str:
    return f"{frames[0].step}..{frames[-1].step}"


def _turned(frames: Sequence[DumpFrame]) -> dict[int, Array]:
    """What brings a flipped box back to the one that followed the deformation.

    LAMMPS flips a box that is tilted by more than half an edge to an equivalent one. Between two
    frames the lattice is the same up to whole numbers N of vectors, H = H' N; of those the box
    nearest to the frame before is taken, so frames must be closer than a shear strain of 1/2.

    Returns:
        N of the frames that need one, shape (3, 3) each.
    """
    turned: dict[int, Array] = {}
    before: Array | None = None
    for index, frame in enumerate(frames):
        if not {"xy", "abc"} & set(frame.bounds):
            return turned
        matrix = bounds_cell(frame.bounds, frame.box, frame.place, "xyz").matrix
        if before is not None:
            whole = np.rint(np.linalg.solve(matrix, before))
            if abs(abs(np.linalg.det(whole)) - 1) < 0.5 and (whole != np.eye(3)).any():
                turned[index] = whole
        before = matrix @ turned.get(index, np.eye(3))
    return turned


def _contact_columns(
    frames: list[_Pair], options: ReadOptions, notes: list[str]
) -> tuple[tuple[str, ...], Columns]:
    """Names and places of the contacts' columns: told, named, or recognised beside the grains."""
    pairs = [(pair.grains, pair.contacts) for pair in frames if pair.contacts is not None]
    fullest = max(pairs[:: max(1, len(pairs) // 8)], key=lambda pair: pair[1].count)
    grains, listed = fullest
    columns = contact_columns(listed, options)
    if options.columns.get("contacts") or columns.has("i", "j", "fx", "fy"):
        return listed.columns, columns
    if listed.count == 0:
        return listed.columns, columns
    better = recognised(listed, columns, parse_grains(grains, options, None))
    if better is not None:
        notes.append(told(better, listed.columns))
        return listed.columns, better
    if not columns.has("i", "j"):
        raise unnamed(listed)
    return listed.columns, columns
