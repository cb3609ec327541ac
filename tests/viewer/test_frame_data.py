"""A frame's block of bytes decodes to the packing, its contacts and their changes."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from sheared_run import sheared_frames

from granufab.errors import CorruptFile
from granufab.fabric import balance, force_values, select_contacts, select_network
from granufab.fabric.criterion import normal_force, parse_criterion
from granufab.viewer import Choice, ViewedRun, frame_buffer, unpack

SINGLE = 2e-6


def chosen(criterion: str = "force", definition: str = "z_backbone") -> Choice:
    return Choice(
        criterion=parse_criterion(criterion), z_definition=definition, minimum=2, reach=0.05
    )  # fmt: skip


@pytest.mark.parametrize("dimension", [2, 3])
def test_grains_lie_in_the_cell_and_are_those_of_the_packing(dimension: int) -> None:
    frame = list(sheared_frames(dimension, 3))[-1]
    header, arrays = unpack(frame_buffer(frame, chosen()))
    packing = frame.packing
    assert header["grain_count"] == packing.grains.count == len(arrays["position"])
    vectors, origin = np.array(header["cell"]["vectors"]), np.array(header["origin"])
    assert np.array_equal(vectors, packing.cell.matrix.T)
    share = arrays["position"] @ np.linalg.inv(vectors)
    assert share.min() >= -SINGLE
    assert share.max() <= 1 + SINGLE
    turns = (packing.grains.position - origin - arrays["position"]) @ np.linalg.inv(vectors)
    assert np.abs(turns - np.rint(turns)).max() < SINGLE
    assert np.abs(turns).max() > 0.5  # the packing itself is not wrapped
    for name in ("radius", "velocity", "spin"):
        assert arrays[name] == pytest.approx(getattr(packing.grains, name), rel=SINGLE)
    assert arrays["number"].tolist() == packing.grains.number.tolist()
    corners = np.array(list(product((0, 1), repeat=dimension))) @ vectors
    assert header["low"] == pytest.approx(corners.min(axis=0))
    assert header["high"] == pytest.approx(corners.max(axis=0))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("criterion", ["force", "gap:0.02", "listed"])
def test_contacts_are_those_of_the_criterion(dimension: int, criterion: str) -> None:
    frame = list(sheared_frames(dimension, 3))[-1]
    choice = chosen(criterion)
    header, arrays = unpack(frame_buffer(frame, choice))
    contacts = select_contacts(frame.packing, criterion, reach=0.05)
    network = select_network(frame.packing, criterion=criterion, reach=0.05)
    assert header["contact_count"] == contacts.count == len(arrays["pair"])
    assert header["criterion"] == criterion
    assert np.array_equal(arrays["pair"], contacts.pair)
    for name in ("normal", "branch", "gap"):
        assert arrays[name] == pytest.approx(getattr(contacts, name), rel=SINGLE, abs=SINGLE)
    assert np.array_equal(arrays["held"], network.coordination.held)
    assert arrays["counted"].sum() == network.contacts.count < contacts.count + 1
    assert arrays["contact_number"].sum() == 2 * contacts.count
    # The line from i along the branch ends at the image of j.
    i, j = arrays["pair"].T.astype(int)
    end = arrays["position"][j] + arrays["image"] @ np.array(header["cell"]["vectors"])
    assert arrays["position"][i] + arrays["branch"] == pytest.approx(end, abs=20 * SINGLE)
    assert np.any(arrays["image"] != 0)


def test_forces_are_in_units_of_the_mean_that_parts_strong_from_weak() -> None:
    frame = list(sheared_frames(2, 2))[-1]
    header, arrays = unpack(frame_buffer(frame, chosen()))
    contacts = select_contacts(frame.packing, "force")
    force = arrays["normal_force"] * header["mean_normal_force"]
    assert force == pytest.approx(normal_force(contacts), rel=SINGLE, abs=SINGLE)
    assert arrays["force"] * header["mean_normal_force"] == pytest.approx(
        contacts.force, rel=SINGLE, abs=1e-5
    )
    used = arrays["counted"] == 1
    assert arrays["normal_force"][used].mean() == pytest.approx(1.0, rel=1e-6)
    strong = force_values(frame)["strong_share"]
    assert (arrays["normal_force"][used] > 1).mean() == pytest.approx(strong)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("place", [1, 2, 3])  # from 1 to 2 the cell is remapped
def test_gained_and_lost_contacts_close(dimension: int, place: int) -> None:
    frames = list(sheared_frames(dimension, 4))
    before, after = frames[place - 1 : place + 1]
    header, arrays = unpack(frame_buffer(after, chosen("gap:0.02"), before=before))
    counted = balance(before, after, criterion="gap:0.02", reach=0.05)
    changes = header["changes"]
    assert (changes["gained"], changes["lost"]) == (counted["gained"], counted["lost"])
    assert arrays["gained"].sum() == changes["gained"] > 0
    old = select_contacts(before.packing, "gap:0.02", reach=0.05).count
    assert header["contact_count"] == old + changes["gained"] - changes["lost"]
    # A lost contact is open now, along the very line that is drawn for it.
    radius = arrays["radius"][arrays["lost_pair"]].sum(axis=1)
    gap = np.linalg.norm(arrays["lost_branch"], axis=1) - radius
    assert gap.min() >= 0.02 * 2 * header["mean_radius"] - SINGLE
    # and was closed before: the same pair, turned by no more than the step of shear.
    assert np.median(gap) < 0.2


def test_changes_of_the_first_frame_and_of_other_grains_are_explained() -> None:
    first, second = sheared_frames(2, 2)
    header, arrays = unpack(frame_buffer(first, chosen()))
    assert header["changes"] == {"missing": "there is no frame before"}
    assert "gained" not in arrays
    grains = replace(second.packing.grains, number=second.packing.grains.number + 1)
    other = replace(second, packing=replace(second.packing, grains=grains))
    header, _ = unpack(frame_buffer(other, chosen(), before=first))
    assert "different grains" in header["changes"]["missing"]


def test_a_state_without_contacts_is_drawn_as_grains() -> None:
    frame = next(sheared_frames(2, 1))
    bare = replace(frame, packing=replace(frame.packing, contacts=None, cell=None))
    header, arrays = unpack(frame_buffer(bare, chosen()))
    assert header["missing"] == header["changes"]["missing"]
    assert "contacts" in header["missing"]
    assert header["cell"] is None
    assert "pair" not in arrays
    assert np.all(arrays["position"] - arrays["radius"][:, None] >= np.array(header["low"]) - 1e-6)
    assert np.all(arrays["position"] + arrays["radius"][:, None] <= np.array(header["high"]) + 1e-6)


def test_the_layout_is_the_one_of_the_page() -> None:
    """Read by hand, as docs/viewer.md tells it."""
    frame = next(sheared_frames(2, 1))
    block = frame_buffer(frame, chosen(), header={"run": 3})
    assert block[:4] == b"GFV1"
    (length,) = struct.unpack_from("<I", block, 4)
    assert (8 + length) % 8 == 0
    header = json.loads(block[8 : 8 + length].decode())
    assert header["run"] == 3
    item = header["arrays"]["radius"]
    assert item["type"] == "float32"
    begin = 8 + length + item["offset"]
    values = struct.unpack_from(f"<{item['shape'][0]}f", block, begin)
    assert values == pytest.approx(frame.packing.grains.radius, rel=SINGLE)
    assert all(entry["offset"] % 8 == 0 for entry in header["arrays"].values())
    with pytest.raises(CorruptFile, match="no frame"):
        unpack(b"something")


def test_the_frame_of_a_file_is_the_frame(
    view_of: Callable[[Path], ViewedRun], run_file: Path
) -> None:
    viewed = view_of(run_file)
    frame = viewed.frame(5)
    direct = list(sheared_frames(2))[5]
    choice = viewed.choice(None, None)
    assert frame_buffer(frame, choice) == frame_buffer(direct, choice)
