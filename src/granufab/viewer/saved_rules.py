"""The criteria and definitions of z that a saved page offers: its own, all pairs, some levels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.criterion_curves import FORCE_THRESHOLDS, GAP_THRESHOLDS
from granufab.history import Frame
from granufab.packing import Array
from granufab.viewer.choice import Choice

__all__ = ["LEVELS", "Rule", "saved_rules"]

LEVELS = 9
"""Levels of each slider."""
Kind = Literal["own", "listed", "force", "gap"]
PairList = Literal["listed", "near"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A criterion of a saved page.

    Attributes:
        kind: what it is in the page.
        choice: the criterion, with the definition of z that comes first.
        pairs: which list its contacts are a part of: the pairs that the data list, or those
            found from positions.
        definitions: of z that are saved under it.
        level: its place on the slider of its kind.
    """

    kind: Kind
    choice: Choice
    pairs: PairList
    definitions: tuple[ZDefinition, ...]
    level: int = 0

    @property
    def threshold(self) -> float | None:
        """Of a level: the share of the mean force, or the gap [mean diameters]."""
        if self.kind not in ("force", "gap"):
            return None
        criterion = self.choice.criterion
        return criterion.share if self.kind == "force" else criterion.gap

    def under(self, definition: ZDefinition) -> Choice:
        """The criterion with a definition of z."""
        return replace(self.choice, z_definition=definition)


def saved_rules(own: Choice, frame: Frame) -> list[Rule]:
    """The criteria that are saved of every frame of a run, the run's own first.

    Gaps end where the data cease to list every pair; where they do not say how far they list
    them, pairs are found from positions up to 0.1 mean diameters.

    Args:
        own: the run's criterion, with the definition of z that the page shows first.
        frame: one of the run, for what its data hold.
    """
    first = own.z_definition
    definitions = (first, *(name for name in get_args(ZDefinition) if name != first))
    contacts = frame.packing.contacts
    known = contacts is not None and contacts.gap is not None
    pairs = "near" if _searched(own, known) else "listed"
    rules = [Rule(kind="own", choice=own, pairs=pairs, definitions=definitions)]
    if contacts is not None:
        listed = replace(own, criterion=Criterion("listed"))
        rules.append(Rule(kind="listed", choice=listed, pairs="listed", definitions=(first,)))
        if contacts.force is not None:
            rules += _slider("force", own, FORCE_THRESHOLDS)
    held = GAP_THRESHOLDS[(own.reach or 0.0) >= GAP_THRESHOLDS]
    gaps = held if known and len(held) >= LEVELS else GAP_THRESHOLDS
    return rules + _slider("gap", own, gaps, known)


def _slider(
    kind: Literal["force", "gap"], own: Choice, thresholds: Array, known: bool = True
) -> list[Rule]:
    places = np.rint(np.linspace(0, len(thresholds) - 1, LEVELS)).astype(int)
    rules = []
    for level, value in enumerate(thresholds[places].tolist()):
        criterion = Criterion("force", share=value) if kind == "force" else Criterion("gap", value)
        choice = replace(own, criterion=criterion)
        pairs = "near" if _searched(choice, known) else "listed"
        definitions = (own.z_definition,)
        rules.append(
            Rule(kind=kind, choice=choice, pairs=pairs, level=level, definitions=definitions)
        )
    return rules


def _searched(choice: Choice, known: bool) -> bool:
    """Whether :func:`~granufab.fabric.select_contacts` searches for pairs, gaps known or not."""
    rule = choice.criterion
    listed = known and choice.reach is not None and choice.reach >= rule.gap
    return rule.kind == "gap" and not listed
