"""The strain path that ``granufab predict`` reads: a small TOML file, or a case's own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.simulate.loading import ConstantMean, SimpleShear
from granufab.simulate.settings import Case, load_case
from granufab.simulate.settings_file import describe_error, read_toml
from granufab.states import StrainStage, fabric_from_state

__all__ = ["TEMPLATE", "StrainPath", "load_strain_path"]

TEMPLATE = """\
# Strain path for granufab predict. The volume is taken to stay constant: volume change does not
# enter the law. A case that granufab run reads is accepted too (its [sample] coordination and
# [[path]]).
interval = 0.001           # strain between the predicted states

[start]
z = 4.0                    # coordination number, of the definition that the fit used
a = 0.0                    # signed anisotropy along the first stage's axis
# fabric = [[1, 0], [0, 1]]  # instead of z and a: the tensor G, its trace is z/2
# surplus = 0.0            # memory of a dense start; default: z beyond z* at the start

[[path]]
loading = "compression"    # compression, extension, simple-shear (or constant-mean, biaxial,
                           # triaxial: the same as compression where the volume is constant)
strain = 0.3               # deviatoric strain walked; negative reverses
axis = 1                   # axis of compression or extension; gradient axis in simple shear
# b = 0.5                  # 3D compression: (e2 - e3)/(e1 - e3) of the strain rate

[[path]]
loading = "compression"
strain = -0.3

# [[path]]                 # any velocity gradient L (L > 0 expands), scaled to the strain
# gradient = [[0.0, 1.0], [0.0, 0.0]]
# strain = 0.1
"""
_CASE_SECTIONS = {"schema_version", "name", "sample", "material", "solver", "record"}
_MOST_STATES = 100_000
_SHEAR = ("simple-shear", "simple-shear-volume")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Matrix = tuple[tuple[Finite, ...], ...]


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Start(_Settings):
    z: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    a: Finite = 0.0
    fabric: Matrix | None = None
    surplus: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None

    @model_validator(mode="after")
    def _one_state(self) -> Self:
        if (self.z is None) == (self.fabric is None):
            raise ValueError("give either z (and a) or fabric")
        return self


class _Stage(_Settings):
    loading: Literal[
        "compression", "extension", "constant-mean", "biaxial", "triaxial",
        "simple-shear", "simple-shear-volume",
    ] = "compression"  # fmt: skip
    strain: Finite = 0.3
    axis: Annotated[int, Field(ge=0, le=2)] = 1
    b: Annotated[float, Field(ge=0, le=1)] | None = None
    gradient: Matrix | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.strain == 0.0:
            raise ValueError("strain must not be 0")
        if self.b is not None and (self.gradient is not None or self.loading in _SHEAR):
            raise ValueError("b belongs to compression or extension only")
        return self


class _PathFile(_Settings):
    interval: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1e-3
    start: _Start
    path: Annotated[tuple[_Stage, ...], Field(min_length=1)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrainPath:
    """What a path file describes.

    Attributes:
        fabric: G at the start [-], shape (D, D).
        surplus: memory of a dense start, or None for the law's own.
        stages: the strain history.
        direction: axis of a' and of positive strain, shape (D,).
        skipped: number of isotropic stages left out.
    """

    fabric: Array
    surplus: float | None
    stages: tuple[StrainStage, ...]
    direction: Array
    skipped: int = 0


def load_strain_path(file: Path, dimension: int) -> StrainPath:
    """Read and check a path file or a case.

    Args:
        file: TOML.
        dimension: of the law.
    Raises:
        InvalidSettings: the file is missing, is no TOML, or holds a bad value; a case of another
            dimension, without a wanted coordination, or with isotropic stages only.
    """
    data = read_toml(file)
    try:
        if _CASE_SECTIONS & set(data):
            return _of_case(load_case(file), dimension)
        return _of_file(_PathFile.model_validate(data), dimension)
    except ValidationError as error:
        raise InvalidSettings(f"{file}: {describe_error(error, _PathFile)}") from None
    except InvalidSettings as error:
        text = str(error)
        raise InvalidSettings(text if text.startswith(str(file)) else f"{file}: {text}") from None


def _of_case(case: Case, dimension: int) -> StrainPath:
    if case.sample.dimension != dimension:
        raise InvalidSettings(
            f"sample.dimension is {case.sample.dimension}, the law was fitted in {dimension}D"
        )
    if case.sample.coordination is None:
        raise InvalidSettings("sample.coordination is not given, so the starting z is unknown")
    keys = ("loading", "strain", "axis", "b")
    stages = [
        _Stage.model_validate(stage.model_dump(include=set(keys)))
        for stage in case.path
        if stage.loading != "isotropic" and stage.strain != 0.0
    ]
    if not stages:
        raise InvalidSettings("path holds isotropic stages only, which the law does not describe")
    start = _Start(z=case.sample.coordination)
    interval = case.record.series_interval
    file = _PathFile(interval=interval, start=start, path=tuple(stages))
    return _of_file(file, dimension, skipped=len(case.path) - len(stages))


def _of_file(file: _PathFile, dimension: int, skipped: int = 0) -> StrainPath:
    walked = sum(abs(stage.strain) for stage in file.path)
    if walked / file.interval > _MOST_STATES:
        raise InvalidSettings(
            f"interval is {file.interval:g}, which makes more than {_MOST_STATES:,} states of "
            f"the strain {walked:g}; make it at least {walked / _MOST_STATES:.2g}"
        )
    gradients = [_gradient(stage, dimension, number) for number, stage in enumerate(file.path)]
    stages = []
    for stage, (gradient, _) in zip(file.path, gradients, strict=True):
        count = max(math.ceil(abs(stage.strain) / file.interval - 1e-9), 1)
        times = np.linspace(0.0, abs(stage.strain), count + 1)
        stages.append(
            StrainStage(gradient=math.copysign(1.0, stage.strain) * gradient, times=times)
        )
    direction = gradients[0][1]
    start = file.start
    if start.fabric is not None:
        fabric = _matrix(start.fabric, dimension, "start.fabric")
    else:
        fabric = fabric_from_state(start.z or 0.0, start.a, direction=direction)
    return StrainPath(
        fabric=fabric,
        surplus=start.surplus,
        stages=tuple(stages),
        direction=direction,
        skipped=skipped,
    )


def _gradient(stage: _Stage, dimension: int, number: int) -> tuple[Array, Array]:
    """Velocity gradient of ε̇_q = 1 without volume change, and the axis that counts as positive."""
    if stage.gradient is not None:
        return _scaled(_matrix(stage.gradient, dimension, f"path.{number}.gradient"), number)
    if stage.axis >= dimension:
        raise InvalidSettings(f"path.{number}.axis is {stage.axis}, allowed 0..{dimension - 1}")
    if stage.b is not None and dimension == 2:
        raise InvalidSettings(f"path.{number}.b is given, but b exists only in 3D")
    if stage.loading in _SHEAR:
        shear = SimpleShear(rate=1.0, axis=stage.axis, dimension=dimension)
        return shear.rate, shear.direction
    loading = ConstantMean(rate=1.0, axis=stage.axis, dimension=dimension, b=stage.b)
    sign = -1.0 if stage.loading == "extension" else 1.0
    return sign * loading.rate, loading.direction


def _scaled(gradient: Array, number: int) -> tuple[Array, Array]:
    values, vectors = np.linalg.eigh(-0.5 * (gradient + gradient.T))
    speed = values[-1] - values[0]
    if not speed > 1e-12 * np.abs(gradient).max():
        raise InvalidSettings(f"path.{number}.gradient has no deviatoric strain rate")
    return gradient / speed, vectors[:, -1]


def _matrix(rows: Matrix, dimension: int, name: str) -> Array:
    if [len(row) for row in rows] != [dimension] * dimension:
        raise InvalidSettings(f"{name} must be {dimension} rows of {dimension} numbers")
    return np.array(rows, dtype=np.float64)
