"""
LIGGGHTS: contacts in a local dump
==================================

``compute pair/gran/local`` with ``dump local`` gives columns that have no names. They are told by
repeating the words of the compute in their order. Forces are those on the first grain. Atoms come
from ``dump custom`` as in LAMMPS. See :doc:`/formats`; the other way is a dump of VTK lines.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import compared, counted, edges, lines, points, spheres

import granufab as gf
from granufab import plots

packing = spheres(seed=8)

# %%
# Write both files and read them with the words of the compute. After the two ids comes a mark of
# contacts across the periodic boundary.

contacts, position = packing.contacts, packing.grains.position
bounds = "".join(f"0 {edge:.12g}\n" for edge in edges(packing))
head = "ITEM: TIMESTEP\n500\nITEM: NUMBER OF {}\n{}\nITEM: BOX BOUNDS pp pp pp\n{}ITEM: {}\n"
count = packing.grains.count
atoms_text = head.format("ATOMS", count, bounds, "ATOMS id type x y z radius") + lines(
    np.arange(count) + 1, 1, position, packing.grains.radius
)
first, second = contacts.pair.T
across = np.abs(contacts.branch - (position[second] - position[first])).max(axis=1) > 1e-6
words = "pos id force contactPoint delta"
columns = "ENTRIES " + " ".join(f"c_1[{k}]" for k in range(1, 17))
local_text = head.format("ENTRIES", contacts.count, bounds, columns) + lines(
    position[first], position[second], contacts.pair + 1, across.astype(int),
    -contacts.force, points(packing), -contacts.gap,
)  # fmt: skip
with tempfile.TemporaryDirectory() as folder:
    atoms, local = Path(folder) / "atoms.dump", Path(folder) / "contacts.dump"
    atoms.write_text(atoms_text)
    local.write_text(local_text)
    run = gf.read(atoms, local, columns={"contacts": {"order": words}})
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# The contacts that were read, as lines as wide as their normal force; what is farther is paler.

figure = plots.network_3d(state).figure
