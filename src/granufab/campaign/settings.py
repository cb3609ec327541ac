"""Settings of a campaign: a case and the parameters that are varied (SWEEP.toml)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from granufab.errors import InvalidSettings
from granufab.simulate.settings_file import describe_error, read_toml

__all__ = [
    "COLUMNS",
    "RESULTS",
    "Latin",
    "Parameter",
    "Sweep",
    "Value",
    "load_sweep",
    "parse_sweep",
]

COLUMNS = ("id", "seed", "state", "reason", "seconds")
"""Columns of ``cases.csv`` beside the parameters; no parameter has one of these names."""

RESULTS: dict[str, str] = {
    "z_star": "critical coordination number",
    "a_star": "critical anisotropy",
    "z_min": "coordination number of the loosest isotropic state",
    "z_max": "coordination number of the densest isotropic state",
    "q_over_p_star": "stress ratio on the plateau",
    "phi_star": "solid fraction on the plateau",
    "z_0": "coordination number of the starting sample",
    "residual_max": "largest residual of a step",
    "nonconverged_share": "share of the steps that ended above the tolerance",
    "overlap_max": "worst overlap [mean diameters]",
    "inertial_number_max": "largest inertial number",
}
"""Numbers that :func:`granufab.campaign.gather` gives for each case, all without unit."""

RESERVED = frozenset((*COLUMNS, *RESULTS, "case", "point", "note"))

Value = bool | int | float | str
Finite = Annotated[float, Field(allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0)]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


class Parameter(_Settings):
    """One setting that is varied: over a list, a grid, or a range of the Latin hypercube."""

    key: Annotated[str, Field(min_length=1)] = Field(
        description="setting of the case, for example material.friction or path.0.strain"
    )
    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,39}$")] | None = Field(
        default=None, description="column and axis; default the last part of the key"
    )
    values: Annotated[tuple[Value, ...], Field(min_length=1)] | None = Field(
        default=None, description="the values, one by one"
    )
    low: Finite | None = Field(default=None, description="first value of a grid, or end of a range")
    high: Finite | None = Field(default=None, description="last value of a grid, or end of a range")
    count: Annotated[int, Field(ge=2, le=100_000)] | None = Field(
        default=None, description="values of the grid; without it the range is sampled by [latin]"
    )
    spacing: Literal["linear", "log"] = Field(
        default="linear", description="of grid and range: equal differences or equal ratios"
    )
    whole: bool = Field(default=False, description="round to whole numbers (counts)")
    zip: str | None = Field(
        default=None, description="lists with the same word here are walked together"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.key in ("name", "sample.seed", "schema_version"):
            raise ValueError(f"{self.key} cannot be varied; repeats are given by seeds = 3")
        if (self.values is None) == (self.low is None and self.high is None):
            raise ValueError(f"{self.key}: give values = [...], or low and high (and count)")
        if self.values is not None:
            self._check_values(self.values)
            return self
        if self.low is None or self.high is None or not self.low < self.high:
            raise ValueError(f"{self.key}: needs low < high, got {self.low} and {self.high}")
        if self.spacing == "log" and self.low <= 0:
            raise ValueError(f"{self.key}: spacing log needs low > 0, got {self.low}")
        if self.zip is not None and self.count is None:
            raise ValueError(f"{self.key}: zip needs values or a count")
        return self

    def _check_values(self, values: tuple[Value, ...]) -> None:
        if self.count is not None:
            raise ValueError(f"{self.key}: count belongs to low and high, not to values")
        if any(isinstance(value, float) and math.isnan(value) for value in values):
            raise ValueError(f"{self.key}: nan is no value")
        twice = next((v for k, v in enumerate(values) if v in values[:k]), None)
        if twice is not None and self.zip is None:
            raise ValueError(f"{self.key}: the value {twice!r} is there twice")

    @property
    def in_hypercube(self) -> bool:
        """Whether it is a range without a count, which the Latin hypercube samples."""
        return self.values is None and self.count is None

    @property
    def label(self) -> str:
        """Its own name, or the last part of the key."""
        return self.name or self.key.rpartition(".")[2]


class Latin(_Settings):
    """Latin hypercube over every parameter that is a range without a count."""

    count: Annotated[int, Field(ge=1, le=100_000)] = Field(description="points of the hypercube")
    seed: Seed = Field(default=1, description="random seed of the hypercube")


class Sweep(_Settings):
    """A campaign: the case that is varied, its parameters, and the seeds of each point."""

    name: str = Field(default="sweep", description="name of the campaign")
    seeds: (
        Annotated[int, Field(ge=1, le=10_000)] | Annotated[tuple[Seed, ...], Field(min_length=1)]
    ) = Field(default=1, description="number of samples of each point, or their seeds")
    case: dict[str, Any] = Field(
        default_factory=dict, description="sections of the case, or file = 'case.toml'"
    )
    parameter: tuple[Parameter, ...] = Field(default=(), description="what is varied")
    latin: Latin | None = Field(default=None, description="Latin hypercube over the open ranges")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        keys = [parameter.key for parameter in self.parameter]
        if len(set(keys)) < len(keys):
            twice = next(key for key in keys if keys.count(key) > 1)
            raise ValueError(f"parameter {twice} is there twice")
        if not isinstance(self.seeds, int) and len(set(self.seeds)) < len(self.seeds):
            raise ValueError(f"seeds holds a seed twice: {list(self.seeds)}")
        ranges = [parameter.key for parameter in self.parameter if parameter.in_hypercube]
        if ranges and self.latin is None:
            raise ValueError(
                f"{ranges[0]}: low and high without count is a range of a Latin hypercube; "
                "add count = 5, or [latin] with count = 20"
            )
        if self.latin is not None and not ranges:
            raise ValueError("latin: no parameter is a range (low and high without count)")
        self._check_zips()
        names = list(self.names())
        taken = sorted(set(names) & RESERVED)
        if taken or len(names) < len(keys):
            raise ValueError(
                f"parameter name {taken[0]} is a result's; choose another"
                if taken
                else "two parameters have the same name; give one another"
            )
        return self

    def _check_zips(self) -> None:
        lengths: dict[str, tuple[str, int]] = {}
        for item in self.parameter:
            if item.zip is None:
                continue
            size = len(item.values) if item.values is not None else item.count or 0
            first, wanted = lengths.setdefault(item.zip, (item.key, size))
            if size != wanted:
                raise ValueError(
                    f"zip {item.zip}: {first} has {wanted} values, but {item.key} has {size}"
                )

    def names(self) -> dict[str, str]:
        """Column → key of each parameter; the whole key where two would have the same name."""
        labels = [parameter.label for parameter in self.parameter]
        columns = {}
        for parameter in self.parameter:
            label = parameter.label
            clash = labels.count(label) > 1 or label in RESERVED
            columns[parameter.key if clash and parameter.name is None else label] = parameter.key
        return columns


def load_sweep(path: Path | str) -> Sweep:
    """Read a campaign; a case file that it names lies beside it.

    Raises:
        InvalidSettings: a file is missing or no TOML, or a setting is bad; one line names it.
    """
    path = Path(path)
    return parse_sweep(read_toml(path), where=str(path), folder=path.parent)


def parse_sweep(data: dict[str, Any], *, where: str = "sweep", folder: Path = Path()) -> Sweep:
    """Validate plain data into a :class:`Sweep`, with the case file (if any) read in.

    Args:
        data: as the TOML file holds it.
        where: named in messages.
        folder: that the name of the case file counts from.
    Raises:
        InvalidSettings: names the key, the value got and what is allowed.
    """
    try:
        sweep = Sweep.model_validate(data)
    except ValidationError as error:
        raise InvalidSettings(f"{where}: {describe_error(error, Sweep)}") from None
    given = dict(sweep.case)
    file = given.pop("file", None)
    if file is None:
        return sweep
    if not isinstance(file, str):
        raise InvalidSettings(f"{where}: case.file: expected the name of a file, got {file!r}")
    merged = read_toml(folder / file)
    for name, value in given.items():
        section = merged.get(name)
        if isinstance(section, dict) and isinstance(value, dict):
            value = {**section, **value}
        merged[name] = value
    return sweep.model_copy(update={"case": merged})
