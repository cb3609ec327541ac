"""What a saved page says of itself: frames kept, steps of its numbers, criteria it offers."""

from __future__ import annotations

from collections.abc import Sequence

from granufab.viewer.saved_rules import LEVELS
from granufab.viewer.saved_run import SavedRun
from granufab.viewer.saved_states import DIGITS

__all__ = ["saved_words"]


def saved_words(
    saved: Sequence[SavedRun], kept: Sequence[Sequence[int]], limit: int
) -> tuple[str, ...]:
    """Lines for people: on the page and when it is written."""
    lines = [_frames(one, len(places), limit) for one, places in zip(saved, kept, strict=True)]
    steps: dict[str, float] = {}
    for one, places in zip(saved, kept, strict=True):
        for name, step in one.quantised(_ends(places)).items():
            steps[name] = max(step, steps.get(name, 0.0))
    return (*lines, _steps(steps), *_rules(saved))


def _ends(places: Sequence[int]) -> list[int]:
    return sorted({places[0], places[-1]})


def _frames(one: SavedRun, kept: int, limit: int) -> str:
    count, held = len(one.wanted), len(one.viewed.run.frames)
    if kept < count:
        thinned = f"evenly spaced, to stay below {limit / 1e6:.4g} MB"
        return f"{one.name}: {kept} of {count} frames, {thinned}; changes are between them"
    if count < held:
        return f"{one.name}: {count} of {held} frames, as chosen; changes are between them"
    return f"{one.name}: all {held} frames"


def _steps(steps: dict[str, float]) -> str:
    names = {"position": "positions", "gap": "gaps", "force": "forces"}
    units = {"position": "d", "gap": "d", "force": "mean normal forces"}
    told = [f"{names[name]} to {step / 2:.1g} {units[name]}" for name, step in steps.items()]
    return (
        f"drawn from rounded numbers: {', '.join(told)}, velocities and spins to 1/65534 of the "
        f"largest, roses to {DIGITS} digits; the values shown are exact"
    )


def _rules(saved: Sequence[SavedRun]) -> list[str]:
    kinds = {rule.kind: rule for one in saved for rule in one.rules}
    sliders = [kind for kind in ("force", "gap") if kind in kinds]
    names = ["as recorded", *(["all listed"] if "listed" in kinds else [])]
    told = [*names, *(f"{LEVELS} levels of {kind}" for kind in sliders)]
    lines = [f"contacts: {', '.join(told)}"]
    own, others = kinds["own"].definitions, {rule.definitions for rule in kinds.values()}
    if len(others) > 1:
        lines.append(
            f"z: {', '.join(own)} with contacts as recorded, {own[0]} with the others; "
            "contacts gained and lost as recorded only"
        )
    return lines
