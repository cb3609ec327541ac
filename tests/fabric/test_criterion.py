import numpy as np
import pytest
from fabric_cases import hexagonal
from hypothesis import given
from hypothesis import strategies as st

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import parse_criterion, select_contacts, wall_support
from granufab.packing import Cell, Contacts, Grains, Packing, WallContacts


def row(gaps, forces=None, listed=None):
    """Disks of diameter 2 in a row with these gaps; ``listed`` pairs only, if given."""
    position = np.cumsum([0.0, *[2.0 + g for g in gaps]])
    count = len(position)
    listed = list(range(count - 1)) if listed is None else listed
    normal = np.tile([1.0, 0.0], (len(listed), 1))
    contacts = Contacts(
        pair=np.array([(k, k + 1) for k in listed]),
        normal=normal,
        gap=np.array(gaps)[listed],
        force=None if forces is None else np.array(forces)[listed, None] * normal,
    )
    return Packing(
        grains=Grains(position=np.column_stack([position, np.zeros(count)]), radius=np.ones(count)),
        contacts=contacts,
    )


@given(st.floats(0, 1))
def test_a_criterion_reads_back_its_own_words(gap):
    assert parse_criterion(parse_criterion(f"gap:{gap!r}").text) == parse_criterion(f"gap:{gap!r}")


@given(st.floats(0, 10))
def test_a_force_criterion_reads_back_its_share(share):
    assert parse_criterion(f"force:{share!r}").share == share
    assert parse_criterion(parse_criterion(f"force:{share!r}").text).share == share


def test_the_share_of_a_force_criterion_moves_the_threshold():
    packing = row([0.0, 0.0, 0.0, 0.0], [1.0, 3.0, 0.02, -0.5])
    # The mean over pushing contacts is 1.34; a pulling one counts by its size.
    for share, kept in ((0.02, [0, 1, 3]), (0.5, [0, 1]), (1.0, [1]), (3.0, [])):
        assert select_contacts(packing, f"force:{share}").pair[:, 0].tolist() == kept


def test_force_and_listed_read_back():
    assert [parse_criterion(text).text for text in ("force", " listed ", "gap:0.015")] == [
        "force",
        "listed",
        "gap:0.015",
    ]


@pytest.mark.parametrize(
    "text",
    ["forces", "gap", "gap:", "gap:x", "gap:-0.1", "gap:nan", "gap:2", "force:-1", "force:x"],
)
def test_bad_criteria_are_refused_in_one_line(text):
    with pytest.raises(InvalidSettings) as caught:
        parse_criterion(text)
    assert "\n" not in str(caught.value)
    assert repr(text) in str(caught.value)


def test_force_keeps_what_bears_more_than_a_millionth_of_the_mean():
    packing = row([0.0, 0.0, 0.0, 0.0], [1.0, 3.0, 1e-5, 1e-6])
    # Mean 1.00000275: threshold just above 1e-6.
    assert select_contacts(packing, "force").pair[:, 0].tolist() == [0, 1, 2]


def test_gap_is_measured_in_mean_diameters_and_finds_unlisted_pairs():
    packing = row([-0.01, 0.019, 0.021], [1.0, 0.0, 0.0], listed=[0])
    found = select_contacts(packing, "gap:0.01")
    assert found.pair.tolist() == [[0, 1], [1, 2]]
    assert found.force is None
    # A list known to be complete is used, and keeps its forces.
    kept = select_contacts(packing, "gap:0.01", reach=0.05)
    assert kept.pair.tolist() == [[0, 1]]
    assert kept.force is not None
    # A list that reaches less far than asked is not.
    assert select_contacts(packing, "gap:0.01", reach=0.005).count == 2


def test_missing_forces_and_contacts_name_the_remedy():
    with pytest.raises(MissingData, match="contact forces are not in this data; use the criterion"):
        select_contacts(row([0.0]), "force")
    with pytest.raises(MissingData, match="contacts are not in this data; use the criterion gap"):
        select_contacts(hexagonal(), "listed")


def test_walls_support_under_each_criterion():
    packing = Packing(
        grains=Grains(position=[[1.0, 1.0], [5.0, 5.0]], radius=[1.0, 1.0]),
        cell=Cell(matrix=10 * np.eye(2), periodic=(False, False)),
        wall_contacts=WallContacts(
            grain=np.array([0, 0]),
            wall=np.array([0, 2]),
            normal=np.array([[-1.0, 0], [0, -1.0]]),
            gap=np.zeros(2),
            force=np.array([[-2.0, 0.0], [0, 0]]),
        ),
        contacts=None,
    )
    for text, number in (("force", 1), ("listed", 2), ("gap:0.01", 2)):
        support = wall_support(packing, text)
        assert support is not None
        assert support.tolist() == [number, 0]
    assert wall_support(hexagonal(), "gap:0.01") is None
