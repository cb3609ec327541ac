"""LMGC90 text files: BODIES.DAT (radii, reference positions), DOF.* (displacements), Vloc_Rloc.*.

Files are given together in any order, or as their folder: DOF.INI with Vloc_Rloc.INI, or the series
DOF.OUT.1, DOF.OUT.2, … A file may hold several states; states of bodies and of contacts belong
together by their step number. The normal points from the antagonist to the candidate, and the
force R_t t + R_n n (+ R_s s) acts on the candidate, R_n > 0 in compression; in 2D t = (n_y, −n_x).
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.readers.lmgc90_records import (
    Bodies,
    Table,
    body_starts,
    read_bodies,
    read_text,
)
from granufab.io.text_rows import number_fault
from granufab.packing import Array, IntArray

__all__ = ["FORMAT", "NO_CELL", "points_apart"]

NO_CELL = "the cell is not in LMGC90's files; give --cell (and --periodic) where there is one"
_STEP = re.compile(rb"\$steps\s+(\d{1,18})\s+time=\s*(\S+)")
_PAIR = re.compile(
    r"\$icdan[ \t]+(\w{5})[ \t]+(\d{1,15})\b[^\n]*\n[^\n]*\n[ \t]*(\w{5})[ \t]+(\d{1,15})"
    r"(?:[ \t]+\w{5}[ \t]+\d+)+?[ \t]+\S+[ \t]+(\w{5})[ \t]+(\d{1,15})[ \t]+\w{5}[ \t]"
)


@dataclass(frozen=True, slots=True)
class _State:
    """Where one state lies in a file."""

    path: Path
    step: int
    time: float
    start: int
    end: int


def _kind(head: bytes) -> str | None:
    """What a file is: "bodies", "dof", "contacts", another part of LMGC90's input, or None."""
    if b"$bdyty" in head and b"$blmty" in head:
        return "bodies"
    words = head[:200].split()
    if words[:1] == [b"!"] and words[1:2] in ([b"DOF"], [b"Vloc_Rloc"]):
        if b"$steps" in head[:400]:
            return "dof" if words[1] == b"DOF" else "contacts"
        return "driven" if b"$dofty" in head else None
    return None


def _matches(path: Path, head: bytes) -> bool:
    if path.is_dir():
        return (path / "BODIES.DAT").is_file() or (path / "BODIES.OUT").is_file()
    return _kind(head) is not None


def _states(path: Path) -> list[_State]:
    """The states of a file, by their ``$steps`` lines."""
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as text:
        found = [(one.start(), int(one[1]), one[2]) for one in _STEP.finditer(text)]
        size = len(text)
    if not found:
        raise CorruptFile(f"{path}: no line '$steps … time= …' can be read in {size} bytes")
    ends = [start for start, _, _ in found[1:]] + [size]
    states = []
    for (start, step, word), end in zip(found, ends, strict=True):
        text = word.decode("utf-8", "replace").replace("D", "E")
        if fault := number_fault(text):
            raise CorruptFile(f"{path}: step {step}: time: {fault}")
        states.append(_State(path, step, float(text), start, end))
    return states


def _moved(bodies: Bodies, state: _State) -> tuple[Array, Array, Array]:
    """Displacements, velocities and spins of all bodies."""
    dimension, place = bodies.dimension, f"{state.path}: step {state.step}"
    text = read_text(state.path, state.start, state.end)
    records = body_starts(text)
    table = Table(text, [start for start, _, _ in records], place)
    listed = np.array([number for _, size, number in records if size == dimension], np.int64)
    order = np.argsort(listed, kind="stable")
    back = np.argsort(np.argsort(bodies.number))
    if not np.array_equal(listed[order], np.sort(bodies.number)) or len(listed) != len(records):
        raise CorruptFile(
            f"{place}: has {len(records)} bodies, not the {len(bodies.number)} of BODIES.DAT"
        )
    rows = order[back]
    move = table.get(*(f"X({k})" for k in range(1, dimension + 1)))[rows]
    velocity = table.get(*(f"V({k})" for k in range(1, dimension + (2 if dimension == 2 else 4))))
    return move, velocity[rows, :dimension], velocity[rows, dimension:]


def _contacts(state: _State, bodies: Bodies) -> FoundContacts:
    """The candidates of a state, force-bearing or not."""
    dimension = bodies.dimension
    text = read_text(state.path, state.start, state.end)
    place = f"{state.path}: step {state.step}"
    starts = [one.start() for one in re.finditer(r"\$icdan", text)]
    records = list(_PAIR.finditer(text))
    if [one.start() for one in records] != starts:
        unread = next(k for k in range(len(starts))
                      if k >= len(records) or records[k].start() != starts[k])  # fmt: skip
        words = " ".join(text[starts[unread] :][:60].split(maxsplit=3)[:3])
        raise CorruptFile(f"{place}, {words}: the pair of bodies cannot be read")
    _check_numbers(records, place)
    table = Table(text, starts, place)
    normal = table.get(*(f"n({k})" for k in range(1, dimension + 1)))
    pairs = np.array([(int(one[4]), int(one[6])) for one in records], np.int64).reshape(-1, 2)
    rigid = [one[3].startswith("RBDY") and one[5].startswith("RBDY") for one in records]
    return FoundContacts(
        place=place,
        first=pairs[:, 0],
        second=pairs[:, 1],
        wall=~np.array(rigid, bool),
        normal=normal,
        point=table.get(*(f"coo{k}" for k in range(1, dimension + 1))),
        gap=table.get("gapTT")[:, 0],
        force=_forces(table, normal),
        force_on="first",
        normal_to="first",
        part=None if bodies.round else points_apart(len(pairs)),
    )


def points_apart(count: int) -> IntArray:
    """Every row another point of contact: polygons and polyhedra touch in several."""
    return np.repeat(np.arange(count)[:, None], 2, axis=1)


def _check_numbers(records: list[re.Match[str]], place: str) -> None:
    """Contacts of each kind are numbered from 1 in any order; a gap means that some are lost."""
    numbered: dict[str, list[int]] = {}
    for one in records:
        numbered.setdefault(one[1], []).append(int(one[2]))
    for kind, numbers in numbered.items():
        if sorted(numbers) != list(range(1, len(numbers) + 1)):
            raise CorruptFile(
                f"{place}: the {len(numbers)} contacts {kind} are not numbered "
                f"1..{len(numbers)}, is the file cut?"
            )


def _forces(table: Table, normal: Array) -> Array:
    """Forces on the candidates."""
    tangent, along, across = table.get("rlt/H", "rln/H", "rls/H").T[:, :, None]
    if normal.shape[1] == 2:
        return along * normal + tangent * np.column_stack([normal[:, 1], -normal[:, 0]])
    t, s = (table.get(*(f"{axis}({k})" for k in (1, 2, 3))) for axis in "ts")
    return along * normal + tangent * t + across * s


def _frame(bodies: Bodies, dof: _State | None, contacts: _State | None, place: str) -> FoundFrame:
    position, velocity, spin = bodies.position, None, None
    if dof is not None:
        move, velocity, spin = _moved(bodies, dof)
        position = position + move
    state = dof or contacts
    return FoundFrame(
        place=place if state is None else f"{state.path}: step {state.step}",
        position=position,
        radius=bodies.radius,
        number=bodies.number,
        wall=bodies.wall,
        velocity=velocity,
        spin=spin,
        dimension=bodies.dimension,
        contacts=None if contacts is None else _contacts(contacts, bodies),
        round=bodies.round,
        time=None if state is None else state.time,
        step=None if state is None else state.step,
    )


def _listed(paths: Sequence[Path]) -> dict[str, list[Path]]:
    """Files by kind, folders opened."""
    files: list[Path] = []
    for path in paths:
        files += sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    kinds: dict[str, list[Path]] = {"bodies": [], "dof": [], "contacts": []}
    for path in files:
        with path.open("rb") as stream:
            kind = _kind(stream.read(4096))
        if kind in kinds:
            kinds[kind].append(path)
        elif kind is None and path in paths:
            raise CorruptFile(f"{path}: line 1 begins no BODIES, DOF or Vloc_Rloc file of LMGC90")
    return kinds


def _paired(
    dof: list[_State], contacts: list[_State]
) -> tuple[list[tuple[_State | None, _State | None]], list[str]]:
    """States that belong together, in the order of their steps, and what to say about others."""
    if not dof or not contacts:
        return [(state if dof else None, None if dof else state) for state in dof or contacts], []
    by_step = {state.step: state for state in contacts}
    pairs = [(state, by_step[state.step]) for state in dof if state.step in by_step]
    if not pairs:
        raise CorruptFile(
            f"{dof[0].path}: has step {dof[0].step}, {contacts[0].path} has step "
            f"{contacts[0].step}: they are not of one state"
        )
    alone = len(dof) + len(contacts) - 2 * len(pairs)
    notes = [f"{alone} states have no partner of the same step and are left out"] if alone else []
    return [*pairs], notes


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    kinds = _listed(paths)
    if len(kinds["bodies"]) != 1:
        raise MissingData(
            f"{paths[0]}: one BODIES.DAT is needed for radii and reference positions, got "
            f"{len(kinds['bodies'])}"
        )
    notes = [NO_CELL]
    states = {
        kind: sorted((s for path in kinds[kind] for s in _states(path)), key=lambda s: s.step)
        for kind in ("dof", "contacts")
    }
    if not states["dof"]:
        notes.append("no DOF file given: bodies are at their reference positions")
    bodies = read_bodies(kinds["bodies"][0])
    pairs, more = _paired(states["dof"], states["contacts"])
    place = str(kinds["bodies"][0])
    pairs = pairs or [(None, None)]
    if len(pairs) > 1 and _is_cut(bodies, *pairs[-1]):
        pairs, more = pairs[:-1], [*more, "the last state is cut and left out"]
    return LazyFrames(
        count=len(pairs),
        parse=lambda index: _frame(bodies, *pairs[index], place),
        notes=(*notes, *more),
    )


def _is_cut(bodies: Bodies, dof: _State | None, contacts: _State | None) -> bool:
    """Whether the last state ends too early."""
    try:
        _frame(bodies, dof, contacts, "")
    except CorruptFile:
        return True
    return False


FORMAT = ForeignFormat(
    key="lmgc90", name="LMGC90 text (BODIES, DOF, Vloc_Rloc)", matches=_matches, open=_open
)
"""Text files of LMGC90."""
