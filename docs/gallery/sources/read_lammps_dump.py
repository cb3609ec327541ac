"""
LAMMPS: atoms and contacts of a dump
====================================

``dump custom`` holds the atoms and the box, ``dump local`` the contacts. Its columns have no
names that say what they are: beside the atoms granufab recognises two of them as touching grains,
three as the normal and three as the tangential force. LAMMPS lists the force on the first atom.
The commands that write such files are in :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import compared, counted, edges, lines, parts, spheres

import granufab as gf
from granufab import plots

packing = spheres(seed=7)

# %%
# Write both files, read them together, and print what was recognised.

contacts, (push, across) = packing.contacts, parts(packing)
normal_force = -push[:, None] * contacts.normal  # on the first atom
length = np.linalg.norm(contacts.branch, axis=1)
bounds = "".join(f"0 {edge:.12g}\n" for edge in edges(packing))
head = "ITEM: TIMESTEP\n1000\nITEM: NUMBER OF {}\n{}\nITEM: BOX BOUNDS pp pp pp\n{}ITEM: {}\n"
count = packing.grains.count
atoms_text = head.format("ATOMS", count, bounds, "ATOMS id type x y z radius mass") + lines(
    np.arange(count) + 1, 1, packing.grains.position, packing.grains.radius, packing.grains.mass
)
columns = "ENTRIES index " + " ".join(f"c_pair[{k}]" for k in range(1, 10))
local_text = head.format("ENTRIES", contacts.count, bounds, columns) + lines(
    np.arange(contacts.count) + 1, contacts.pair + 1, length, normal_force, -across
)
with tempfile.TemporaryDirectory() as folder:
    atoms, local = Path(folder) / "atoms.dump", Path(folder) / "contacts.dump"
    atoms.write_text(atoms_text)
    local.write_text(local_text)
    run = gf.read(atoms, local)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
