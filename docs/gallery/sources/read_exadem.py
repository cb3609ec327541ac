"""
exaDEM: frames and interactions
===============================

exaDEM writes frames as extended XYZ and interactions as tables of 21 columns, one file a process,
in files whose names tell the step. Forces are those on the first body. See :doc:`/formats`.
"""

import tempfile
from pathlib import Path

import numpy as np
from shared_packing import (
    compared,
    counted,
    edges,
    lines,
    parts,
    points,
    spheres,
)

import granufab as gf
from granufab import plots

packing = spheres(seed=2)

# %%
# Write both files of step 20 and read them together.

grains, contacts = packing.grains, packing.contacts
push, across = parts(packing)
lattice = " ".join(f"{number:.12g}" for number in np.diag(edges(packing)).ravel())
frame = f'{grains.count}\nLattice="{lattice}" Properties=species:S:1:pos:R:3:vel:R:3:mass:R:1:'
frame += f'vrot:R:3:id:I:1:radius:R:1 Time={packing.time} pbc="T T T"\n'
frame += lines(
    "ball", grains.position, "0 0 0", grains.mass, "0 0 0", np.arange(grains.count), grains.radius
)
table = lines(
    contacts.pair, "0,0,0", contacts.gap, points(packing), -push[:, None] * contacts.normal,
    -across, grains.position[contacts.pair[:, 0]], grains.position[contacts.pair[:, 1]], mark=",",
)  # fmt: skip
with tempfile.TemporaryDirectory() as folder:
    atoms = Path(folder) / "dem_000000020.xyz"
    interactions = Path(folder) / "InteractionOutputDir-20_0.txt"
    atoms.write_text(frame)
    interactions.write_text(table)
    run = gf.read(atoms, interactions)
    state = run.frames[0].packing
print(*run.frames.summary.lines(), sep="\n")

# %%
# z, a and q/p must be those that numpy counts in the packing; twelve digits were written.

found = gf.measure(state, z_definition="z")
assert compared(found, counted(packing)) < 1e-8

# %%
# Contacts per grain and direction, around the axis of compression, with the second-order fit.

network = gf.fabric.select_network(state)
along = gf.orientation(network.contacts, z=network.z, bins=8, axis=np.array([0.0, 1.0, 0.0]))
figure = plots.rose(along).figure
