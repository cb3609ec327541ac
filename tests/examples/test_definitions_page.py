"""The page of definitions: its names exist, its formulas and factors hold for small packings."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))
sys.path.insert(0, str(Path(__file__).parent))

from console_pages import Shell, blocks, commands
from small_runs import sheared

import granufab as gf
from granufab.fabric import backbone, measure, select_network
from granufab.fabric.force_values import FORCE_VALUES
from granufab.history import SERIES_UNITS
from granufab.packing import Packing

PAGE = Path(__file__).resolve().parents[2] / "docs" / "definitions.md"
TEXT = PAGE.read_text(encoding="utf-8")
NAMED = set(re.findall(r"`([^`\n]+)`", TEXT))
ROWS = [[cell.strip() for cell in line.split("|")[1:-1]] for line in TEXT.splitlines()
        if line.startswith("| ")]  # fmt: skip


@pytest.fixture(scope="module", params=[2, 3])
def packing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Packing:
    """A sheared state of disks or spheres."""
    return sheared(tmp_path_factory.mktemp("run"), request.param)[-1]


def test_every_column_stands_on_the_page(packing: Packing) -> None:
    values = measure(packing) | dict.fromkeys([*SERIES_UNITS, *FORCE_VALUES])
    tensors = {f"f_{a}{b}" for a in "xyz" for b in "xyz"}
    told = NAMED | {"grain_count", "dimension", "missing"} | tensors
    assert not sorted(set(values) - told)


def test_every_name_on_the_page_exists(packing: Packing) -> None:
    columns = set(measure(packing)) | set(SERIES_UNITS) | set(FORCE_VALUES)
    columns |= {"f_xz", "g_3", "b_g", "z_0", "low", "high", "path", "stage", "az"}
    fits = gf.states.AccessibleFit.__dataclass_fields__
    missing = []
    for name in re.findall(r"`([a-z]\w*(?:\.\w+)*)`", "\n".join(_our_part())):
        *parts, last = name.split(".")
        if name in columns or name in fits or _is_setting(name):
            continue
        holder = {(): gf.fabric, ("granufab",): gf, ("granufab", "states"): gf.states}
        if not any(hasattr(one, last) for key, one in holder.items() if tuple(parts) in (key, ())):
            missing.append(name)
    assert not missing


def _our_part() -> list[str]:
    return TEXT.split("## Names and factors")[0].splitlines()


def _is_setting(name: str) -> bool:
    """Criteria, rules and files that are named beside functions and columns."""
    rules = {*gf.fabric.RATTLER_RULES, "force", "listed", "z_definition", "criterion"}
    return name in rules or name.endswith((".csv", ".json", ".h5"))


def test_the_formulas_of_the_tables(packing: Packing) -> None:
    values = measure(packing, direction=np.eye(packing.dimension)[1])
    network = select_network(packing)
    three = packing.dimension == 3
    z, a = float(values["z_backbone"]), float(values["a"])  # type: ignore[arg-type]
    g = [float(values[f"g_{k + 1}"]) for k in range(packing.dimension)]  # type: ignore[arg-type]
    assert sum(g) == pytest.approx(z / 2)
    assert values["p_g"] == pytest.approx(z / 6 if three else z / 4)
    assert values["q_g"] == pytest.approx(z * a / (15 if three else 8))
    assert z * a == pytest.approx((5 if three else 4) * (g[0] - g[-1]))
    count = network.contacts.count
    assert values["a_bias"] == pytest.approx((2.69 if three else np.pi**0.5) / count**0.5)
    found = gf.orientation(network.contacts, z=z, axis=None if not three else np.eye(3)[1])
    width = np.pi / 36 if not three else 2 * np.pi / 36
    assert float(found["E"].sum()) * width == pytest.approx(z / 2)


def test_coordination_by_hand(packing: Packing) -> None:
    values = measure(packing)
    pair = gf.fabric.select_contacts(packing, "force").pair
    number = np.bincount(pair.ravel(), minlength=packing.grains.count)
    held = backbone(pair, packing.grains.count)
    inside = held[pair].all(axis=1)
    none, one = int((number == 0).sum()), int((number == 1).sum())
    assert values["z"] == pytest.approx(2 * len(pair) / len(number))
    assert values["z_backbone"] == pytest.approx(2 * inside.sum() / held.sum())
    mechanical = (2 * len(pair) - one) / (len(number) - none - one)
    assert values["z_mechanical"] == pytest.approx(mechanical)
    assert values["rattler_fraction"] == pytest.approx(1 - held.mean())


def _fabric(packing: Packing) -> tuple[np.ndarray, np.ndarray, float]:
    """Normals in 3D, the three principal values of F there, and our a."""
    normal = select_network(packing).contacts.normal
    solid = np.pad(normal, ((0, 0), (0, 3 - normal.shape[1])))
    values = np.linalg.eigvalsh(solid.T @ solid / len(solid))[::-1]
    return solid, values, gf.fabric.anisotropy(gf.fabric_tensor(normal))


def _row(program: str, name: str) -> str:
    """What the table says of a name, whatever program stands in the rows above it."""
    last = ""
    for cells in ROWS:
        last = cells[0] or last
        if len(cells) == 5 and last == program and name in cells[1]:
            return cells[3]
    raise AssertionError(f"the crosswalk has no row {program} {name}")


def test_lammps_fabric(packing: Packing) -> None:
    _, values, a = _fabric(packing)
    contact = 7.5 * (values - 1 / 3)
    said = _row("LAMMPS", "compute fabric")
    np.testing.assert_allclose(2 / 15 * contact + 1 / 3, values)
    if packing.dimension == 3:
        assert "a = (C₁ − C₃)/3" in said
        assert (contact[0] - contact[2]) / 3 == pytest.approx(a)
    else:
        assert "a = (4/15)(C₁ − C₂)" in said
        assert 4 / 15 * (contact[0] - contact[1]) == pytest.approx(a)


def test_spam_anisotropy(packing: Packing) -> None:
    _, values, a = _fabric(packing)
    spam = np.sqrt(1.5 * np.sum((7.5 * (values - 1 / 3)) ** 2))
    said = _row("spam", "fabricTensor")
    assert "a_spam/(3 √(1 − b + b²))" in said
    flat = np.sqrt(1.5 * np.sum((7.5 * (np.array([0.5, 0.5, 0.0]) - 1 / 3)) ** 2))
    assert f"a_spam = {flat:.2f}" in said
    if packing.dimension == 3:
        b = measure(packing)["b_g"]
        assert isinstance(b, float)
        assert spam / (3 * np.sqrt(1 - b + b * b)) == pytest.approx(a)
        axial = np.array([0.5, 0.25, 0.25])
        third = np.sqrt(1.5 * np.sum((7.5 * (axial - 1 / 3)) ** 2)) / 3
        assert third == pytest.approx(2.5 * 0.25)


def test_kanatani_third_kind(packing: Packing) -> None:
    _, values, a = _fabric(packing)
    said = _row("Kanatani", "third kind")
    if packing.dimension == 3:
        third = 7.5 * (values - 1 / 3)
        assert "a = (D₁ − D₃)/3" in said
        assert (third[0] - third[2]) / 3 == pytest.approx(a)
    else:
        third = 4 * (values[:2] - 1 / 2)
        assert "a = (D₁ − D₂)/2 = D₁" in said
        assert (third[0] - third[1]) / 2 == pytest.approx(a)
        assert third[0] == pytest.approx(a)


def test_stresses_of_others(packing: Packing) -> None:
    contacts, cell = packing.contacts, packing.cell
    assert contacts is not None and contacts.force is not None and cell is not None
    branch = gf.fabric.branch_vectors(packing)
    ours = gf.fabric.stress_tensor(packing)
    # YADE sums the force on the second body times the branch from the second to the first
    yade = contacts.force.T @ -branch / cell.volume
    assert _row("YADE", "getStress()") == "σ = −getStress()"
    np.testing.assert_allclose(-yade, ours)
    # LAMMPS' stress of a grain: minus half the virial of its contacts
    virial = 0.5 * np.einsum("ci,cj->cij", contacts.force, branch)
    grain = np.zeros((packing.grains.count, *ours.shape))
    for side in (0, 1):
        np.add.at(grain, contacts.pair[:, side], -virial)
    assert "σ = −Σ/V" in _row("LAMMPS", "stress/atom")
    np.testing.assert_allclose(-grain.sum(axis=0) / cell.volume, ours)
    values = np.linalg.eigvalsh((ours + ours.T) / 2)[::-1]
    q = values[0] - values[-1]
    ratio = gf.fabric.stress_ratio(ours) * np.trace(ours) / len(ours)
    if packing.dimension == 3:
        assert "3 × ours" in _row("triaxial tests", "q, M")
        assert q == pytest.approx(3 * ratio)
    else:
        assert q / 2 == pytest.approx(ratio)


def test_counts_of_others(packing: Packing) -> None:
    values = measure(packing, criterion="gap:0.0", z_definition="z")
    pairs = gf.fabric.neighbours_within(packing, 0.0).pair
    overlapping = np.bincount(pairs.ravel(), minlength=packing.grains.count)
    assert overlapping.mean() == pytest.approx(values["z"])  # contact/atom, coord/gran
    assert packing.cell is not None
    radius, three = packing.grains.radius, packing.dimension == 3
    solid = np.sum(4 / 3 * np.pi * radius**3 if three else np.pi * radius**2)
    porosity = (packing.cell.volume - solid) / packing.cell.volume
    assert _row("YADE", "porosity") == "φ = 1 − n"
    assert 1 - porosity == pytest.approx(values["phi"])


def test_the_rate_of_axial_tests() -> None:
    said = _row("biaxial, triaxial tests", "axial rate")
    make: dict[int, Callable[..., gf.Loading]] = {2: gf.Biaxial, 3: _triaxial}
    for dimension, loading in make.items():
        given = loading(axial_rate=1e-3)
        factor = {2: "×2 in 2D", 3: "×3/2 in 3D"}[dimension]
        assert factor in said
        assert given.nominal_rate == pytest.approx(1e-3 * {2: 2.0, 3: 1.5}[dimension])


def _triaxial(*, axial_rate: float) -> gf.Loading:
    return gf.Biaxial(axial_rate=axial_rate, dimension=3)


def test_the_blocks_run(tmp_path: Path) -> None:
    last = sheared(tmp_path, 3)[-1]
    shell = Shell(tmp_path)
    for language, text in blocks(PAGE, "console", "python"):
        if language == "console":
            for command in commands(text):
                assert "frame" in shell.run(command.line)
        else:
            (tmp_path / "mine.py").write_text(text, encoding="utf-8")
            words = re.findall(r"= ([\d.]+)", shell.run("python mine.py"))
            _, _, a = _fabric(last)
            assert float(words[0]) == pytest.approx(a, abs=6e-4)
            assert float(words[2]) > float(words[0])
