"""
LMGC90: HDF5
============

Recent versions of LMGC90 write one HDF5 file of displacements and contacts, with a part that
tells what its columns hold. Radii are only in ``BODIES.DAT``, so both are given. The periodic
cell comes by ``cell=``. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import h5py
import numpy as np
from shared_bodies import bodies
from shared_packing import box, compared, counted, disks, points

import granufab as gf
from granufab import plots

packing = disks(seed=11)

# %%
# Write both files and read them; what the columns hold stands in the part ``Help``.

grains, contacts = packing.grains, packing.contacts
normal = contacts.normal  # from the antagonist, the first grain, to the candidate
tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
push = np.einsum("ci,ci->c", contacts.force, normal)
along = np.einsum("ci,ci->c", contacts.force, tangent)

columns = (
    ("RBDY2", "rdata", {"X (x,y,theta)": 3, "V (x,y,rot)": 3}),
    ("RBDY2", "idata", {"visible": 1}),
    ("VlocRloc", "idata", {"bdyty (cd,an)": 2, "ibdyty (cd,an)": 2}),
    ("VlocRloc", "rdata", {"rl (t,n)": 2, "gapTT": 1, "coor (x,y)": 2, "uc (nx,ny)": 2}),
)
with tempfile.TemporaryDirectory() as folder:
    with h5py.File(Path(folder) / "lmgc90.h5", "w") as file:
        for group, table, fields in columns:
            start = 1
            for name, width in fields.items():
                place = file.create_group(f"Help/{group}/{table}/{name.split()[0]}")
                place["bound"] = np.array([start, start + width - 1], np.int32)
                place["name"] = np.bytes_(name.encode())
                start += width
        at = file.create_group("Evolution/ID_1")
        at["TPS"], at["NStep"] = packing.time, np.int32(1)
        at["RBDY2/rdata"] = np.zeros((grains.count, 6))
        at["RBDY2/idata"] = np.ones((grains.count, 1), np.int32)
        kinds = np.ones((contacts.count, 2), np.int32)
        at["VlocRloc/idata"] = np.hstack([kinds, contacts.pair[:, ::-1] + 1]).astype(np.int32)
        at["VlocRloc/rdata"] = np.column_stack([along, push, contacts.gap, points(packing), normal])
    (Path(folder) / "BODIES.DAT").write_text(bodies(packing))
    paths = Path(folder) / "lmgc90.h5", Path(folder) / "BODIES.DAT"
    run = gf.read(*paths, cell=box(packing), periodic="xy")
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; BODIES.DAT has eight digits.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-5

# %%
# Contacts per grain and direction, with the second-order fit: compression was vertical.

network = gf.fabric.select_network(state)
figure = plots.rose(gf.orientation(network.contacts, z=network.z, bins=12)).figure
