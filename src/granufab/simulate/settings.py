"""Settings of a simulated case: frozen, validated, mirrored one to one by its TOML file.

Units are free: with the defaults d = p = density = 1 every result is in those scales; in SI give
diameter in m, density in kg/m³ (2D: kg/m² of disk area), pressure in Pa (2D: N/m).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from granufab.errors import InvalidSettings
from granufab.simulate.settings_file import describe_error, read_toml

__all__ = [
    "Case",
    "Material",
    "Reading",
    "Record",
    "Sample",
    "Sizes",
    "Solver",
    "Stage",
    "load_case",
    "parse_case",
    "to_toml",
]

ZDefinition = Literal["z", "z_backbone", "z_mechanical"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


class Sizes(_Settings):
    """Grain sizes: diameters with mean ``Sample.diameter``."""

    kind: Literal[
        "uniform", "uniform-by-volume", "bidisperse", "log-normal", "monodisperse", "file"
    ] = Field(default="uniform", description="distribution of diameters")
    spread: NonNegative = Field(
        default=0.2,
        description="uniform: half width / mean; log-normal: standard deviation of ln d",
    )
    ratio: Positive = Field(default=1.4, description="bidisperse: large / small diameter")
    large_fraction: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.5, description="bidisperse: number fraction of large grains"
    )
    file: str | None = Field(default=None, description="file of radii, one per line, used in order")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.kind in ("uniform", "uniform-by-volume") and self.spread >= 1:
            raise ValueError(f"spread must be below 1 for {self.kind} sizes, got {self.spread}")
        if self.kind == "file" and self.file is None:
            raise ValueError("kind 'file' needs file = \"radii.txt\"")
        return self


class Reading(_Settings):
    """What a foreign starting state does not say itself; as the options of ``granufab.read``."""

    format: str | None = Field(default=None, description="key of the format, else by the content")
    dimension: Literal[2, 3] | None = Field(default=None, description="2 or 3 coordinates")
    cell: tuple[float, ...] | None = Field(
        default=None, description="edges of the box, or lower corner and edges"
    )
    periodic: str | None = Field(default=None, description='periodic axes, for example "xy"')
    columns: str | None = Field(default=None, description="TOML file: what the columns hold")
    radius: Positive | None = Field(default=None, description="of every grain")
    walls: bool = Field(default=False, description="keep bodies of walls as grains")


class Sample(_Settings):
    """How the isotropic starting sample is made, or where the starting state comes from."""

    grain_count: Annotated[int, Field(ge=1, le=100_000_000)] = Field(
        default=2000, description="number of grains"
    )
    dimension: Literal[2, 3] = Field(default=2, description="2 (disks) or 3 (spheres)")
    sizes: Sizes = Sizes()
    diameter: Positive = Field(default=1.0, description="mean diameter d")
    density: Positive = Field(
        default=1.0, description="mass per area (2D) or volume (3D) of a grain"
    )
    pressure: Positive = Field(default=1.0, description="confining stress p")
    coordination: Positive | None = Field(
        default=None, description="wanted z_0, reached by bisecting the compaction friction"
    )
    coordination_tolerance: Positive = Field(
        default=0.03, description="accepted |z_0 - wanted|, 0.05 at worst"
    )
    z_definition: ZDefinition = Field(default="z_backbone", description="which z is meant")
    friction: NonNegative = Field(
        default=0.0, description="compaction friction where no coordination is wanted"
    )
    solid_fraction: Annotated[float, Field(gt=0, le=0.5)] | None = Field(
        default=None, description="of the dilute random start; default 0.45 (2D), 0.3 (3D)"
    )
    boundary: Literal["periodic", "walls"] = Field(
        default="periodic", description="periodic or walls"
    )
    file: str | tuple[str, ...] | None = Field(
        default=None, description="start from a state of this run file, or of these foreign files"
    )
    frame: int = Field(default=-1, description="of the file, counted from 0; -1 is the last")
    read: Reading = Reading()
    seed: Annotated[int, Field(ge=0)] = Field(default=1, description="random seed")


class Material(_Settings):
    """Contact law of the grains while the path is followed."""

    friction: NonNegative = Field(default=0.4, description="friction coefficient mu between grains")
    wall_friction: NonNegative = Field(default=0.0, description="friction coefficient on walls")
    restitution: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="normal restitution coefficient e"
    )


class Solver(_Settings):
    """Contact Dynamics solver."""

    tolerance: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=1e-4, description="residual at which a step is converged"
    )
    max_sweeps: Annotated[int, Field(ge=1)] = Field(
        default=2000, description="sweeps after which a step is counted as not converged"
    )
    stiffness: Annotated[float, Field(gt=0)] = Field(
        default=1.6e5, description="implicit contact stiffness k/p (3D: k/(p d)); inf is rigid"
    )
    momentum: bool = Field(
        default=True, description="accelerate the sweeps by safeguarded momentum"
    )
    strict: bool = Field(default=False, description="a step that does not converge is an error")
    overlap_correction: Annotated[float, Field(ge=0, le=0.1)] = Field(
        default=0.05, description="share beta of an overlap removed per step (rigid contacts)"
    )
    time_step: Positive = Field(
        default=0.05, description="largest time step in sqrt(m/p) (2D) or sqrt(m/(p d)) (3D)"
    )
    step_strain: Annotated[float, Field(gt=0, le=1e-2)] = Field(
        default=1e-4, description="largest strain per step"
    )
    skin: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.1, description="neighbour-list margin in mean diameters"
    )


class Stage(_Settings):
    """One stage of the loading path."""

    loading: Literal[
        "isotropic", "constant-mean", "biaxial", "triaxial", "simple-shear", "simple-shear-volume"
    ] = Field(
        default="constant-mean", description="which cell components are rate- and stress-driven"
    )
    strain: float = Field(
        default=0.3,
        description="deviatoric strain, negative reverses or extends; isotropic relaxes to rest",
    )
    inertial_number: Positive | None = Field(
        default=3e-4,
        description="I = rate sqrt(m/p) (2D), rate d sqrt(density/p) (3D); sets the rate",
    )
    rate: Positive | None = Field(
        default=None, description="deviatoric rate instead of inertial_number"
    )
    axis: Annotated[int, Field(ge=0, le=2)] = Field(
        default=1,
        description="compression axis, in simple shear the gradient axis",
    )
    b: Annotated[float, Field(ge=0, le=1)] | None = Field(
        default=None,
        description="3D constant-mean: (e2 - e3)/(e1 - e3) of the strain rate; or axisymmetric",
    )

    @model_validator(mode="before")
    @classmethod
    def _rate_alone(cls, data: Any) -> Any:
        """A given rate replaces the default inertial number."""
        if isinstance(data, dict) and data.get("rate") is not None:
            return {"inertial_number": None, **data}
        return data

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not math.isfinite(self.strain):
            raise ValueError(f"strain must be finite, got {self.strain}")
        if self.inertial_number is None and self.rate is None:
            raise ValueError("give inertial_number or rate")
        if self.inertial_number is not None and self.rate is not None:
            raise ValueError("give inertial_number or rate, not both")
        if self.b is not None and self.loading != "constant-mean":
            raise ValueError(f"b is for loading constant-mean, got loading {self.loading}")
        return self


class Record(_Settings):
    """What is written while a path runs."""

    series_interval: Positive = Field(default=1e-3, description="strain between rows of the series")
    frame_interval: Positive = Field(default=1e-2, description="strain between complete frames")
    reach: NonNegative = Field(
        default=0.05, description="pairs up to this gap are recorded, in mean diameters"
    )
    criterion: str = Field(
        default="force",
        description="of measure_run: force, gap:DELTA, listed; the series uses force",
    )
    z_definition: ZDefinition = Field(
        default="z_backbone", description="definition of z on figures"
    )
    checkpoint_seconds: Positive = Field(default=300.0, description="wall time between checkpoints")
    checkpoint_strain: Positive | None = Field(
        default=None, description="strain between checkpoints; default by wall time alone"
    )

    @field_validator("criterion")
    @classmethod
    def _known_criterion(cls, text: str) -> str:
        from granufab.fabric.criterion import parse_criterion  # scipy: only where a case is made

        parse_criterion(text)
        return text


class Case(_Settings):
    """A complete case: sample, material, solver, path, record."""

    schema_version: Literal[1] = 1
    name: str = Field(default="run", description="name of the path in series and figures")
    sample: Sample = Sample()
    material: Material = Material()
    solver: Solver = Solver()
    path: Annotated[tuple[Stage, ...], Field(min_length=1)] = (Stage(),)
    record: Record = Record()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.record.reach > self.solver.skin:
            raise ValueError(
                f"record.reach is {self.record.reach}, allowed up to solver.skin = "
                f"{self.solver.skin}"
            )
        sample = self.sample
        known = sample.file is None or "dimension" in sample.model_fields_set
        for index, stage in enumerate(self.path):
            if known:
                _check_dimension(stage, index, sample.dimension)
            if sample.boundary == "walls" and stage.loading.startswith("simple-shear"):
                raise ValueError(
                    f"path.{index}.loading is {stage.loading}, which needs a periodic sample"
                )
        return self


def _check_dimension(stage: Stage, index: int, dimension: int) -> None:
    """A biaxial stage is 2D; a triaxial one and an intermediate strain rate b are 3D."""
    if stage.axis >= dimension:
        raise ValueError(f"path.{index}.axis is {stage.axis}, allowed 0..{dimension - 1}")
    needed = {"biaxial": 2, "triaxial": 3}.get(stage.loading, dimension)
    if needed != dimension:
        other = "triaxial" if dimension == 3 else "biaxial"
        raise ValueError(
            f"path.{index}.loading is {stage.loading}, but sample.dimension is {dimension}; "
            f"use {other}"
        )
    if stage.b is not None and dimension == 2:
        raise ValueError(f"path.{index}.b is {stage.b:g}, which exists only in 3D; leave it out")


def load_case(
    path: Path | str | None,
    overrides: tuple[str, ...] = (),
    given: Mapping[str, Any] | None = None,
) -> Case:
    """Read a case from a TOML file.

    Args:
        path: the file; None takes the defaults.
        overrides: assignments ``section.key=value`` that win over the file.
        given: values, or keys of a section, that win over the file, but not over ``overrides``.
    Raises:
        InvalidSettings: the file is missing, is no TOML, or holds a bad value.
    """
    data = {} if path is None else read_toml(Path(path))
    for name, value in (given or {}).items():
        section = data.get(name)
        data[name] = {**section, **value} if isinstance(section, dict) else value
    for text in overrides:
        _assign(data, text)
    return parse_case(data, where="settings" if path is None else str(path))


def parse_case(data: dict[str, Any], *, where: str = "settings") -> Case:
    """Validate plain data into a :class:`Case`.

    Raises:
        InvalidSettings: names the key, the value got and what is allowed.
    """
    try:
        return Case.model_validate(data)
    except ValidationError as error:
        raise InvalidSettings(f"{where}: {describe_error(error, Case)}") from None


def _assign(data: dict[str, Any], text: str) -> None:
    key, equals, value = text.partition("=")
    if not equals:
        raise InvalidSettings(f"--set {text}: expected section.key=value")
    try:
        parsed = tomllib.loads(f"x = {value}")["x"]
    except tomllib.TOMLDecodeError:
        parsed = value
    *sections, last = key.strip().split(".")
    target: Any = data
    for section in sections:
        if isinstance(target, list):
            if not section.isdigit() or int(section) >= len(target):
                raise InvalidSettings(f"--set {text}: there is no entry {section}")
            target = target[int(section)]
        else:
            target = target.setdefault(section, [{}] if section == "path" else {})
        if not isinstance(target, dict | list):
            raise InvalidSettings(f"--set {text}: {section} is a value, not a section")
    if isinstance(target, list):
        raise InvalidSettings(f"--set {text}: name the stage, for example path.0.{last}")
    target[last] = parsed


def to_toml(case: Case, *, comments: bool = False) -> str:
    """A case as TOML text; with ``comments`` each key carries its meaning."""
    lines = [f"schema_version = {case.schema_version}", f"name = {_value(case.name)}"]
    for section in ("sample", "material", "solver", "record"):
        _section(lines, f"[{section}]", getattr(case, section), comments, section)
    for stage in case.path:
        _section(lines, "[[path]]", stage, comments, "path")
    return "\n".join(lines) + "\n"


def _section(lines: list[str], header: str, model: _Settings, comments: bool, prefix: str) -> None:
    lines += ["", header]
    nested: list[tuple[str, _Settings]] = []
    for name, info in type(model).model_fields.items():
        value = getattr(model, name)
        if isinstance(value, _Settings):
            nested.append((name, value))
            continue
        note = f"  # {info.description}" if comments and info.description else ""
        if value is None:
            if comments:
                lines.append(f"# {name} ={note}")
        else:
            lines.append(f"{name} = {_value(value)}{note}")
    for name, value in nested:
        _section(lines, f"[{prefix}.{name}]", value, comments, f"{prefix}.{name}")


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else ("inf" if value > 0 else "-inf")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    text = str(value).replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{text}"'
