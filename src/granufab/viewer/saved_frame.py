"""One frame for a saved page: every pair once, in small whole numbers, with all its criteria.

What the page makes of it is :func:`~granufab.viewer.frame_data.frame_buffer` under each criterion,
within the steps that the header holds (docs/viewer.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import MissingData
from granufab.fabric.criterion import Criterion, counted_pairs, mean_diameter
from granufab.history import Frame
from granufab.packing import Contacts, Packing
from granufab.viewer.buffer import pack
from granufab.viewer.frame_data import frame_buffer, mean_normal_force, unpack
from granufab.viewer.quantise import differences, on_grid, packed_bits, smallest, steps_of
from granufab.viewer.saved_rules import LEVELS, Rule

__all__ = ["SavedFrame", "saved_changes", "saved_frame"]

Arrays = dict[str, NDArray]
_OF_CHOICE = (
    *("criterion", "z_definition", "contact_count", "mean_normal_force", "changes", "missing"),
    *("run", "frame"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedFrame:
    """A frame in parts.

    Attributes:
        header: what :func:`~granufab.viewer.buffer.pack` takes, without its arrays.
        arrays: that change from frame to frame.
        grains: radius and number, which seldom do.
    """

    header: dict[str, Any]
    arrays: Arrays
    grains: Arrays

    def grain_block(self) -> bytes:
        """The bytes of radius and number."""
        return pack({}, self.grains)

    def block(self, grains: str) -> bytes:
        """The bytes of the rest, with the name of the grains' block in the header."""
        return pack({**self.header, "grains": grains}, self.arrays)


def saved_frame(frame: Frame, rules: Sequence[Rule]) -> SavedFrame:
    """A frame with every pair that one of the criteria counts.

    Args:
        frame: the state.
        rules: the run's own criterion first.
    Returns:
        Header: as of :func:`~granufab.viewer.frame_data.frame_buffer` but for the entries of one
        criterion, which ``criteria`` holds for each; ``steps`` and ``position_low``; ``quantised``:
        the steps in the page's units. Arrays: position, velocity, spin; held (bits by criterion),
        touched; by list of pairs first (differences), second, image, gap, force, own (bits),
        force_levels and gap_levels: how many levels count the pair; wall_*.
    """
    packing = frame.packing
    header, drawn = unpack(frame_buffer(frame, rules[0].choice))
    words = {name: value for name, value in header.items() if name not in _OF_CHOICE}
    arrays, steps, low = _grains(words, drawn)
    counted = [_counted(packing, rule) for rule in rules]
    words["criteria"] = [one.words for one in counted]
    count, diameter = packing.grains.count, mean_diameter(packing)
    arrays["held"] = packed_bits(np.array([one.held for one in counted]))
    arrays["touched"] = packed_bits(counted[0].touched)
    for name in sorted({rule.pairs for rule in rules}):
        mine = [k for k, rule in enumerate(rules) if rule.pairs == name]
        pairs = _pairs(frame, [rules[k] for k in mine], name)
        if pairs is None:
            continue
        found, more = _list_arrays(pairs, count, name)
        masks = {
            k: counted_pairs(pairs.contacts, rules[k].choice.criterion, diameter)
            for k in mine
            if counted[k].known
        }
        arrays |= found | _levels(name, rules, masks)
        steps |= more
    mean = words["criteria"][0]["mean_normal_force"].get(rules[0].choice.z_definition)
    quantised = {"position": steps["position"], **steps}
    quantised["force"] = steps["force"] / mean if mean and "force" in steps else None
    words |= {"steps": steps, "position_low": low, "quantised": quantised}
    mine = ("radius", "number")
    walls = _walls(packing)
    return SavedFrame(
        header=words, arrays=arrays | walls, grains={name: drawn[name] for name in mine}
    )


def saved_changes(
    frame: Frame, rule: Rule, before: Frame | None, interval: dict[str, Any]
) -> bytes:
    """Contacts gained and lost since a frame before, under the run's own criterion.

    Args:
        frame: the state.
        rule: the run's own.
        before: the saved frame before it.
        interval: of the same two frames, which the block holds too.
    """
    header, drawn = unpack(frame_buffer(frame, rule.choice, before=before))
    arrays: Arrays = {}
    if "gained" in drawn:
        pair = drawn["lost_pair"].astype(np.int64)
        arrays["gained"] = packed_bits(drawn["gained"])
        arrays["lost_pair"] = drawn["lost_pair"]
        arrays["lost_image"] = _lost_image(header, drawn, pair)
    return pack({"changes": header["changes"], "interval": interval}, arrays)


def _lost_image(header: dict[str, Any], drawn: Arrays, pair: NDArray) -> NDArray[np.int8]:
    """Lattice vectors from the wrapped j to its image at the end of the branch."""
    if header["cell"] is None:
        return np.zeros(drawn["lost_branch"].shape, dtype=np.int8)
    position = drawn["position"].astype(np.float64)
    shift = drawn["lost_branch"] - (position[pair[:, 1]] - position[pair[:, 0]])
    return np.rint(shift @ np.linalg.inv(header["cell"]["vectors"])).astype(np.int8)


def _grains(words: dict[str, Any], drawn: Arrays) -> tuple[Arrays, dict[str, Any], NDArray]:
    """Positions, velocities and spins in steps, and the corner that positions count from."""
    position = drawn["position"].astype(np.float64)
    low = np.minimum(words["low"], position.min(axis=0))
    high = np.maximum(words["high"], position.max(axis=0))
    arrays: Arrays = {}
    steps: dict[str, Any] = {}
    arrays["position"], steps["position"] = on_grid(position, low, high)
    for name in ("velocity", "spin"):
        if name in drawn:
            arrays[name], steps[name] = steps_of(drawn[name])
    return arrays, steps, low


@dataclass(frozen=True, slots=True, kw_only=True)
class _Counted:
    words: dict[str, Any]
    held: NDArray[np.bool_]
    touched: NDArray[np.bool_]
    known: bool


def _counted(packing: Packing, rule: Rule) -> _Counted:
    """What a criterion makes of the grains, and its entry in the header."""
    nothing = np.zeros(packing.grains.count, dtype=bool)
    words: dict[str, Any] = {
        "criterion": rule.choice.criterion.text, "kind": rule.kind, "list": rule.pairs,
        "level": rule.level, "levels": LEVELS, "threshold": rule.threshold,
        "definitions": rule.definitions, "contact_count": 0, "mean_normal_force": {},
        "missing": None,
    }  # fmt: skip
    try:
        networks = {name: rule.under(name).network(packing) for name in rule.definitions}
    except MissingData as error:
        return _Counted(
            words={**words, "missing": str(error)}, held=nothing, touched=nothing, known=False
        )
    first = networks[rule.definitions[0]]
    words["contact_count"] = first.contact_count
    words["mean_normal_force"] = {
        name: mean_normal_force(network.contacts) for name, network in networks.items()
    }
    numbers = first.coordination
    return _Counted(words=words, held=numbers.held, touched=numbers.touched, known=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pairs:
    contacts: Contacts
    image: NDArray


def _pairs(frame: Frame, rules: Sequence[Rule], name: str) -> _Pairs | None:
    """The pairs of a list: all that the data hold, or those within the widest gap."""
    choice = rules[0].choice
    if name == "listed":
        choice = replace(choice, criterion=Criterion("listed"))
    else:
        widest = max(rule.choice.criterion.gap for rule in rules)
        choice = replace(choice, criterion=Criterion("gap", widest), reach=None)
    try:
        contacts = choice.contacts(frame.packing)
    except MissingData:
        return None
    _, drawn = unpack(frame_buffer(frame, choice))
    return _Pairs(contacts=contacts, image=drawn["image"])


def _list_arrays(pairs: _Pairs, count: int, name: str) -> tuple[Arrays, dict[str, float]]:
    contacts = pairs.contacts
    first, second = (smallest(column, count) for column in contacts.pair.T)
    arrays: Arrays = {
        f"{name}_first": differences(first),
        f"{name}_second": second,
        f"{name}_image": pairs.image.astype(np.int8),
    }
    steps: dict[str, float] = {}
    if contacts.gap is not None:
        arrays[f"{name}_gap"], steps[f"{name}_gap"] = steps_of(contacts.gap)
    if contacts.force is not None:
        arrays[f"{name}_force"], steps["force"] = steps_of(contacts.force)
    return arrays, steps


def _levels(name: str, rules: Sequence[Rule], masks: dict[int, NDArray[np.bool_]]) -> Arrays:
    """Whether the run's own criterion counts a pair, and how many levels of each slider do.

    Levels only add or only remove pairs as they rise, so the number tells which of them count it.
    """
    arrays: Arrays = {}
    for kind in ("own", "force", "gap"):
        mine = [mask for k, mask in masks.items() if rules[k].kind == kind]
        if not mine:
            continue
        if kind == "own":
            arrays[f"{name}_own"] = packed_bits(mine[0])
        else:
            arrays[f"{name}_{kind}_levels"] = np.array(mine).sum(axis=0).astype(np.uint8)
    return arrays


def _walls(packing: Packing) -> Arrays:
    walls = packing.wall_contacts
    if walls is None or not walls.count:
        return {}
    return {
        "wall_grain": walls.grain.astype(np.uint32),
        "wall": walls.wall.astype(np.uint32),
        "wall_normal": walls.normal.astype(np.float32),
        "wall_force": walls.force.astype(np.float32),
    }
