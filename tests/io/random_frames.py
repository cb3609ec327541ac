"""Random frames with everything that a run file can hold."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from granufab.history import SERIES_UNITS, Frame, StepStatistics
from granufab.packing import Cell, Contacts, Grains, Packing, WallContacts


def random_frame(
    rng: np.random.Generator,
    *,
    dimension: int = 2,
    grain_count: int = 30,
    contact_count: int = 60,
    wall_count: int | None = None,
    base: Grains | None = None,
    lacks: tuple[str, ...] = (),
) -> Frame:
    """A frame whose branch vectors obey n (R_i + R_j + gap); ``lacks`` names fields left out."""

    def optional(name: str, value: Any) -> Any:
        return None if name in lacks else value

    d = dimension
    radius = rng.uniform(0.4, 0.6, grain_count) if base is None else base.radius
    grains = Grains(
        position=rng.standard_normal((grain_count, d)) * 10,
        radius=radius,
        mass=optional("mass", np.pi * radius**2),
        velocity=optional("velocity", rng.standard_normal((grain_count, d))),
        spin=optional("spin", rng.standard_normal((grain_count, 1 if d == 2 else 3))),
        number=rng.permutation(grain_count) + 7 if base is None else base.number,
    )
    pair = rng.integers(0, grain_count, (contact_count, 2))
    normal = _directions(rng, contact_count, d)
    gap = rng.normal(0.0, 1e-3, contact_count)
    branch = normal * (radius[pair[:, 0]] + radius[pair[:, 1]] + gap)[:, None]
    contacts = Contacts(
        pair=pair,
        normal=normal,
        branch=optional("branch", branch),
        gap=optional("gap", gap),
        force=optional("force", rng.standard_normal((contact_count, d))),
        image=optional("image", rng.integers(-300, 300, (contact_count, d))),
    )
    wall_contacts = None
    if wall_count is not None:
        wall_contacts = WallContacts(
            grain=rng.integers(0, grain_count, wall_count),
            wall=rng.integers(0, 2 * d, wall_count),
            normal=_directions(rng, wall_count, d),
            gap=rng.normal(0.0, 1e-3, wall_count),
            force=rng.standard_normal((wall_count, d)),
        )
    cell = Cell(
        matrix=np.diag(rng.uniform(5.0, 9.0, d)),
        periodic=tuple(bool(k) for k in rng.integers(0, 2, d)),
        origin=rng.standard_normal(d),
        rate=rng.standard_normal((d, d)),
    )
    statistics = {
        field.name: int(rng.integers(1, 10**12)) if field.type == "int" else float(rng.random())
        for field in fields(StepStatistics)
    }
    direction = np.zeros(d)
    direction[1] = 1.0
    return Frame(
        packing=Packing(
            grains=grains,
            contacts=optional("contacts", contacts),
            cell=optional("cell", cell),
            wall_contacts=wall_contacts,
            time=optional("time", float(rng.random())),
        ),
        eps_q=float(rng.normal()),
        eps_q_total=float(rng.random()),
        strain=rng.standard_normal((d, d)),
        stage=int(rng.integers(0, 5)),
        stress=rng.standard_normal((d, d)),
        inertial_number=float(rng.random()),
        direction=direction,
        statistics=StepStatistics(**statistics),
        remap=optional("remap", rng.integers(-3, 4, (d, d)).astype(float)),
        extension=optional("extension", rng.standard_normal(d)),
    )


def random_row(rng: np.random.Generator, name: str = "dense") -> dict[str, Any]:
    """A complete row of the series."""
    return {"path": name, **{column: float(rng.normal()) for column in SERIES_UNITS}}


def assert_same_frame(got: Frame, wanted: Frame) -> None:
    """Every field equal bit for bit; the branch, where it is derived, to 1e-14."""
    _assert_same(got, wanted, "frame")


def _assert_same(got: Any, wanted: Any, where: str) -> None:
    if where.endswith(".source"):
        return
    if where.endswith("contacts.branch") and wanted is not None:
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-14, err_msg=where)
        return
    if hasattr(wanted, "__dataclass_fields__"):
        assert type(got) is type(wanted), where
        for field in fields(wanted):
            name = field.name
            _assert_same(getattr(got, name), getattr(wanted, name), f"{where}.{name}")
    elif isinstance(wanted, np.ndarray):
        assert isinstance(got, np.ndarray), where
        assert got.dtype == wanted.dtype, where
        assert got.shape == wanted.shape, where
        assert got.tobytes() == wanted.tobytes(), where
    else:
        assert type(got) is type(wanted), where
        assert got == wanted, where


def _directions(rng: np.random.Generator, count: int, dimension: int) -> np.ndarray:
    vectors = rng.standard_normal((count, dimension))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
