"""From a campaign's settings to its cases: grids, lists, Latin hypercube, seeds."""

from __future__ import annotations

import copy
import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from granufab.campaign.identity import case_digest, case_id
from granufab.campaign.settings import Latin, Parameter, Sweep, Value
from granufab.errors import InvalidSettings
from granufab.simulate.settings import Case, parse_case

__all__ = ["MOST_CASES", "Member", "describe_parameters", "expand"]

MOST_CASES = 100_000
"""A campaign of more cases is refused: its table is rewritten whole."""

Point = dict[str, Value]


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A case of a campaign.

    Attributes:
        id: name of its folder and of its path; ends in ``digest``.
        digest: of its settings (:func:`granufab.campaign.identity.case_digest`).
        parameters: column → value of what is varied.
        case: what is run; its name is the id.
    """

    id: str
    digest: str
    parameters: Mapping[str, Value]
    case: Case

    @property
    def seed(self) -> int:
        """Random seed of its sample."""
        return self.case.sample.seed


def expand(sweep: Sweep, *, where: str = "sweep") -> list[Member]:
    """Every case of a campaign, validated: the last parameter varies fastest, the seeds inside.

    Args:
        sweep: the campaign.
        where: named in messages.
    Raises:
        InvalidSettings: the first bad case, named with its parameters; two cases with the same
            settings; too many cases.
    """
    columns = {key: column for column, key in sweep.names().items()}
    members: list[Member] = []
    seen: dict[str, Member] = {}
    _check_count(sweep, where)
    for point in _points(sweep):
        parameters = {columns[key]: value for key, value in point.items()}
        for seed in _seeds(sweep, where):
            member = _member(sweep, point, parameters, seed, where)
            twin = seen.setdefault(member.digest, member)
            if twin is not member:
                raise InvalidSettings(
                    f"{where}: two cases have the same settings: {describe_member(twin)}; "
                    f"{describe_member(member)}"
                )
            members.append(member)
    return members


def describe_parameters(parameters: Mapping[str, Value]) -> str:
    """Parameters in a line: "friction = 0.4, strain = 0.1"."""
    return ", ".join(f"{name} = {_short(value)}" for name, value in parameters.items())


def describe_member(member: Member) -> str:
    """A case by its parameters and seed, in a line."""
    return describe_parameters({**member.parameters, "seed": member.seed})


def _short(value: Value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _check_count(sweep: Sweep, where: str) -> None:
    counts = [len(group) for group in _groups(sweep, counting=True)]
    seeds = sweep.seeds if isinstance(sweep.seeds, int) else len(sweep.seeds)
    total = math.prod(counts) * seeds
    if total > MOST_CASES:
        raise InvalidSettings(
            f"{where}: expands to {total} cases, at most {MOST_CASES} are allowed; "
            "split it, or use a Latin hypercube"
        )


def _points(sweep: Sweep) -> Iterator[Point]:
    for combination in product(*_groups(sweep)):
        merged: Point = {}
        for part in combination:
            merged |= part
        yield {item.key: merged[item.key] for item in sweep.parameter}


def _groups(sweep: Sweep, *, counting: bool = False) -> list[Any]:
    """What is walked independently: single parameters, zipped ones, the hypercube.

    With ``counting`` the groups are ranges of the right lengths.
    """
    groups: dict[str, Any] = {}
    zipped: dict[str, list[Parameter]] = {}
    for item in sweep.parameter:
        if item.zip is not None:
            zipped.setdefault(item.zip, []).append(item)
            groups.setdefault(f"zip {item.zip}", ())
        elif item.in_hypercube:
            groups.setdefault("latin", ())
        else:
            groups[item.key] = [{item.key: v} for v in _values(item, counting)]
    for word, items in zipped.items():
        rows = zip(*(_values(item, counting) for item in items), strict=True)
        groups[f"zip {word}"] = [
            {item.key: v for item, v in zip(items, row, strict=True)} for row in rows
        ]
    if sweep.latin is not None:
        ranges = [item for item in sweep.parameter if item.in_hypercube]
        latin = sweep.latin
        groups["latin"] = range(latin.count) if counting else _hypercube(latin, ranges)
    return list(groups.values())


def _values(item: Parameter, counting: bool) -> list[Value]:
    if item.values is not None:
        return list(item.values)
    if counting:
        return list(range(item.count or 0))
    return [_between(item, share) for share in np.linspace(0.0, 1.0, item.count or 0)]


def _hypercube(latin: Latin, ranges: list[Parameter]) -> list[Point]:
    """One value of each of ``count`` equal shares of every range, in random pairing."""
    from scipy.stats import qmc

    keyword = "rng" if "rng" in inspect.signature(qmc.LatinHypercube).parameters else "seed"
    random: Any = {keyword: np.random.default_rng(latin.seed)}
    shares = qmc.LatinHypercube(len(ranges), **random).random(latin.count)
    return [
        {item.key: _between(item, share) for item, share in zip(ranges, row, strict=True)}
        for row in shares
    ]


def _between(item: Parameter, share: float) -> Value:
    """The value at ``share`` of the way, to twelve digits, so that 0.3 is 0.3."""
    low, high = item.low or 0.0, item.high or 0.0
    if item.spacing == "log":
        value = math.exp(math.log(low) + share * (math.log(high) - math.log(low)))
    else:
        value = low + share * (high - low)
    value = {0.0: low, 1.0: high}.get(float(share), float(f"{value:.12g}"))
    return round(value) if item.whole else value


def _seeds(sweep: Sweep, where: str) -> tuple[int, ...]:
    if not isinstance(sweep.seeds, int):
        return sweep.seeds
    section = sweep.case.get("sample")
    first = section.get("seed", 1) if isinstance(section, dict) else 1
    if not isinstance(first, int):
        raise InvalidSettings(f"{where}: case.sample.seed: expected a whole number, got {first!r}")
    return tuple(first + k for k in range(sweep.seeds))


def _member(
    sweep: Sweep, point: Point, parameters: Mapping[str, Value], seed: int, where: str
) -> Member:
    data = copy.deepcopy(sweep.case)
    named = f"{where}: case {describe_parameters({**parameters, 'seed': seed})}"
    for key, value in {**point, "sample.seed": seed}.items():
        _assign(data, key, value, named)
    case = parse_case(data, where=named)
    digest = case_digest(case)
    name = case_id(sweep.name, parameters, seed, digest)
    return Member(
        id=name,
        digest=digest,
        parameters=parameters,
        case=case.model_copy(update={"name": name}),
    )


def _assign(data: dict[str, Any], key: str, value: Value, where: str) -> None:
    """Set ``section.key`` (stages by number, path.0.strain) in the data of a case."""
    *sections, last = key.split(".")
    target: Any = data
    for part in sections:
        if isinstance(target, list):
            if not (part.isascii() and part.isdigit()) or int(part) >= len(target):
                raise InvalidSettings(
                    f"{where}: {key}: there is no entry {part}, allowed 0..{len(target) - 1}"
                )
            target = target[int(part)]
        else:
            target = target.setdefault(part, [{}] if part == "path" else {})
        if not isinstance(target, dict | list):
            raise InvalidSettings(f"{where}: {key}: {part} is a value, not a section")
    if isinstance(target, list):
        raise InvalidSettings(f"{where}: {key}: name the stage, for example path.0.{last}")
    target[last] = value
